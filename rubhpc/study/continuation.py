"""Sequential continuation along a swept axis, and the ids of cases.

In a continuation a case starts from the final state of its predecessor on the swept axis. It depends on all
predecessors, and its id covers them: a value inserted on the axis makes new cases of all that follow it and
leaves those before it unchanged.
"""

from __future__ import annotations

import hashlib
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.study.axes import BOTH, DIRECTION, DOWN, FROM_REST

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.study.points import AnyAxis


@dataclass(frozen=True, kw_only=True)
class Continuation:
    """Which axis of a grid is swept, and in which direction.

    Attributes
    ----------
    axis : int
        Position of the swept axis, whose values ascend.
    direction : int or None
        Position of the axis `direction`, up (0) or down (1); None where the sweep has one direction.
    is_down : bool
        Whether a sweep in one direction goes down.
    """

    axis: int
    direction: int | None = None
    is_down: bool = False

    def is_downward(self, at: Sequence[float]) -> bool:
        """Whether the sweep of a case, by its index or its values, runs from high to low values."""
        return self.is_down if self.direction is None else at[self.direction] == 1

    def position(self, index: Sequence[int]) -> int:
        """Sort key of a case in its sweep: the lowest is computed first."""
        return -index[self.axis] if self.is_downward(index) else index[self.axis]

    def predecessor(self, index: Sequence[int], n: int) -> tuple[int, ...] | None:
        """Index of the case this one starts from, with `n` values on the axis; None for the first."""
        neighbour = index[self.axis] + (1 if self.is_downward(index) else -1)
        return (*index[: self.axis], neighbour, *index[self.axis + 1 :]) if 0 <= neighbour < n else None

    def running_maximum(self, values: NDArray[Any]) -> NDArray[Any]:
        """Largest value over each case of the grid and its predecessors."""
        up = np.maximum.accumulate(values, self.axis)
        down = np.flip(np.maximum.accumulate(np.flip(values, self.axis), self.axis), self.axis)
        if self.direction is None:
            return down if self.is_down else up
        both = [np.take(values, [i], self.direction) for i, values in enumerate((up, down))]
        return np.concatenate(both, self.direction)

    def unchanged(self, before: Sequence[float], after: Sequence[float]) -> NDArray[np.bool_]:
        """Which values of `after` have the predecessors they had in `before`: (n, 2), up and down; or (n, 1).

        Both are in ascending order.
        """
        both = [_same_before(before, after), _same_before(before[::-1], after[::-1])[::-1]]
        return np.stack(both if self.direction is not None else [both[self.is_down]], axis=1)


def continuation_of(axes: Sequence[AnyAxis]) -> Continuation | None:
    """The continuation of a grid; None where every case starts at rest."""
    swept = next((i for i, axis in enumerate(axes) if axis.sweep != FROM_REST), None)
    if swept is None:
        return None
    direction = next((i for i, axis in enumerate(axes) if axis.name == DIRECTION), None)
    assert (direction is not None) == (axes[swept].sweep == BOTH)
    return Continuation(axis=swept, direction=direction, is_down=axes[swept].sweep == DOWN)


class CaseIds:
    """Ids of the cases of a grid: hashes of the study's identity, the axis values and the predecessors.

    They do not change when an axis grows or its values are reordered.
    """

    def __init__(
        self, identity: str, values: Sequence[Sequence[float]], continuation: Continuation | None
    ) -> None:
        self._identity = hashlib.sha256(identity.encode())
        self._continuation = continuation
        self._lineage: dict[tuple[float, bool], bytes] = {}
        if continuation is not None:
            for is_down in (False, True):
                lineage = hashlib.sha256()
                for value in values[continuation.axis][:: -1 if is_down else 1]:
                    self._lineage[value, is_down] = lineage.digest()
                    lineage.update(struct.pack("<d", value))

    def __call__(self, point: Sequence[float]) -> str:
        """Id of the case with these values on the axes."""
        digest = self._identity.copy()
        digest.update(struct.pack(f"<{len(point)}d", *point))
        if (continuation := self._continuation) is not None:
            is_down = continuation.is_downward(point)
            digest.update(self._lineage[point[continuation.axis], is_down])
        return digest.hexdigest()[:32]


def _same_before(before: Sequence[float], after: Sequence[float]) -> NDArray[np.bool_]:
    """Which values of `after` equal `before` at the same position, as do all values ahead of them."""
    n = min(len(before), len(after))
    same = np.zeros(len(after), bool)
    same[:n] = np.logical_and.accumulate(np.array(after[:n]) == np.array(before[:n]))
    return same
