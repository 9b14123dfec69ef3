"""Who a case is, and from which other it goes on: ids, and the chains of a sweep along one axis.

A case of a chain depends on all that come before it, so its id tells of them too: a value put in between
makes new cases of those behind it and leaves those before it as they are.
"""

from __future__ import annotations

import hashlib
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from rubhpc.study.axes import BOTH, DIRECTION, DOWN, FROM_REST

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


class Named(Protocol):
    """What a chain knows of an axis."""

    @property
    def name(self) -> str:
        """Key in the study."""
        ...

    @property
    def sweep(self) -> str:
        """One of `axes.SWEEPS`."""
        ...


@dataclass(frozen=True, kw_only=True)
class Chain:
    """How the motion is carried through a grid.

    Attributes
    ----------
    axis : int
        Position of the swept axis, whose values rise.
    direction : int or None
        Position of the axis that tells up (0) from down (1); None where there is but one of them.
    is_down : bool
        Which, where there is but one.
    """

    axis: int
    direction: int | None = None
    is_down: bool = False

    def goes_down(self, index: Sequence[int]) -> bool:
        """Whether the chain of this case runs from high to low values."""
        return self.is_down if self.direction is None else index[self.direction] == 1

    def turn(self, index: Sequence[int]) -> int:
        """What orders the cases of a chain: the lowest comes first."""
        return -index[self.axis] if self.goes_down(index) else index[self.axis]

    def before(self, index: Sequence[int], n: int) -> tuple[int, ...] | None:
        """Index of the case that this one goes on from, with `n` values on the axis; None for the first."""
        place = index[self.axis] + (1 if self.goes_down(index) else -1)
        return (*index[: self.axis], place, *index[self.axis + 1 :]) if 0 <= place < n else None

    def highest(self, values: NDArray[Any]) -> NDArray[Any]:
        """The highest of the values of each case of the grid and of those before it in its chain."""
        up = np.maximum.accumulate(values, self.axis)
        down = np.flip(np.maximum.accumulate(np.flip(values, self.axis), self.axis), self.axis)
        if self.direction is None:
            return down if self.is_down else up
        ways = [np.take(way, [i], self.direction) for i, way in enumerate((up, down))]
        return np.concatenate(ways, self.direction)

    def kept(self, before: Sequence[float], after: Sequence[float]) -> NDArray[np.bool_]:
        """Which values `after` have the same ones before them as in `before`: (n, 2), up and down; or (n, 1).

        Both rise.
        """
        ways = [_same_before(before, after), _same_before(before[::-1], after[::-1])[::-1]]
        return np.stack(ways if self.direction is not None else [ways[self.is_down]], axis=1)


def chain_of(axes: Sequence[Named]) -> Chain | None:
    """The chain of a grid; None where every case starts at rest."""
    swept = next((i for i, axis in enumerate(axes) if axis.sweep != FROM_REST), None)
    if swept is None:
        return None
    direction = next((i for i, axis in enumerate(axes) if axis.name == DIRECTION), None)
    assert (direction is not None) == (axes[swept].sweep == BOTH)
    return Chain(axis=swept, direction=direction, is_down=axes[swept].sweep == DOWN)


class CaseIds:
    """Ids of the cases of a grid: hashes of the study's identity, the values on the axes and the chain.

    They outlive the growth of any axis, and the order of the values on it.
    """

    def __init__(self, identity: str, values: Sequence[Sequence[float]], chain: Chain | None) -> None:
        self._begun = hashlib.sha256(identity.encode())
        self._chain = chain
        self._lineage: dict[tuple[float, bool], bytes] = {}
        if chain is not None:
            for is_down in (False, True):
                lineage = hashlib.sha256()
                for value in values[chain.axis][:: -1 if is_down else 1]:
                    self._lineage[value, is_down] = lineage.digest()
                    lineage.update(struct.pack("<d", value))

    def __call__(self, point: Sequence[float]) -> str:
        """Id of the case with these values on the axes."""
        digest = self._begun.copy()
        digest.update(struct.pack(f"<{len(point)}d", *point))
        if (chain := self._chain) is not None:
            is_down = chain.is_down if chain.direction is None else point[chain.direction] == 1.0
            digest.update(self._lineage[point[chain.axis], is_down])
        return digest.hexdigest()[:32]


def _same_before(before: Sequence[float], after: Sequence[float]) -> NDArray[np.bool_]:
    """Which values `after` stand at their place in `before`, as do all that come before them."""
    n = min(len(before), len(after))
    same = np.zeros(len(after), bool)
    same[:n] = np.logical_and.accumulate(np.array(after[:n]) == np.array(before[:n]))
    return same
