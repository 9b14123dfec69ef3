"""The Campbell diagram: natural frequencies over spin speed, with the lines 1X and 2X."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.figures.label_places import Labels

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

# Colour and dashes of each motion, distinct without colour as well.
STYLES: dict[str, dict[str, Any]] = {
    "forward": {"color": "C1", "linestyle": "-"},
    "backward": {"color": "C0", "linestyle": (0, (4, 4)), "zorder": 2.5},  # a forward mode shows between
    "mixed": {"color": "C4", "linestyle": (0, (6, 1.5))},
    "planar": {"color": "0.3", "linestyle": "-"},
    "torsional": {"color": "C2", "linestyle": (0, (4, 1.2, 1, 1.2))},
    "axial": {"color": "C3", "linestyle": (0, (1, 1.2))},
}
ORDERS = (1, 2)
_DIGIT, _LINE, _GAP = 3.8, 8.0, 3.0  # pt: width of a digit, height of a line, gap
_CRITICAL: dict[str, Any] = {
    "linestyle": "", "marker": "o", "markersize": 3, "color": "k", "markerfacecolor": "white", "zorder": 3,
}  # fmt: skip


def campbell_diagram(
    curves: xr.Dataset, ax: Axes, critical: Sequence[tuple[int, float]] = (), limit: float | None = None
) -> Axes:
    """Draw the Campbell diagram: lateral modes by their whirl, torsional and axial ones, 1X and 2X.

    Parameters
    ----------
    curves : xarray.Dataset
        `frequency` (Hz), `damping_ratio` and `whirl` over (mode, speed), with the coordinates `kind` and
        `speed` (rad/s).
    critical : sequence of (mode, speed)
        Critical speeds, rad/s, to be marked on the 1X line.
    limit : float, optional
        End of the ordinate, Hz; by default just above the highest curve.
    """
    rpm = 30 / math.pi * curves["speed"].values
    # an overdamped mode and a rigid body's do not oscillate: their curves are broken
    oscillates = (abs(curves["damping_ratio"]) < 1.0) & (curves["frequency"] > 0.0)
    frequency = curves["frequency"].where(oscillates).values
    top = limit or 1.05 * float(np.nanmax(frequency))
    drawn = set()
    for i_mode, kind in enumerate(curves["kind"].values):
        words = [whirl if kind == "lateral" else kind for whirl in curves["whirl"].values[i_mode]]
        if np.isnan(frequency[i_mode]).all():
            continue
        for word, part in _stretches(words):
            ax.plot(rpm[part], frequency[i_mode, part], **STYLES[word])
            at = frequency[i_mode, part]
            if np.any(np.minimum(at[:-1], at[1:]) < top):  # NaN, where it is overdamped, draws nothing
                drawn.add(word)
    ax.set(xlim=(rpm.min(), rpm.max()), ylim=(0, top))
    for order in ORDERS:
        _draw_order(ax, order)
    if critical:
        speeds = np.array([speed for _, speed in critical])
        ax.plot(30 / math.pi * speeds, speeds / (2 * math.pi), **_CRITICAL)
        _number(ax, speeds)
    ax.set(xlabel="Spin speed (rpm)", ylabel="Natural frequency (Hz)")
    ax.ticklabel_format(style="plain")
    ax.locator_params(axis="x", nbins=6)  # six digits of rpm take their room
    _legend(ax, [word for word in STYLES if word in drawn], bool(critical))
    return ax


def _stretches(words: list[str]) -> Iterator[tuple[str, slice]]:
    """Yield the parts of a curve that share a motion, each with the first point of the next.

    A lone planar point, such as that of equal modes at standstill, joins its right neighbour.
    """
    padded = ["", *words, "planar"]
    words = [
        right if word == "planar" and "planar" not in (left, right) else word
        for left, word, right in zip(padded, words, padded[2:], strict=False)
    ]
    starts = [0, *(i for i in range(1, len(words)) if words[i] != words[i - 1]), len(words)]
    for start, end in pairwise(starts):
        yield words[start], slice(start, end + 1)


def _number(ax: Axes, speeds: NDArray[np.float64]) -> None:
    """Write each critical speed, rpm, by its marker; those whose numbers would meet share a line."""
    left, right = ax.get_xlim()
    box = ax.get_window_extent()
    per_rpm, per_hertz = (  # points
        72.0 / ax.figure.dpi * size / span
        for size, span in ((box.width, right - left), (box.height, np.ptp(ax.get_ylim())))
    )
    lines: list[list[float]] = []
    for rpm in sorted(30 / math.pi * speeds):
        if not left <= rpm <= right:
            continue
        last = lines[-1] if lines else [-math.inf]
        is_beside = (rpm - last[-1]) * per_rpm < _DIGIT * len(_line(last)) + _GAP
        is_level = (rpm - last[-1]) / 60 * per_hertz < _LINE
        if is_beside and is_level:
            last.append(rpm)
        else:
            lines.append([rpm])
    curves = (np.asarray(curve.get_xydata(), dtype=float).T for curve in ax.lines)
    labels = Labels(ax, [(x, y) for x, y in curves if np.isfinite(x + y).any()])
    for line in lines:
        labels.write(_line(line), np.array([line[-1], line[-1] / 60]), np.array([1.0, -1.0]))


def _line(speeds: list[float]) -> str:
    return ", ".join(dict.fromkeys(f"{rpm:.0f}" for rpm in speeds))


def _draw_order(ax: Axes, order: int) -> None:
    """Add the line of `order` times the spin frequency, named where it leaves the axes."""
    right, top = ax.get_xlim()[1], ax.get_ylim()[1]
    end = min(right, 60 * top / order)
    height = order * end / 60
    ax.plot([0.0, end], [0.0, height], color="0.5", linewidth=0.5, zorder=1, scalex=False, scaley=False)
    side: dict[str, Any] = {"xytext": (2, 0), "ha": "left", "va": "center"}
    if end < right:
        side = {"xytext": (0, 2), "ha": "center", "va": "bottom"}
    ax.annotate(f"{order}X", (end, height), textcoords="offset points", color="0.35", **side)


def _legend(ax: Axes, words: list[str], has_critical: bool) -> None:
    from matplotlib.lines import Line2D

    styles = {word.capitalize(): STYLES[word] for word in words}
    if has_critical:
        styles["Critical (1X)"] = _CRITICAL
    handles = [Line2D([], [], label=label, **style) for label, style in styles.items()]
    # below the abscissa's label: no place among the curves is sure to be free
    ax.legend(
        handles=handles,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.14),
        ncols=4 if len(handles) <= 4 else 3,
        columnspacing=1.2,
        frameon=False,
    )
