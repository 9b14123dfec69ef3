"""Where cases lie: a product of axes, and of columns that move together."""

from __future__ import annotations

import itertools
from typing import NamedTuple

from rubhpc.study.points import Points


class Column(NamedTuple):
    dimension: str
    values: tuple[float, ...]


def test_axes_of_their_own_dimensions_make_a_product():
    axes = [Column("a", (1.0, 2.0)), Column("b", (5.0,)), Column("c", (7.0, 8.0, 9.0))]
    points = Points(axes)
    assert (points.dims, points.shape, points.n_case) == (("a", "b", "c"), (2, 1, 3), 6)
    every = list(itertools.product(*(axis.values for axis in axes)))
    assert [points.at_flat(i) for i in range(6)] == every
    assert list(points.within((0, 0, 0), points.shape)) == every
    assert list(points.within((1, 0, 1), (1, 1, 2))) == [(2.0, 5.0, 8.0), (2.0, 5.0, 9.0)]
    assert points.along("c") == [(7.0,), (8.0,), (9.0,)]


def test_axes_of_one_dimension_move_together():
    """Columns of a table, with an axis of its own between them."""
    points = Points([Column("row", (1.0, 2.0)), Column("b", (5.0, 6.0)), Column("row", (8.0, 9.0))])
    assert (points.dims, points.shape, points.place) == (("row", "b"), (2, 2), (0, 1, 0))
    assert [points.at_flat(i) for i in range(4)] == [(1, 5, 8), (1, 6, 8), (2, 5, 9), (2, 6, 9)]
    assert points.at((1, 0)) == (2, 5, 9)
    assert points.along("row") == [(1.0, 8.0), (2.0, 9.0)]
