"""Where the cases of a study lie: on a product of dimensions, along each of which one axis or several run.

A grid has a dimension an axis. Axes that share one run along it together, as the columns of a table do: their
values at the same place belong to the same case.
"""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

MOST_CASES = 10_000_000  # a larger grid is refused as a mistake: it would fill the memory
Index = tuple[int, ...]
Values = tuple[float, ...]


class AnyAxis(Protocol):
    """An axis of a study, or as a store keeps it."""

    @property
    def name(self) -> str:
        """Key in the study."""

    @property
    def dimension(self) -> str:
        """Name of the dimension that it runs along."""

    @property
    def values(self) -> Values:
        """As many as the dimension is long."""

    @property
    def sweep(self) -> str:
        """One of `axes.SWEEPS`."""


class Points:
    """The values of every case on some axes.

    Parameters
    ----------
    axes : sequence of Axis

    Attributes
    ----------
    dims, shape : tuple
        Dimensions in the order in which the axes name them, and cases along each.
    n_case : int
        Number of cases; in a flat index the last dimension runs fastest.
    place : tuple of int
        For each axis, the number of its dimension.
    values : tuple of tuple of float
        Of each axis, along its dimension.
    """

    def __init__(self, axes: Sequence[AnyAxis]) -> None:
        self.dims = tuple(dict.fromkeys(axis.dimension for axis in axes))
        length = {axis.dimension: len(axis.values) for axis in axes}
        self.shape = tuple(length[dim] for dim in self.dims)
        self.n_case = math.prod(self.shape)
        self.place = tuple(self.dims.index(axis.dimension) for axis in axes)
        self.values = tuple(axis.values for axis in axes)
        self._columns = tuple(zip(self.values, self.place, strict=True))

    def at(self, index: Sequence[int]) -> Values:
        """Return the values of the case at an index, one an axis."""
        return tuple([values[index[place]] for values, place in self._columns])

    def index(self, flat: int) -> Index:
        """Return the index of the case at a flat index."""
        index = []
        for n in reversed(self.shape):
            flat, i = divmod(flat, n)
            index.append(i)
        return tuple(index[::-1])

    def at_flat(self, flat: int) -> Values:
        """Return the values of the case at a flat index, one an axis."""
        return self.at(self.index(flat))

    def within(self, start: Iterable[int], shape: Iterable[int]) -> Iterator[Values]:
        """Yield the values of the cases in a box of the grid, the last dimension running fastest."""
        return map(self.at, boxed(start, shape))

    def along(self, dim: str) -> list[Values]:
        """Return what lies along a dimension: the values of its axes at each place of it."""
        place = self.dims.index(dim)
        return list(zip(*(values for values, at in self._columns if at == place), strict=True))


def boxed(start: Iterable[int], shape: Iterable[int]) -> Iterator[Index]:
    """Yield every index in a box, the last dimension running fastest."""
    return itertools.product(*(range(s, s + n) for s, n in zip(start, shape, strict=True)))
