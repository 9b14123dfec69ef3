"""How many cases a refined map will compute: some lines across it are refined as the run will refine them."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.integrate.compilation import seconds_compiling
from rubhpc.running.case_rows import packed_measures
from rubhpc.running.kept_setups import KeptSetups, touched
from rubhpc.running.memory import memory
from rubhpc.running.sampled_cases import MOST_BYTES, roberts_pace
from rubhpc.running.worker import integrate
from rubhpc.schema import FAILED
from rubhpc.storage.journal import Entry

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.storage.refined import Refinement
    from rubhpc.study.cases import CaseGrid
    from rubhpc.study.levels import Levels

    Ints = NDArray[np.int64]
    Box = tuple[slice, ...]

_FEWEST, _MOST = 3, 64  # lines along an axis
_ALIKE = 16  # as long as all add the same, of which the spread of others is not known
_PATIENCE = 1.5  # times as long as lines are begun, for the last of them
_AGREED = 0.08  # standard error of the number of cases, as a share of it, up to which no more are refined
_OFF = 0.5  # standard error of the usual number of cases, as a share of it (0.5 to 1.9 of them)


class Expected(NamedTuple):
    """About how many cases a refined map will compute, and the standard error of that."""

    n_case: float
    error: float


class Added(NamedTuple):
    """What a line adds to the cases of its first level."""

    inside: float  # cases
    ends: float  # cases of its first level that it asks for as well; they may be inferred until then


class OutOfTime(Exception):  # noqa: N818 - ends a line, never seen by users
    """The time for lines is up."""


def expected_cases(
    refinement: Refinement, grid: CaseGrid, kind: np.dtype[np.void], seconds: float
) -> Expected:
    """Return how many cases a refined map computes, about: from lines across it.

    Where there is no time for them, as many as maps usually do.

    Parameters
    ----------
    kind : dtype
        Of a record of measures.
    seconds : float
        For lines.
    """
    asked = refinement.asked()
    found = None
    if asked.edges is None and seconds > 0.0:
        found = _count_by_lines(grid, refinement, kind, seconds)
    if found is None:
        return Expected(asked.n_expected, 0.0 if asked.edges is not None else _OFF * asked.n_expected)
    return found._replace(n_case=max(found.n_case, float(asked.cases.sum())))


def _count_by_lines(
    grid: CaseGrid, refinement: Refinement, kind: np.dtype[np.void], seconds: float
) -> Expected | None:
    """The same by lines alone, in so many seconds; None where they do not suffice."""
    study, end = grid.study, time.monotonic() + seconds - seconds_compiling()
    setups = KeptSetups(study)

    def check() -> None:
        if time.monotonic() > end + seconds_compiling() or memory() > MOST_BYTES:
            raise OutOfTime

    def compute(flat: int) -> Entry:
        check()
        try:
            case = grid.case([int(i) for i in np.unravel_index(flat, grid.shape)])
            record = integrate(study, case, setups.of(case), case.initial, check)
            return Entry(flat, case.id, record.status, measures=packed_measures(record, kind).tobytes())
        except OutOfTime:
            raise
        except Exception:  # as in a run, where the reason is kept
            return Entry(flat, "", FAILED)

    return count_on_lines(refinement, compute, seconds / _PATIENCE, time.monotonic)


def count_on_lines(
    refinement: Refinement,
    compute: Callable[[int], Entry],
    seconds: float,
    now: Callable[[], float] = time.process_time,
) -> Expected | None:
    """Return about how many cases a refined map will compute; None where there is no time to know.

    An axis is halved line by line. Those of the first refined axis lie at the first values of all the others;
    when it has all its values, so many more lines are halved along the next one. The sum is that of the first
    level and of the mean of what some lines of each axis add, times their number; those of the last axis with
    what lies between two of them and is computed because of its neighbours.

    Parameters
    ----------
    compute : callable
        From the number of a case to its entry; may raise `OutOfTime`.
    seconds : float
        Begun no line after so many seconds `now`.
    """
    levels, began = refinement.levels, now()
    lines = {axis: Lines(levels.places_of_lines(axis), axis) for axis in levels.refined}
    added: dict[int, list[Added]] = {axis: [] for axis in lines}
    while True:
        axis = _next_axis(levels, lines, added)
        if axis is None or now() - began > seconds:
            break
        try:
            added[axis].append(
                _added_by(refinement, lines[axis].line(k := len(added[axis])), axis, k, compute)
            )
        except OutOfTime:
            break
    if any(len(counts) < min(_FEWEST, lines[axis].number) for axis, counts in added.items()):
        return None
    return _sum(levels, lines, added)


class Lines:
    """The lines of a grid that are halved along an axis, of which the first few lie evenly among all.

    Parameters
    ----------
    places : list of (n,) int
        Indices of the lines along each dimension.
    axis : int
        Along which they lie.
    """

    def __init__(self, places: list[Ints], axis: int) -> None:
        self._places, self._axis = places, axis
        self.number = math.prod(len(p) for d, p in enumerate(places) if d != axis)

    def line(self, k: int) -> Box:
        """The k-th line as a box of the grid.

        Positions are those of R. Kronecker, with the steps of M. Roberts; of few lines all are taken.
        """
        across = [d for d in range(len(self._places)) if d != self._axis]
        sizes = [len(self._places[d]) for d in across]
        at: tuple[int, ...]
        if self.number <= _MOST:
            order = np.argsort(
                [(0.5 + i * 0.6180339887498949) % 1.0 for i in range(self.number)], kind="stable"
            )
            at = tuple(int(i) for i in np.unravel_index(int(np.argsort(order)[k]), sizes or (1,)))
        else:
            at = tuple(((0.5 + k * roberts_pace(len(sizes))) % 1.0 * sizes).astype(int).tolist())
        window = [slice(None)] * len(self._places)
        for d, i in zip(across, at, strict=False):
            place = int(self._places[d][i])
            window[d] = slice(place, place + 1)
        return tuple(window)


def _next_axis(levels: Levels, lines: dict[int, Lines], added: dict[int, list[Added]]) -> int | None:
    """The axis whose sum is known worst, or of which too few lines are known; None where that is enough."""
    left = [axis for axis, of in lines.items() if len(added[axis]) < min(of.number, _MOST)]
    few = [axis for axis in left if len(added[axis]) < (_FEWEST if len(set(added[axis])) > 1 else _ALIKE)]
    if few or not left:
        return min(few, key=lambda axis: len(added[axis]), default=None)
    found = _sum(levels, lines, added)
    if found.error <= _AGREED * found.n_case:
        return None
    return max(left, key=lambda axis: lines[axis].number * np.std([sum(a) for a in added[axis]]))


def _sum(levels: Levels, lines: dict[int, Lines], added: dict[int, list[Added]]) -> Expected:
    """All cases. The ends of lines count as far as those before have not asked for them."""
    n_case, square = float(levels.n_first), 0.0
    for axis, of in lines.items():
        n = len(added[axis])
        is_new = 1.0 - n_case / levels.count_places(axis)
        counts = [line.inside + is_new * line.ends for line in added[axis]]
        spread = float(np.std(counts, ddof=1)) if n > 1 else 0.0
        square += (1.0 - n / of.number) / n * (of.number * spread) ** 2
        n_case += of.number * float(np.mean(counts))
    return Expected(n_case, math.sqrt(square))


def _added_by(refinement: Refinement, line: Box, axis: int, k: int, compute: Callable[[int], Entry]) -> Added:
    """What the k-th line of an axis adds to those of its first level.

    Of the last axis with what lies between it and its neighbour along an axis that was refined before: each
    of these axes is looked along in turn, and stands for all.
    """
    refined = refinement.levels.refined
    earlier = refined[: refined.index(axis)]
    if axis != refined[-1] or not earlier:
        part = _refine(refinement.within(line), compute)
        inside = float(part.asked().cases.sum() - part.levels.n_first)
        return Added(inside, float(part.count_ends()) if earlier else 0.0)
    beside = earlier[k % len(earlier)]
    first = min(line[beside].start, refinement.levels.shape[beside] - 2)
    entries: dict[int, Entry] = {}

    def keep(flat: int) -> Entry:
        entries[flat] = compute(flat)
        return entries[flat]

    both = _refine(refinement.within(_moved(line, beside, first, 2)), keep)
    alone = [
        _refine(refinement.within(_moved(line, beside, place, 1)), entries.__getitem__)
        for place in (first, first + 1)
    ]
    counts = [float(part.asked().cases.sum()) for part in alone]
    between = float(both.asked().cases.sum()) - sum(counts)
    n_left = math.prod(both.levels.shape) - sum(counts)  # of both lines, which either neighbour may ask for
    between = touched(n_left, between / n_left, 2 * len(earlier) * n_left) if n_left else 0.0
    ends = 0.5 * sum(part.count_ends() for part in alone)
    return Added(0.5 * (sum(counts) + between) - alone[0].levels.n_first, ends)


def _refine(part: Refinement, compute: Callable[[int], Entry]) -> Refinement:
    """Compute all that a box asks for."""
    while len(missing := part.missing_cases()):
        part.enter([compute(flat) for flat in missing.tolist()])
    return part


def _moved(line: Box, dim: int, first: int, n: int) -> Box:
    """A line as far as `n` places from the `first` along another dimension."""
    return (*line[:dim], slice(first, first + n), *line[dim + 1 :])
