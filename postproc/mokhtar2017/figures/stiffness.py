"""Figures of the stator: free to bend or not (3), a fixed wall (4), and of several moduli (17 to 19)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from postproc.mokhtar2017.figures.page import page, title
from postproc.mokhtar2017.figures.panels import legend, orbits, over_time

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

_MODULUS = "stator_youngs_modulus"


def lateral_freedom(cases: xr.Dataset) -> Figure:
    """Fig. 3: orbits with and without freedom of the stator to bend."""
    figure, ax = page("abc", 70)
    names = ["free to bend", "held"]
    for panel, speed in zip(ax.values(), (0.75, 1.5, 3.0), strict=True):
        every = cases.sel(speed_ratio=speed)
        orbits(every, panel, "stator_1_lateral", names=names, gap=float(every["clearance"]))
        title(panel, f"$r$ = {speed:g}")
    ax["a"].legend(loc="upper right")
    return figure


def conventional_law(penalty: xr.Dataset, multiplier: xr.Dataset) -> Figure:
    """Fig. 4: vertical motion and torsion of a fixed wall with a contact stiffness, and of the multiplier."""
    figure, ax = page("ab cd", 105)
    over_time(penalty, {"vertical": ax["a"], "torsion": ax["c"]}, 6)
    over_time(multiplier, {"vertical": ax["b"], "torsion": ax["d"]}, 6)
    for left, right in (("a", "b"), ("c", "d")):
        low, high = zip(ax[left].get_ylim(), ax[right].get_ylim(), strict=True)
        for panel in (ax[left], ax[right]):
            panel.set_ylim(min(low), max(high))
    title(ax["a"], "fixed wall, contact stiffness")
    title(ax["b"], "multiplier, stator that moves")
    return figure


def compared(every: xr.Dataset) -> Figure:
    """Figs 17 and 18: orbit, torsion, compression and force of the softest and the stiffest stator."""
    figure, ax = page("ab cd", 110)
    orbits(every, ax["a"], _MODULUS)
    signals = {"torsion": "b", "stator_axial": "c", "contact_force": "d"}
    over_time(every, {name: ax[letter] for name, letter in signals.items()}, 2, _MODULUS)
    legend(ax["b"])
    return figure


def decay(below: xr.Dataset, near: xr.Dataset) -> Figure:
    """Fig. 19: lateral motion of the stator at both speeds."""
    figure, ax = page("a b", 95)
    for panel, both, speed in zip(ax.values(), (below, near), (0.75, 1.5), strict=True):
        over_time(both, {"stator_lateral": panel}, 2, _MODULUS)
        legend(panel)
        title(panel, f"$r$ = {speed:g}")
    return figure
