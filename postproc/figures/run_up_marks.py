"""What figures of run-ups share: critical speeds, speeds along a curve, the sense of rotation."""

from __future__ import annotations

import json
import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.store.rig_of_case import rig_axes, rig_of
from rubhpc.rig.reading import rig_from_dict

if TYPE_CHECKING:
    from collections.abc import Iterable

    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

RPM = 30.0 / math.pi
_STEPS = 60  # of speed, on which modes are followed


def critical_speeds(cases: xr.Dataset, low: float, high: float) -> list[float]:
    """Return the lateral critical speeds that the unbalance excites, rad/s, within a range; [] if unknown.

    Where keys of the rig have several values there is no one rig, and none is returned.
    """
    is_varied = any(cases[name].size > 1 for name in rig_axes(cases) if name in cases.coords)
    if "rig" not in cases.attrs or is_varied or not low < high:
        return []
    coarse = 10.0 ** math.floor(math.log10(high) - 1.0)  # cases of one law differ in their last digits
    table = json.dumps(rig_of(cases).as_dict(), sort_keys=True)
    found = _excited_within(table, math.floor(low / coarse) * coarse, math.ceil(high / coarse) * coarse)
    return [speed for speed in found if low <= speed <= high]


@lru_cache(maxsize=16)
def _excited_within(table: str, low: float, high: float) -> list[float]:
    """The same of a rig, by its table as JSON: each figure of each case of a report asks."""
    from rubhpc.fem.assemble import assemble
    from rubhpc.fem.critical_speeds import find_critical_speeds

    model = assemble(rig_from_dict(json.loads(table), "rig"))
    tabulated = model.rotor.tabulated_speeds
    if tabulated:
        low, high = max(low, tabulated[0]), min(high, tabulated[-1])
        if not low < high:
            return []
    found = find_critical_speeds(model, np.linspace(low, high, _STEPS))
    return [critical.speed for critical in found if critical.is_excited]


def written_speeds(speeds: Iterable[float]) -> str:
    """Words for some critical speeds, rad/s, in a legend."""
    numbers = [f"{RPM * speed:.0f}" for speed in sorted(speeds)]
    return f"critical speed{'s' if len(numbers) > 1 else ''}, {', '.join(numbers)} rpm"


def name_speeds(ax: Axes, x: NDArray[np.float64], y: NDArray[np.float64], speed: NDArray[np.float64]) -> None:
    """Mark speeds (rad/s) along a curve, with the rpm, where they are far enough apart to be read."""
    size = math.hypot(np.ptp(ax.get_xlim()), np.ptp(ax.get_ylim()))
    taken: list[tuple[float, float]] = []
    middle = 0.5 * sum(ax.get_xlim()), 0.5 * sum(ax.get_ylim())
    finite = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    if not finite.size:
        return
    inner = finite[np.linspace(0, finite.size - 1, 41).round().astype(int)]
    for i in (finite[0], finite[-1], *inner):
        if any(math.hypot(x[i] - a, y[i] - b) < 0.085 * size for a, b in taken):
            continue
        taken.append((float(x[i]), float(y[i])))
        across, up = x[i] - middle[0], y[i] - middle[1]
        length = math.hypot(across, up) or 1.0
        ax.plot(x[i], y[i], ".", color="k", markersize=3, zorder=4)
        style: dict[str, Any] = {
            "ha": "left" if across > 0 else "right",
            "va": "bottom" if up > 0 else "top",
            "fontsize": 6,
        }
        ax.annotate(
            f"{RPM * speed[i]:.0f}",
            (x[i], y[i]),
            xytext=(3 * across / length, 3 * up / length),
            textcoords="offset points",
            **style,
        )


def draw_rotation(ax: Axes) -> None:
    """Draw an arrow for positive spin, which turns clockwise, in the upper right corner."""
    from matplotlib.patches import FancyArrowPatch

    ax.add_patch(
        FancyArrowPatch(
            (0.88, 0.975),
            (0.975, 0.88),
            transform=ax.transAxes,
            connectionstyle="arc3,rad=-0.4",
            arrowstyle="-|>",
            mutation_scale=8,
            linewidth=0.9,
            color="k",
        )
    )
    ax.text(0.86, 0.97, "rotation", transform=ax.transAxes, ha="right", va="center", fontsize=6)
