"""Where labels of points go in a plot: clear of its curves, of its edges and of one another."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

_GAP = 2.5  # points, of a label from its mark in each direction
_LETTER, _HEIGHT = 3.9, 6.0  # points, of a letter and its margin at the size of labels
_MARK = 3.0  # points, half the size of a mark
_FARTHER = (0.0, 10.0, 22.0)  # points
_SIZE = 6.0  # points, of labels
_LEADER = {"arrowstyle": "-", "linewidth": 0.4, "color": "0.4", "shrinkA": 1.0, "shrinkB": 1.5}
_AROUND = [(across, up) for across in (-1, 0, 1) for up in (-1, 0, 1) if across or up]


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
