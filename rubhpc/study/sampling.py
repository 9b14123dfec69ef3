"""Draws the cases of a sampled study: one column of values for each range of its grid.

The points are Saltelli's: a and b from one point of a scrambled Sobol' sequence, and between them a with one
value after the other taken from b (A. Saltelli et al., Comput. Phys. Commun. 181, 2010). The cases of a point
follow one another, and a longer sequence continues a shorter one.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.study.axes import Axis
    from rubhpc.study.tables import Sample

CASE = "case"  # the dimension of all that is drawn
MOST_DRAWN = 2_000_000  # cases; a larger number is taken for a mistake: it would fill the memory


def cases_per_point(n_range: int) -> int:
    """Return how many cases a base point makes."""
    return n_range + 2


def draw(axes: Sequence[Axis], sample: Sample) -> tuple[Axis, ...]:
    """Return the axes with values drawn where they have a range; these then share the dimension `case`.

    Parameters
    ----------
    axes : sequence of Axis
        Two at least from `make_range`.

    Raises
    ------
    InputError
        When there are fewer ranges, or too many cases.
    """
    ranges = [axis for axis in axes if axis.drawn_from is not None]
    if len(ranges) < 2:
        what = f"{ranges[0].name} is the only range" if ranges else "no axis of [grid] is a range"
        raise InputError(f"[sample]: {what}; write two {{ start, stop }} at least, or leave [sample] out")
    n_case = sample.n * cases_per_point(len(ranges))
    if n_case > MOST_DRAWN:
        size = f"{sample.n} points of {len(ranges)} ranges make {n_case} cases"
        raise InputError(f"[sample] n: {size}, too many; the limit is {MOST_DRAWN}, use a smaller n")
    # Of the unit cube: what SALib would make of ranges may change with its version.
    shares = iter(_design(len(ranges), sample).T)
    return tuple(
        replace(axis, dimension=CASE, values=tuple(map(axis.drawn_from.at, next(shares).tolist())))
        if axis.drawn_from is not None
        else axis
        for axis in axes
    )


def _design(n_range: int, sample: Sample) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Points in the unit cube, (n_case, n_range)."""
    from SALib.sample import sobol

    cube = {"num_vars": n_range, "names": list(range(n_range)), "bounds": [[0.0, 1.0]] * n_range}
    design = sobol.sample(cube, sample.n, calc_second_order=False, seed=sample.seed)
    return np.asarray(design, dtype=np.float64)
