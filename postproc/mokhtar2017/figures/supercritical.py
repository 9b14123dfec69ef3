"""Figures above the critical speed: 11 and 12 (r = 3), 15 and 16 (r = 2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from postproc.mokhtar2017.figures.hilbert import energy, share_bar
from postproc.mokhtar2017.figures.page import page, title
from postproc.mokhtar2017.figures.panels import legend, lines, orbits, over_time

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


def friction(every: xr.Dataset) -> Figure:
    """Fig. 11: torsion and orbit at r = 3 over friction."""
    figure, ax = page("aab", 62)
    over_time(every, {"torsion": ax["a"]}, 6, "friction")
    legend(ax["a"])
    orbits(every, ax["b"], "friction", gap=76e-6)
    return figure


def hilbert_at_three(case: xr.Dataset) -> Figure:
    """Fig. 12: spectrum of the horizontal motion at r = 3, and the Hilbert spectrum of torsion."""
    figure, ax = page("ab", 62)
    lines(case, "horizontal", ax["a"], 200)
    energy(case, "torsion", ax["b"], 8, 350)
    share_bar([ax["b"]], "right")
    return figure


def clearance(every: xr.Dataset) -> Figure:
    """Fig. 15: motion at r = 2 over the gap."""
    figure, ax = page("ab cd ef", 150)
    signals = {"vertical": "a", "horizontal": "b", "torsion": "c", "torsion_acceleration": "d"}
    signals |= {"contact_force": "e"}
    over_time(every, {name: ax[letter] for name, letter in signals.items()}, 3, "clearance")
    legend(ax["e"])
    orbits(every, ax["f"], "clearance")
    return figure


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
