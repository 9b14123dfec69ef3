"""What figures of run-ups share: critical speeds, speeds along a curve, the sense of rotation."""

from __future__ import annotations

import json
import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from postproc.figures.label_places import Labels
from postproc.store.rig_of_case import rig_axes, rig_of
from rubhpc.rig.reading import rig_from_dict

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

RPM = 30.0 / math.pi
APART = 0.085  # of the diagonal of a plot, between named speeds
_BACK = 0.1  # of the way of a speed, up to which it may go back and counts as going one way
_STEPS = 60  # of speed, on which modes are followed


def critical_speeds(cases: xr.Dataset, speeds: xr.DataArray) -> list[float]:
    """Return the lateral critical speeds that the unbalance excites, rad/s, among speeds; [] if unknown.

    Where keys of the rig have several values there is no one rig, and none is returned.
    """
    low, high = float(speeds.min()), float(speeds.max())
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


def falling(speed: Floats) -> NDArray[np.bool_]:
    """Whether a speed (n,) that rises and falls is falling; nowhere, if it goes one way but for a tenth."""
    steps = np.nan_to_num(np.gradient(speed)) if speed.size > 1 else np.zeros(speed.size)
    rise, fall = steps[steps > 0.0].sum(), -steps[steps < 0.0].sum()
    is_one_way = min(rise, fall) <= _BACK * max(rise, fall)
    return np.zeros(speed.size, dtype=bool) if is_one_way else steps < 0.0


def written_speeds(speeds: Iterable[float]) -> str:
    """Words for some critical speeds, rad/s, in a legend."""
    numbers = [f"{RPM * speed:.0f}" for speed in sorted(speeds)]
    return f"critical speed{'s' if len(numbers) > 1 else ''}, {', '.join(numbers)} rpm"


def title_of_speeds(data: xr.Dataset) -> list[str]:
    """Words for the speeds of a waveform or an orbit of a run-up, for a title; [] of one speed."""
    if "spin_speeds" not in data.attrs:
        return []
    first, last = (f"{RPM * speed:.0f}" for speed in data.attrs["spin_speeds"])
    return [f"{first} rpm" if first == last else f"{first} to {last} rpm"]


def name_speeds(
    ax: Axes, curves: Sequence[tuple[Floats, Floats]], speed: Floats, apart: float = APART
) -> None:
    """Mark round speeds (of rad/s) along the first curve, with the rpm, where they are far enough apart.

    That is `apart` times the diagonal of the plot.

    Each is written where it covers least of curves and of other labels, those of the grid included, with a
    leader where that is far.
    """
    x, y = curves[0]
    size = math.hypot(np.ptp(ax.get_xlim()), np.ptp(ax.get_ylim()))
    taken: list[tuple[float, float]] = []
    middle = 0.5 * sum(ax.get_xlim()), 0.5 * sum(ax.get_ylim())
    written = Labels(ax, curves)
    for text, px, py in _round_speeds(x, y, RPM * speed):
        if any(math.hypot(px - a, py - b) < apart * size for a, b in taken):
            continue
        taken.append((px, py))
        ax.plot(px, py, ".", color="k", markersize=3, zorder=4)
        away = np.array([px - middle[0], py - middle[1]])
        written.write(text, np.array([px, py]), away / (np.hypot(*away) or 1.0))


def _round_speeds(x: Floats, y: Floats, rpm: Floats) -> Iterator[tuple[str, float, float]]:
    """Speeds and where a curve has them first: its ends, and round numbers between, the roundest first."""
    finite = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    for i in finite[[0, -1]] if finite.size else ():
        yield f"{rpm[i]:.0f}", float(x[i]), float(y[i])
    low, high = np.nanmin(rpm), np.nanmax(rpm)
    finest = 10.0 ** math.floor(math.log10(max(high - low, 1e-9)) - 1.0)
    for step in finest * np.array([10.0, 5.0, 2.0, 1.0]):
        for value in step * np.arange(math.ceil(low / step), math.floor(high / step) + 1):
            passed = np.flatnonzero((rpm[:-1] - value) * (rpm[1:] - value) <= 0.0)
            for i in passed[:1]:
                share = (value - rpm[i]) / ((rpm[i + 1] - rpm[i]) or 1.0)
                at = (1.0 - share) * x[i] + share * x[i + 1], (1.0 - share) * y[i] + share * y[i + 1]
                if np.isfinite(at).all():
                    yield f"{value:.10g}", float(at[0]), float(at[1])


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
