"""The figures of the paper by their numbers, and how they are drawn into a folder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from postproc.figures.style import house_style
from postproc.mokhtar2017.claims import cases
from postproc.mokhtar2017.figures import speed, stiffness, subcritical, supercritical
from rubhpc.errors import InputError, reason_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    import xarray as xr
    from matplotlib.figure import Figure

    from postproc.mokhtar2017.claims.cases import Cases


@dataclass(frozen=True)
class PaperFigure:
    """One figure: the cases that it shows, and the function that draws them."""

    shown: tuple[Cases, ...]
    draw: Callable[..., Figure]

    @property
    def studies(self) -> list[str]:
        """The studies whose stores are needed."""
        return [cases.study for cases in self.shown]

    def of(self, stores: Mapping[str, xr.Dataset]) -> Figure:
        """Return the figure, drawn from stores."""
        return self.draw(*(cases.of(stores) for cases in self.shown))


_EXTREMES = {"stator_youngs_modulus": [cases.SOFT, cases.STIFF]}
FIGURES: dict[int, PaperFigure] = {
    3: PaperFigure((cases.FREEDOM,), stiffness.lateral_freedom),
    4: PaperFigure((cases.WALL, cases.SMALL_GAP), stiffness.conventional_law),
    5: PaperFigure((cases.STIFF_SPEEDS,), speed.resonances),
    6: PaperFigure((cases.LARGE_GAP,), subcritical.larger_gap),
    7: PaperFigure((cases.LARGE_GAP,), subcritical.contacts),
    8: PaperFigure((cases.LARGE_GAP,), subcritical.hilbert_larger_gap),
    9: PaperFigure((cases.SIXTH_HARMONIC,), subcritical.sixth_harmonic),
    10: PaperFigure((cases.FRICTIONS,), subcritical.friction),
    11: PaperFigure((cases.THREE,), supercritical.friction),
    12: PaperFigure((cases.THREE.but(friction=0.3),), supercritical.hilbert_at_three),
    13: PaperFigure((cases.SMALL_GAP,), subcritical.smaller_gap),
    14: PaperFigure((cases.SMALL_GAP,), subcritical.hilbert_smaller_gap),
    15: PaperFigure((cases.GAPS,), supercritical.clearance),
    16: PaperFigure(
        tuple(cases.GAPS.but(clearance=gap) for gap in (70e-6, 110e-6)), supercritical.hilbert_at_two
    ),
    17: PaperFigure((cases.SMALL_GAP.but(**_EXTREMES),), stiffness.compared),
    18: PaperFigure((cases.NEAR_MODULI.but(**_EXTREMES),), stiffness.compared),
    19: PaperFigure((cases.SMALL_GAP.but(**_EXTREMES), cases.NEAR_MODULI.but(**_EXTREMES)), stiffness.decay),
    20: PaperFigure((cases.STIFF_SPEEDS, cases.FIRST), speed.cascade),
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
            with house_style():
                FIGURES[number].of(stores).savefig(path, dpi="figure", pil_kwargs={"optimize": True})
            yield path
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be written: {reason_of(error, folder)}; choose another --draw"
        ) from error
