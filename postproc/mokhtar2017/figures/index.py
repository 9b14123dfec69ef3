"""The figures of the paper drawn into a folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from postproc.figures.style import house_style
from postproc.mokhtar2017.figures.pages import FIGURES
from rubhpc.errors import writing

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    import xarray as xr


def draw_figures(
    numbers: Iterable[int], stores: Mapping[str, xr.Dataset], folder: str | Path
) -> Iterator[Path]:
    """Draw figures into a folder, which is made, as figNN.png; yield their paths.

    Raises
    ------
    InputError
        The folder cannot be made or written to.
    """
    folder = Path(folder)
    with writing(folder, "--draw"):
        folder.mkdir(parents=True, exist_ok=True)
        for number in numbers:
            path = folder / f"fig{number:02d}.png"
            with house_style():
                FIGURES[number].of(stores).savefig(path, dpi="figure", pil_kwargs={"optimize": True})
            yield path
