"""Figures of r = 0.75, below the critical speed: 6 to 10, 13 and 14."""

from __future__ import annotations

from typing import TYPE_CHECKING

from postproc.mokhtar2017.claims.quantities import spin_frequency
from postproc.mokhtar2017.figures.hilbert import energy, share_bar, windowed
from postproc.mokhtar2017.figures.page import page, title
from postproc.mokhtar2017.figures.panels import closeup, legend, lines, orbits, over_time
from postproc.signals.contacts import contact_spans

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

_TURNS = 5  # revolutions in a Hilbert spectrum


def larger_gap(case: xr.Dataset) -> Figure:
    """Fig. 6: motion with the larger gap, over time and frequency, and as an orbit."""
    figure, ax = page("ab cd ef gh", 190)
    signals = {"vertical": "a", "horizontal": "c", "torsion": "e", "torsion_acceleration": "g"}
    over_time(case, {name: ax[letter] for name, letter in signals.items()})
    for name, letter, limit in (("vertical", "b", 120), ("horizontal", "d", 120), ("torsion", "f", 300)):
        lines(case, name, ax[letter], limit)
    orbits(case, ax["h"], gap=float(case["clearance"]))
    return figure


def contacts(case: xr.Dataset) -> Figure:
    """Fig. 7: the contact force, and what it leaves in the stator."""
    figure, ax = page("a b c", 125)
    over_time(case, {"contact_force": ax["a"], "stator_lateral": ax["b"]}, is_shaded=False)
    spans = contact_spans(case)
    first, end = int(spans["first"][-2]), int(spans["end"][-2])
    closeup(case, "stator_lateral", ax["c"], first, end, before=2e-3, after=11e-3)
    return figure


def hilbert_larger_gap(case: xr.Dataset) -> Figure:
    """Fig. 8: torsion under its windows, and the Hilbert spectra of torsion and stator."""
    figure, ax = page("a b c", 160)
    windowed(case, "torsion", ax["a"], _TURNS)
    energy(case, "torsion", ax["b"], _TURNS, 300)
    energy(case, "stator_lateral", ax["c"], _TURNS, 1200)
    share_bar([ax["b"], ax["c"]])
    return figure


def sixth_harmonic(every: xr.Dataset) -> Figure:
    """Fig. 9: torsional spectra with 6X below, at and above the torsional natural frequency."""
    figure, ax = page("abc", 55)
    for i, panel in enumerate(ax.values()):
        case = every.isel(speed=i)
        lines(case, "torsion", panel, 300, n_line=1)
        title(panel, f"spin {spin_frequency(case):.4g} Hz")
    return figure


def friction(every: xr.Dataset) -> Figure:
    """Fig. 10: torsion and lateral motion of the stator over friction."""
    figure, ax = page("a b", 95)
    over_time(every, {"torsion": ax["a"], "stator_lateral": ax["b"]}, 3, "friction")
    legend(ax["a"])
    return figure


def smaller_gap(case: xr.Dataset) -> Figure:
    """Fig. 13: motion with the smaller gap."""
    figure, ax = page("ab cd ef", 150)
    signals = {"vertical": "a", "torsion": "b", "stator_lateral": "c", "contact_force": "d"}
    signals |= {"torsion_acceleration": "f"}
    over_time(case, {name: ax[letter] for name, letter in signals.items()})
    orbits(case, ax["e"], gap=float(case["clearance"]))
    return figure


def hilbert_smaller_gap(case: xr.Dataset) -> Figure:
    """Fig. 14: spectra with the smaller gap, and Hilbert spectra of torsion and stator."""
    figure, ax = page("ab cd", 120)
    lines(case, "vertical", ax["a"], 150)
    lines(case, "torsion", ax["b"], 300)
    energy(case, "torsion", ax["c"], _TURNS, 300)
    energy(case, "stator_lateral", ax["d"], 2, 1200)
    share_bar([ax["c"], ax["d"]])
    return figure
