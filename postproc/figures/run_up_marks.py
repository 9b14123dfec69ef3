"""What figures over the speed share: critical speeds, speeds along a curve, clear labels, the rotation."""

from __future__ import annotations

import itertools
import json
import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.store.rig_of_case import rig_axes, rig_of
from rubhpc import units
from rubhpc.rig.reading import rig_from_dict

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

RPM = units.RPM.factor
APART = 0.085  # of the diagonal of a plot, between named speeds
_BACK = 0.1  # of the way of a speed, up to which it may go back and counts as going one way
_STEPS = 60  # of speed, on which modes are followed
_GAP = 2.5  # points, of a label from its mark in each direction
_LETTER, _HEIGHT = 3.9, 6.0  # points, of a letter and its margin at the size of labels
_MARK = 3.0  # points, half the size of a mark
_FARTHER = (0.0, 10.0, 22.0)  # points
_SIZE = 6.0  # points, of labels
_LEADER = {"arrowstyle": "-", "linewidth": 0.4, "color": "0.4", "shrinkA": 1.0, "shrinkB": 1.5}
_AROUND = [(across, up) for across in (-1, 0, 1) for up in (-1, 0, 1) if across or up]


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

    That is `apart` times the diagonal of the plot. Each is written where it covers least, with a leader if
    far.
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

    ends = (0.88, 0.975), (0.975, 0.88)
    style: dict[str, Any] = {"arrowstyle": "-|>", "mutation_scale": 8, "linewidth": 0.9, "color": "k"}
    arrow = FancyArrowPatch(*ends, connectionstyle="arc3,rad=-0.4", transform=ax.transAxes, **style)
    ax.add_patch(arrow)
    ax.text(0.86, 0.97, "rotation", transform=ax.transAxes, ha="right", va="center", fontsize=6)


class Labels:
    """Curves and labels of a plot, in points from its lower left corner; set its limits first."""

    def __init__(self, ax: Axes, curves: Sequence[tuple[Floats, Floats]]) -> None:
        self._ax = ax
        self._low = np.array([ax.get_xlim()[0], ax.get_ylim()[0]])
        spans = np.array([np.ptp(ax.get_xlim()), np.ptp(ax.get_ylim())])
        box = np.array(ax.bbox.size) * 72.0 / ax.figure.dpi
        scale = box / spans
        self._scale = scale if ax.get_aspect() == "auto" else np.full(2, scale.min())
        self._size = spans * self._scale
        self._points = np.concatenate([self._at(_filled(np.column_stack(curve))) for curve in curves])
        self._boxes: list[tuple[Floats, Floats]] = []  # middles, and halves of their sizes
        for text in ax.texts:
            if text.get_transform() == ax.transData:
                self._boxes.append((self._at(np.array(text.get_position())), _half(text.get_text())))
        for points in (np.asarray(line.get_xydata()) for line in ax.lines):
            if len(points) == 1:  # a mark
                self._boxes.append((self._at(points[0]), np.full(2, _MARK)))

    def write(self, text: str, at: Floats, away: Floats) -> None:
        """Write a label of a point where it covers least, with a leader where that is far from the point.

        If possible it is in the direction `away`.
        """
        offset, is_far = self._place(text, at, away)
        self._ax.annotate(
            text,
            (at[0], at[1]),
            xytext=(offset[0], offset[1]),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=_SIZE,
            arrowprops=_LEADER if is_far else None,
        )

    def _place(self, text: str, at: Floats, away: Floats) -> tuple[Floats, bool]:
        """Where the middle of a label goes from its point, points, and whether it needs a leader."""
        half = _half(text)
        found, least = half, math.inf
        for farther, direction in itertools.product(_FARTHER, _AROUND):
            offset = np.array(direction) * (_GAP + half + farther)
            middle = self._at(at) + offset
            covered = np.all(np.abs(self._points - middle) < half, axis=1).sum()
            covered += 200 * sum(
                bool(np.all(np.abs(at_box - middle) < size + half)) for at_box, size in self._boxes
            )
            covered += 1000 * bool(np.any(middle < half) or np.any(middle > self._size - half))
            cost = float(covered) + farther - float(away @ direction) / math.hypot(*direction)
            if cost < least:
                found, least, is_far, box = offset, cost, farther > 0.0, middle
        self._boxes.append((box, half))
        return found, is_far

    def _at(self, points: Floats) -> Floats:
        """Data, (..., 2), in points."""
        placed: Floats = (points - self._low) * self._scale
        return placed


def _half(text: str) -> Floats:
    """Half the size of a label, points."""
    return 0.5 * np.array([_LETTER * len(text), _HEIGHT])


def _filled(points: Floats) -> Floats:
    """A curve (n, 2) with points between its own, those left out that are not finite."""
    points = points[np.all(np.isfinite(points), axis=1)]
    at = np.linspace(0.0, len(points) - 1, 2000)
    return np.column_stack([np.interp(at, np.arange(len(points)), column) for column in points.T])
