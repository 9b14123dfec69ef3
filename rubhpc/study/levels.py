"""Which cases of a grid a refined map computes, level by level, and what it infers between them.

Every `coarse`-th value of each refined axis, and its last one, are computed first. Then one axis after
another is halved until it has all its values: the case in the middle of two neighbours is computed where
these differ, or where two neighbours before or after them on the same line do (an edge may lie between two
that agree), and so are the two themselves; elsewhere it is inferred from them. At last, every inferred case
next to one that differs is computed, until there is none.

Halving one axis at a time makes maps of rub cheap: their regions are bands along some of the axes, and a band
one case wide is followed along its length by as few cases as a wide one.

Decisions come from the results of the cases that were asked for, level by level, and from nothing else:
neither ranks nor kills nor what else a store holds change them. A case is decided as soon as the few on which
its decision rests are, so that no level waits for the whole of the one before.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rubhpc.study.edges import Edges, differ, span

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from rubhpc.study.edges import Results

# Share of the middles that are computed, as long as no result says it, fitted to two maps of 1620 and 20 000
# cases: along the first axis times the root of the distance between neighbours, as a share of the axis.
_FIRST, _LATER = 1.6, 0.22


class Asked(NamedTuple):
    """What is certain of the cases that a grid asks for.

    Attributes
    ----------
    cases : (*grid) bool
        Those that are asked for whatever the missing ones turn out to be.
    is_all : bool
        Whether these are all, and known.
    n_expected : int
        About how many there will be.
    edges : Edges or None
        Where the axes have all their values; None as long as a missing case may ask for others between them.
    """

    cases: NDArray[np.bool_]
    is_all: bool
    n_expected: int
    edges: Edges | None


class Levels:
    """The levels of a refined grid.

    Parameters
    ----------
    shape : tuple of int
        Cases along each dimension.
    refined : sequence of int
        Dimensions that are refined, in this order; those of one case are not.
    coarse : int
        Step of the first level, a power of two.
    """

    def __init__(self, shape: tuple[int, ...], refined: Sequence[int], coarse: int) -> None:
        self.shape = shape
        self.refined = tuple(axis for axis in refined if shape[axis] > 1)
        self.coarse = coarse

    def asked(self, results: Results) -> Asked:
        """Return the cases that are certain to be computed.

        A case is decided as soon as the four on which its decision rests are, wherever on the grid others
        are missing. What is certain stays so when more is known, and is the same in the end, whatever the
        order of results.
        """
        asked = np.zeros(self.shape, bool)
        known, tolerances = results.compared()
        nodes = self._first()
        here = self._at(nodes)
        asked[here] = True
        is_final = results.is_known[here]  # whether what is held will not change on this level
        held = [values[here] for values in known]
        is_unsure = np.zeros(is_final.shape, bool)  # whether it may still be asked for on this level
        n_expected = None if is_final.all() else self._expected(asked, 0)
        for number, (axis, fine) in enumerate(self._halvings(), 1):
            before, after = is_final[span(axis, None, -1)], is_final[span(axis, 1, None)]
            is_open = differ(held, tolerances, axis) & before & after
            touched = _touched(_with_neighbours(is_open, axis), axis, nodes[axis], fine)
            is_unsure = _touched(_with_neighbours(~(before & after), axis), axis, nodes[axis], fine)
            held = [_between(values, axis, nodes[axis], fine) for values in held]
            nodes = {**nodes, axis: fine}
            here = self._at(nodes)
            asked[here] |= touched
            asked_here = asked[here]
            is_unsure &= ~asked_here
            is_final = np.where(asked_here, results.is_known[here], ~is_unsure)
            if n_expected is None and not is_final.all():
                n_expected = self._expected(asked, number)
            held = [np.where(asked_here, v[here], h) for v, h in zip(known, held, strict=True)]
        edges = Edges(self.refined, results, asked, is_final, held)
        edges.follow(results, np.flatnonzero(edges.asked & results.is_known))
        is_all = bool(is_final.all() and results.is_known[edges.asked].all())
        if n_expected is None:
            n_expected = int(edges.asked.sum())
        return Asked(edges.asked, is_all, n_expected, None if is_unsure.any() else edges)

    def filled(self, values: NDArray[Any], is_computed: NDArray[np.bool_]) -> NDArray[Any]:
        """Return values, (*grid, ...), with those that are not computed inferred from their neighbours.

        Floats are interpolated linearly over the numbers of an axis; where one side is NaN the other counts.
        Integers are those of the nearer side.
        """
        nodes = self._first()
        held = values[self._at(nodes)]
        for axis, fine in self._halvings():
            held = _between(held, axis, nodes[axis], fine)
            nodes = {**nodes, axis: fine}
            here = self._at(nodes)
            known = is_computed[here]
            held = np.where(known.reshape(*known.shape, *[1] * (held.ndim - known.ndim)), values[here], held)
        return held

    def _expected(self, asked: NDArray[np.bool_], n_done: int) -> int:
        """About how many cases there will be: an edge takes as many more on each level of its axis."""
        counts, most, axes, nodes = [int(asked[self._at(self._first())].sum())], [], [-1], self._first()
        before, shares = self._size(nodes), []
        for axis, fine in self._halvings():
            is_first = axis == self.refined[0]
            shares.append(min(1.0, _FIRST * (len(nodes[axis]) - 1) ** -0.5) if is_first else _LATER)
            nodes = {**nodes, axis: fine}
            counts.append(int(asked[self._at(nodes)].sum()))
            most.append(self._size(nodes) - before)
            axes.append(axis)
            before = self._size(nodes)
        total, added = float(counts[n_done]), 0.0
        if n_done:
            added = float(counts[n_done] - counts[n_done - 1])
        for i in range(n_done + 1, len(counts)):
            if n_done == 0 or axes[i] != axes[n_done]:
                added = shares[i - 1] * most[i - 1]
            added = min(added, most[i - 1])
            total += added
        return round(total)

    def _first(self) -> dict[int, NDArray[np.int64]]:
        """Indices of the first level along each refined axis."""
        return {axis: _every(self.shape[axis], self.coarse) for axis in self.refined}

    def _halvings(self) -> Iterator[tuple[int, NDArray[np.int64]]]:
        """The axis of each further level, and the indices along it from then on."""
        for axis in self.refined:
            step, n_before = self.coarse, len(_every(self.shape[axis], self.coarse))
            while step > 1:
                step //= 2
                places = _every(self.shape[axis], step)
                if len(places) > n_before:
                    yield axis, places
                n_before = len(places)

    def _size(self, nodes: dict[int, NDArray[np.int64]]) -> int:
        lengths = [len(nodes[axis]) if axis in nodes else n for axis, n in enumerate(self.shape)]
        return int(np.prod(lengths))

    def _at(self, nodes: dict[int, NDArray[np.int64]]) -> tuple[NDArray[np.int64], ...]:
        """The cases of a level as an index of arrays over the grid."""
        return np.ix_(*(nodes.get(axis, np.arange(n)) for axis, n in enumerate(self.shape)))


def _every(n: int, step: int) -> NDArray[np.int64]:
    return np.unique(np.append(np.arange(0, n, step), n - 1))


def _with_neighbours(marked: NDArray[np.bool_], axis: int) -> NDArray[np.bool_]:
    """What is marked, and what comes before or after it along an axis."""
    wide = marked.copy()
    wide[span(axis, 1, None)] |= marked[span(axis, None, -1)]
    wide[span(axis, None, -1)] |= marked[span(axis, 1, None)]
    return wide


def _touched(
    is_open: NDArray[np.bool_], axis: int, coarse: NDArray[np.int64], fine: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Whether each place of a level lies in a marked interval of the level before, ends included."""
    above = np.searchsorted(coarse, fine, side="right") - 1  # the interval that begins at or before it
    below = np.where(coarse[above] == fine, above - 1, above)
    last = is_open.shape[axis] - 1
    touched: NDArray[np.bool_] = is_open.take(below.clip(0, last), axis) | is_open.take(
        above.clip(0, last), axis
    )
    return touched


def _between(
    values: NDArray[Any], axis: int, coarse: NDArray[np.int64], fine: NDArray[np.int64]
) -> NDArray[Any]:
    """Values on the places of a level from those on the places of the level before."""
    low = (np.searchsorted(coarse, fine, side="right") - 1).clip(0, len(coarse) - 2)
    share = (fine - coarse[low]) / (coarse[low + 1] - coarse[low])
    if values.dtype.kind != "f":
        return values.take(np.where(share > 0.5, low + 1, low), axis)
    share = share.reshape([-1 if i == axis else 1 for i in range(values.ndim)])
    first, second = values.take(low, axis), values.take(low + 1, axis)
    between = np.where(share == 1.0, second, first + share * (second - first))
    between = np.where(share == 0.0, first, between)
    return np.where(np.isnan(between), np.where(np.isnan(first), second, first), between)
