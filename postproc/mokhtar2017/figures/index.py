"""The figures of the paper by their numbers, and how they are drawn into a folder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from postproc.figures.style import house_style
from postproc.mokhtar2017.figures import speed, stiffness, subcritical, supercritical
from rubhpc.errors import InputError, reason_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    import xarray as xr
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class PaperFigure:
    """One figure: how it is drawn, and the studies whose stores that takes."""

    draw: Callable[..., Figure]
    studies: tuple[str, ...]


FIGURES: dict[int, PaperFigure] = {
    3: PaperFigure(stiffness.lateral_freedom, ("lateral_freedom",)),
    4: PaperFigure(stiffness.conventional_law, ("penalty", "subcritical")),
    5: PaperFigure(speed.resonances, ("speed",)),
    6: PaperFigure(subcritical.larger_gap, ("subcritical",)),
    7: PaperFigure(subcritical.contacts, ("subcritical",)),
    8: PaperFigure(subcritical.hilbert_larger_gap, ("subcritical",)),
    9: PaperFigure(subcritical.sixth_harmonic, ("sixth_harmonic",)),
    10: PaperFigure(subcritical.friction, ("subcritical",)),
    11: PaperFigure(supercritical.friction, ("friction",)),
    12: PaperFigure(supercritical.hilbert_at_three, ("friction",)),
    13: PaperFigure(subcritical.smaller_gap, ("subcritical",)),
    14: PaperFigure(subcritical.hilbert_smaller_gap, ("subcritical",)),
    15: PaperFigure(supercritical.clearance, ("clearance",)),
    16: PaperFigure(supercritical.hilbert_at_two, ("clearance",)),
    17: PaperFigure(stiffness.below, ("subcritical",)),
    18: PaperFigure(stiffness.near, ("resonance",)),
    19: PaperFigure(stiffness.decay, ("subcritical", "resonance")),
    20: PaperFigure(speed.cascade, ("speed",)),
}


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
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for number in numbers:
            path = folder / f"fig{number:02d}.png"
            figure = FIGURES[number]
            with house_style():
                drawn = figure.draw(*(stores[name] for name in figure.studies))
                drawn.savefig(path, dpi="figure", pil_kwargs={"optimize": True})
            yield path
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be written: {reason_of(error, folder)}; choose another --draw"
        ) from error
