"""Draws the cases of a sampled study: one column of values for each range of its grid.

Saltelli's points are a and b from one point of a scrambled Sobol' sequence, and between them a with one value
after the other taken from b (A. Saltelli et al., Comput. Phys. Commun. 181, 2010). The cases of a point are
consecutive. A longer sequence continues a shorter one, and so do random points. A Latin hypercube is drawn as
a whole.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError
from rubhpc.study.rub_share import balanced

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.rig.rig import Rig
    from rubhpc.study.axes import Axis
    from rubhpc.study.tables import Sample

    Points = np.ndarray[tuple[int, int], np.dtype[np.float64]]

CASE = "case"  # the dimension of all that is drawn
MOST_DRAWN = 2_000_000  # cases; a larger number is refused as a mistake: it would fill the memory


def cases_per_point(n_range: int) -> int:
    """Return how many cases a base point of Saltelli's design makes."""
    return n_range + 2


def draw(axes: Sequence[Axis], sample: Sample, rig: Rig) -> tuple[Axis, ...]:
    """Return the axes with values drawn where they have a range; these then share the dimension `case`.

    Parameters
    ----------
    axes : sequence of Axis
        One at least from `make_range`, two for Saltelli's design.
    rig : Rig
        Of which `sample.rub_share` decides whether a case rubs.
    """
    ranges = [axis for axis in axes if axis.drawn_from is not None]
    if not ranges or (sample.is_saltelli and len(ranges) < 2):
        what = f"{ranges[0].name} is the only range" if ranges else "no axis of [grid] is a range"
        fix = "at least two { start, stop }" if sample.is_saltelli else "a { start, stop }"
        raise InputError(f"[sample]: {what}; write {fix}, or leave [sample] out")
    n_case = sample.n * (cases_per_point(len(ranges)) if sample.is_saltelli else 1)
    if n_case > MOST_DRAWN:
        size = f"{sample.n} points of {len(ranges)} ranges make {n_case} cases"
        raise InputError(f"[sample] n: {size}, too many; the limit is {MOST_DRAWN}, use a smaller n")

    def drawn(n: int) -> list[tuple[float, ...]]:
        # Of the unit cube: what SALib would make of ranges may change with its version.
        spans = [axis.drawn_from for axis in ranges if axis.drawn_from is not None]
        shares = _points(len(ranges), sample, n).T.tolist()
        columns = [map(span.at, column) for span, column in zip(spans, shares, strict=True)]
        return list(zip(*columns, strict=True))

    share = sample.rub_share
    points = drawn(sample.n) if share is None else balanced(axes, rig, sample.n, share, drawn)
    columns = iter(zip(*points, strict=True))
    return tuple(
        replace(axis, dimension=CASE, values=next(columns)) if axis.drawn_from is not None else axis
        for axis in axes
    )


def _points(n_range: int, sample: Sample, n: int) -> Points:
    """Points in the unit cube, (n_case, n_range); of Saltelli's design n base points."""
    if sample.is_saltelli:
        from SALib.sample import sobol

        cube = {"num_vars": n_range, "names": list(range(n_range)), "bounds": [[0.0, 1.0]] * n_range}
        design = sobol.sample(cube, n, calc_second_order=False, seed=sample.seed)
        return np.asarray(design, dtype=np.float64)
    random = np.random.default_rng(sample.seed)
    if sample.method == "random":
        return random.random((n, n_range))
    from scipy.stats import qmc

    if sample.method == "lhs":
        return np.asarray(qmc.LatinHypercube(n_range, seed=random).random(n), dtype=np.float64)
    # The sequence is drawn up to a power of two, as it is meant to be; what n leaves of it is its beginning.
    whole = qmc.Sobol(n_range, seed=random).random_base2((n - 1).bit_length())
    return np.asarray(whole[:n], dtype=np.float64)
