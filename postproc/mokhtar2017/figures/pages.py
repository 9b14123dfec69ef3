"""The figures of the paper, each with its number and the cases that it shows, and how they are drawn."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from postproc.figures.cascade import waterfall
from postproc.figures.cascade_lines import draw_frequencies, draw_orders
from postproc.figures.drawing import house_style
from postproc.mokhtar2017.claims import cases
from postproc.mokhtar2017.claims.quantities import (
    largest_orbit,
    spin_frequency,
    torsional_cascade,
)
from postproc.mokhtar2017.figures.panels import (
    HEIGHT,
    ORDERS,
    closeup,
    energy,
    legend,
    lines,
    mark_lines,
    orbits,
    over_time,
    page,
    share_bar,
    title,
    windowed,
)
from postproc.signals.contacts import contact_spans
from postproc.store.rig_of_case import natural_frequencies
from rubhpc.errors import writing

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    import xarray as xr
    from matplotlib.figure import Figure

    from postproc.mokhtar2017.claims.cases import Cases

_TURNS = 5  # revolutions in a Hilbert spectrum
_BESIDE = 0.2  # in r: the speeds shown on either side of a resonance
_LIMIT = 250.0  # Hz, of the cascade
_MODULUS = "stator_youngs_modulus"
_EXTREMES = {_MODULUS: [cases.SOFT, cases.STIFF]}


@dataclass(frozen=True)
class PaperFigure:
    """One figure: the cases that it shows, and the function that draws them."""

    shown: tuple[Cases, ...]
    draw: Callable[..., Figure]

    @property
    def studies(self) -> list[str]:
        """The studies whose stores are needed."""
        return [some.study for some in self.shown]

    def of(self, stores: Mapping[str, xr.Dataset]) -> Figure:
        """Return the figure, drawn from stores."""
        return self.draw(*(some.of(stores) for some in self.shown))


FIGURES: dict[int, PaperFigure] = {}


def _figure(number: int, *shown: Cases) -> Callable[[Callable[..., Figure]], Callable[..., Figure]]:
    """Return a decorator that enters a function as a figure of some cases."""

    def enter(draw: Callable[..., Figure]) -> Callable[..., Figure]:
        FIGURES[number] = PaperFigure(shown, draw)
        return draw

    return enter


@_figure(3, cases.FREEDOM)
def lateral_freedom(store: xr.Dataset) -> Figure:
    """Fig. 3: orbits with and without freedom of the stator to bend."""
    figure, ax = page("abc", 70)
    names = ["free to bend", "held"]
    for panel, speed in zip(ax.values(), (0.75, 1.5, 3.0), strict=True):
        every = store.sel(speed_ratio=speed)
        orbits(every, panel, "stator_1_lateral", names=names, gap=float(every["clearance"]))
        title(panel, f"$r$ = {speed:g}")
    ax["a"].legend(loc="upper right")
    return figure


@_figure(4, cases.WALL, cases.SMALL_GAP)
def conventional_law(penalty: xr.Dataset, multiplier: xr.Dataset) -> Figure:
    """Fig. 4: vertical motion and torsion of a fixed wall with a contact stiffness, and of the multiplier."""
    figure, ax = page("ab cd", 105)
    over_time(penalty, ax, {"vertical": "a", "torsion": "c"}, 6)
    over_time(multiplier, ax, {"vertical": "b", "torsion": "d"}, 6)
    for left, right in (("a", "b"), ("c", "d")):
        low, high = zip(ax[left].get_ylim(), ax[right].get_ylim(), strict=True)
        for panel in (ax[left], ax[right]):
            panel.set_ylim(min(low), max(high))
    title(ax["a"], "fixed wall, contact stiffness")
    title(ax["b"], "multiplier, stator that moves")
    return figure


@_figure(5, cases.STIFF_SPEEDS)
def resonances(every: xr.Dataset) -> Figure:
    """Fig. 5: orbits at and on either side of the largest one, for 1X, 1/2X and 1/3X."""
    figure, ax = page("abc", 85)
    for panel, ends in zip(ax.values(), cases.RESONANCES, strict=True):
        at = float(largest_orbit(every.sel(speed_ratio=slice(*ends)))["speed_ratio"])
        near = every.sel(speed_ratio=[at - _BESIDE, at, at + _BESIDE], method="nearest")
        orbits(near, panel, "speed_ratio")
        panel.legend(loc="lower right")
        title(panel, f"about $r$ = {at:.1f}")
    return figure


@_figure(6, cases.LARGE_GAP)
def larger_gap(case: xr.Dataset) -> Figure:
    """Fig. 6: motion with the larger gap, over time and frequency, and as an orbit."""
    figure, ax = page("ab cd ef gh", 190)
    over_time(case, ax, {"vertical": "a", "horizontal": "c", "torsion": "e", "torsion_acceleration": "g"})
    for name, letter, limit in (("vertical", "b", 120), ("horizontal", "d", 120), ("torsion", "f", 300)):
        lines(case, name, ax[letter], limit)
    orbits(case, ax["h"], gap=float(case["clearance"]))
    return figure


@_figure(7, cases.LARGE_GAP)
def contacts(case: xr.Dataset) -> Figure:
    """Fig. 7: the contact force, and what it leaves in the stator."""
    figure, ax = page("a b c", 125)
    over_time(case, ax, {"contact_force": "a", "stator_lateral": "b"}, is_shaded=False)
    spans = contact_spans(case)
    first, end = int(spans["first"][-2]), int(spans["end"][-2])
    closeup(case, "stator_lateral", ax["c"], first, end, before=2e-3, after=11e-3)
    return figure


@_figure(8, cases.LARGE_GAP)
def hilbert_larger_gap(case: xr.Dataset) -> Figure:
    """Fig. 8: torsion under its windows, and the Hilbert spectra of torsion and stator."""
    figure, ax = page("a b c", 160)
    windowed(case, "torsion", ax["a"], _TURNS)
    energy(case, "torsion", ax["b"], _TURNS, 300)
    energy(case, "stator_lateral", ax["c"], _TURNS, 1200)
    share_bar([ax["b"], ax["c"]])
    return figure


@_figure(9, cases.SIXTH_HARMONIC)
def sixth_harmonic(every: xr.Dataset) -> Figure:
    """Fig. 9: torsional spectra with 6X below, at and above the torsional natural frequency."""
    figure, ax = page("abc", 55)
    for i, panel in enumerate(ax.values()):
        case = every.isel(speed=i)
        lines(case, "torsion", panel, 300, n_line=1)
        title(panel, f"spin {spin_frequency(case):.4g} Hz")
    return figure


@_figure(10, cases.FRICTIONS)
def friction_below(every: xr.Dataset) -> Figure:
    """Fig. 10: torsion and lateral motion of the stator over friction."""
    figure, ax = page("a b", 95)
    over_time(every, ax, {"torsion": "a", "stator_lateral": "b"}, 3, "friction")
    legend(ax["a"])
    return figure


@_figure(11, cases.THREE)
def friction_above(every: xr.Dataset) -> Figure:
    """Fig. 11: torsion and orbit at r = 3 over friction."""
    figure, ax = page("aab", 62)
    over_time(every, ax, {"torsion": "a"}, 6, "friction")
    legend(ax["a"])
    orbits(every, ax["b"], "friction", gap=76e-6)
    return figure


@_figure(12, cases.THREE.but(friction=0.3))
def hilbert_at_three(case: xr.Dataset) -> Figure:
    """Fig. 12: spectrum of the horizontal motion at r = 3, and the Hilbert spectrum of torsion."""
    figure, ax = page("ab", 62)
    lines(case, "horizontal", ax["a"], 200)
    energy(case, "torsion", ax["b"], 8, 350)
    share_bar([ax["b"]], "right")
    return figure


@_figure(13, cases.SMALL_GAP)
def smaller_gap(case: xr.Dataset) -> Figure:
    """Fig. 13: motion with the smaller gap."""
    figure, ax = page("ab cd ef", 150)
    signals = {
        "vertical": "a",
        "torsion": "b",
        "stator_lateral": "c",
        "contact_force": "d",
        "torsion_acceleration": "f",
    }
    over_time(case, ax, signals)
    orbits(case, ax["e"], gap=float(case["clearance"]))
    return figure


@_figure(14, cases.SMALL_GAP)
def hilbert_smaller_gap(case: xr.Dataset) -> Figure:
    """Fig. 14: spectra with the smaller gap, and Hilbert spectra of torsion and stator."""
    figure, ax = page("ab cd", 120)
    lines(case, "vertical", ax["a"], 150)
    lines(case, "torsion", ax["b"], 300)
    energy(case, "torsion", ax["c"], _TURNS, 300)
    energy(case, "stator_lateral", ax["d"], 2, 1200)
    share_bar([ax["c"], ax["d"]])
    return figure


@_figure(15, cases.GAPS)
def clearance(every: xr.Dataset) -> Figure:
    """Fig. 15: motion at r = 2 over the gap."""
    figure, ax = page("ab cd ef", 150)
    signals = {
        "vertical": "a",
        "horizontal": "b",
        "torsion": "c",
        "torsion_acceleration": "d",
        "contact_force": "e",
    }
    over_time(every, ax, signals, 3, "clearance")
    legend(ax["e"])
    orbits(every, ax["f"], "clearance")
    return figure


@_figure(16, cases.GAPS.but(clearance=70e-6), cases.GAPS.but(clearance=110e-6))
def hilbert_at_two(small: xr.Dataset, large: xr.Dataset) -> Figure:
    """Fig. 16: torsional spectra at r = 2 of the extreme gaps, and the Hilbert spectrum for the smaller."""
    figure, ax = page("ab cc", 115)
    for letter, case in (("a", small), ("b", large)):
        lines(case, "torsion", ax[letter], 300, n_line=3)
        title(ax[letter], f"$g$ = {1e6 * float(case['clearance']):.0f} µm")
    top = max(ax[letter].get_ylim()[1] for letter in "ab")
    for letter in "ab":
        ax[letter].set_ylim(0, top)
    energy(small, "torsion", ax["c"], 6, 300)
    share_bar([ax["c"]])
    return figure


@_figure(18, cases.NEAR_MODULI.but(**_EXTREMES))
@_figure(17, cases.SMALL_GAP.but(**_EXTREMES))
def compared(every: xr.Dataset) -> Figure:
    """Orbit, torsion, compression and force of the softest and the stiffest stator."""
    figure, ax = page("ab cd", 110)
    orbits(every, ax["a"], _MODULUS)
    over_time(every, ax, {"torsion": "b", "stator_axial": "c", "contact_force": "d"}, 2, _MODULUS)
    legend(ax["b"])
    return figure


@_figure(19, cases.SMALL_GAP.but(**_EXTREMES), cases.NEAR_MODULI.but(**_EXTREMES))
def decay(below: xr.Dataset, near: xr.Dataset) -> Figure:
    """Fig. 19: lateral motion of the stator at both speeds."""
    figure, ax = page("a b", 95)
    for letter, both, speed in (("a", below, 0.75), ("b", near, 1.5)):
        over_time(both, ax, {"stator_lateral": letter}, 2, _MODULUS)
        legend(ax[letter])
        title(ax[letter], f"$r$ = {speed:g}")
    return figure


@_figure(20, cases.STIFF_SPEEDS, cases.FIRST)
def cascade(every: xr.Dataset, first: xr.Dataset) -> Figure:
    """Fig. 20: torsional spectra over speed, with orders, natural and pseudo-critical frequencies."""
    spectra = torsional_cascade(every)
    figure, axes = page("a", 140, width=140)
    ax = axes["a"]
    torsional = float(natural_frequencies(every)["torsional"])
    bending = spin_frequency(largest_orbit(first))
    waterfall(spectra, ax, _LIMIT, height=HEIGHT)
    draw_orders(ax, spectra, ORDERS)
    draw_frequencies(ax, spectra, {"torsional": torsional, "pseudo-critical": bending})
    mark_lines(ax, spectra, torsional, bending)
    ax.set_title("")
    return figure


def draw_figures(
    numbers: Iterable[int], stores: Mapping[str, xr.Dataset], folder: str | Path
) -> Iterator[Path]:
    """Draw figures into a folder, which is made, as figNN.png; yield their paths."""
    folder = Path(folder)
    with writing(folder, "--draw"):
        folder.mkdir(parents=True, exist_ok=True)
        for number in numbers:
            path = folder / f"fig{number:02d}.png"
            with house_style():
                FIGURES[number].of(stores).savefig(path, dpi="figure", pil_kwargs={"optimize": True})
            yield path
