"""Estimate of the time of a run for `rubhpc plan`, from some of its cases, spread over all axes.

Times are those of the processor: other work on the machine does not count.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.running.block_time import time_block
from rubhpc.running.pilot_cases import Pace, Pilots
from rubhpc.running.pilot_estimate import Sample

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from rubhpc.running.preparations import Preparations
    from rubhpc.storage.manifest import Manifest
    from rubhpc.study.cases import Block, CaseGrid

_MOST_PILOTS, _FEW_PILOTS, _FEW_BRANCHED = 64, 6, 2  # cases; timed even if slow, and of a branch study
_ENOUGH, _MOST = 3.0, 15.0  # processor seconds after which no more are begun: if they agree, and always
_AGREED = 0.25  # standard error of the mean pace, as a share of it, where cases agree
_LONGEST = 75.0  # s, total for running shortened cases whole
_OF_A_BRANCH = 0.3  # standard error, as a share, of a time predicted from part of the first branch
_LEAST, _SHARE = 15.0, 0.4  # s for all cases, or this share of the predicted time where it is more
_HALF = 0.5  # of the time predicted, or `_LEAST`, for cases that go on, at least
_LEAST_EACH = 1.0  # s, for each case
_SMALL = 24  # cases: in studies of up to so many all are begun
_FEWEST = 3  # cases that are always timed
# Positions that spread evenly over a square, however many (R. Kronecker; steps of M. Roberts' R2 sequence).
_AMONG_BLOCKS, _WITHIN_BLOCK = 0.7548776662466927, 0.5698402909980532


@dataclass(frozen=True, kw_only=True)
class Timing:
    """Results of the pilot cases.

    Attributes
    ----------
    pace : Pace
        For all cases, from them; NaN where all failed.
    n_pilot : int
        Cases that were timed.
    spread : float
        Standard error of the time of all cases, as a share of it: 0 where all were timed, NaN where one of
        several was.
    known : float
        Seconds of cases, whole or in part.
    is_bound : bool
        Whether a case was stopped by the limit, so that the pace is a lower bound.
    seconds : float
        Processor time of the timing, including lines of a refined map, without loading kernels, which a run
        needs too.
    modes : tuple of float
        Bytes of contact modes that cases of one set-up and friction held in a ring, for each that was timed.
    memory : float
        Bytes that this process held before the first case.
    has_compiled : bool
        Whether kernels were compiled that no cache held, which takes memory.
    failures : tuple of str
        Coordinates of the cases that failed, and why.
    """

    pace: Pace
    n_pilot: int = 0
    spread: float = math.nan
    known: float = 0.0
    is_bound: bool = False
    seconds: float = 0.0
    modes: tuple[float, ...] = ()
    memory: float = 0.0
    has_compiled: bool = False
    failures: tuple[str, ...] = ()


def seconds_of(pace: Pace, steps: float, n_case: float, n: Preparations, n_block: float) -> float:
    """Time of a whole run on one core."""
    prepared = pace.rig * n.rig + pace.speed * n.speed + pace.friction * n.friction
    return pace.step * steps + pace.case * n_case + prepared + pace.block * n_block


def time_pilots(
    grid: CaseGrid,
    manifest: Manifest,
    blocks: list[Block],
    missing: NDArray[np.bool_],
    say: Callable[[str], None] = lambda _: None,
) -> Timing:
    """Time cases of the missing blocks until enough time has passed; `say` receives their number.

    A case is picked with a probability that is half proportional to its predicted steps and half the same
    for all; the cases spread evenly over the blocks and over the cases of a block.
    """
    paces: list[Pace] = []
    picked: list[tuple[int, ...]] = []
    failures: list[str] = []
    is_bound = False
    began = time.process_time()
    pilots = Pilots(grid)
    n_case = int(missing.sum())
    few = max(_FEW_PILOTS, n_case * (n_case <= _SMALL)) if grid.study.branch is None else _FEW_BRANCHED
    sample = Sample(n_case, sum(block.cost * float(share_of(block, missing).mean()) for block in blocks))

    def spent() -> float:
        return time.process_time() - began - pilots.loading - pilots.compiling

    def predicted() -> float:
        return n_case * float(np.mean(sample.seconds)) if paces else 0.0

    def allowed() -> float:
        """Seconds that are left."""
        return min(max(_LEAST, _SHARE * predicted()), _MOST + _LONGEST) - spent()

    for k, (index, steps, probability) in enumerate(_picked(blocks, missing)):
        if k >= few and spent() > (_ENOUGH if _spread(sample) <= _AGREED else _MOST):
            break  # in some studies a few rubs among many free motions take most of the time
        if k >= min(few, _FEWEST) and allowed() <= 0.0:
            break
        say(f"timing cases: {len(paces)} so far, {max(spent(), 0.0):.0f} s of processor time")
        if index in picked:
            continue
        try:
            limit = max(allowed() / max(few - k, _FEWEST), _LEAST_EACH)
            pace = pilots.pace(index, steps, limit)
            also = pilots.alike.get(index)
            for one in (index,) if also is None or not missing[also] else (index, also):
                if one != index:
                    pace = pilots.pace(one, steps, math.inf)
                paces.append(pace)
                picked.append(one)
                sample.add(
                    steps,
                    probability,
                    pace.step * steps,
                    is_whole=one not in pilots.shortened and not pilots.was_cut,
                    spent=pilots.spent(one) if one in pilots.shortened else 0.0,
                    is_irregular=one in pilots.irregular,
                )
        except Exception as error:  # the other cases are timed in spite of an error
            where = manifest.name_case(int(np.ravel_multi_index(index, grid.shape)))
            failures.append(f"{where}: {type(error).__name__}: {' '.join(str(error).split())}")
        if pilots.was_cut:  # another would take as long
            is_bound = pilots.covered == 0.0
            break
    if pilots.shortened:
        say(f"timing cases: {len(paces)} so far, now the longest to their end")
    # The beginnings alone may have taken all that is allowed.
    _finish(pilots, picked, sample, max(allowed(), min(_LEAST, _HALF * predicted())))
    block = time_block(manifest, pilots.arrays) if pilots.arrays else 0.0
    seconds = time.process_time() - began - pilots.loading
    if not paces:
        return Timing(pace=Pace(*[math.nan] * len(Pace._fields)), seconds=seconds, failures=tuple(failures))
    case, step, _ = sample.estimate()
    mean = Pace(*np.mean(paces, axis=0).tolist())
    return Timing(
        pace=mean._replace(step=step, case=case, block=block),
        n_pilot=len(paces),
        spread=_OF_A_BRANCH if pilots.was_cut and not is_bound else _spread(sample),
        known=sample.known,
        is_bound=is_bound,
        seconds=seconds,
        modes=tuple(pilots.modes.values()),
        memory=pilots.memory,
        has_compiled=pilots.compiling > 0.0,
        failures=tuple(failures),
    )


def _finish(pilots: Pilots, picked: list[tuple[int, ...]], sample: Sample, seconds: float) -> None:
    """Continue shortened cases, part by part, for some seconds in total.

    The beginning of such a case says little about its rest: it may meet more sets of contacts, or need many
    revolutions after the record. The case with the largest predicted rest is always continued next. Records
    that fit are run too, because revolutions after them are not known. Unfinished cases are predicted again,
    and corrected by the others.
    """
    shortened = {index: k for k, index in enumerate(picked) if index in pilots.shortened}
    end = time.process_time() + min(seconds, _LONGEST)
    while True:
        left = end - time.process_time()
        going = [i for i in shortened if pilots.left(i) > 0.0 and pilots.seconds_of_next(i) < left]
        if not going:
            break
        index = max(going, key=pilots.left)
        is_done = pilots.go_on(index, left)
        sample.seconds[shortened[index]] = pilots.predicted(index)
        if not is_done:
            break
    for index, k in shortened.items():
        sample.seconds[k], sample.spent[k] = pilots.predicted(index), pilots.spent(index)
        if index in pilots.ended:
            sample.is_whole[k] = True
            spent, to_come = pilots.first(index)
            sample.checked.append((to_come, sample.seconds[k] - spent))


def _spread(sample: Sample) -> float:
    """Standard error of the time of all cases, as a share of it; NaN of none, or one among several."""
    if not sample.seconds:
        return math.nan
    case, step, error = sample.estimate()
    whole = case * sample.n_case + step * sample.all_steps
    return error / whole if whole > 0.0 else 0.0


def _picked(
    blocks: list[Block], missing: NDArray[np.bool_]
) -> Iterator[tuple[tuple[int, ...], float, float]]:
    """Missing cases, none twice, with their predicted steps and the probability that a draw picks each."""
    if not blocks:
        return
    shares = [share_of(block, missing) for block in blocks]
    costs = np.array([block.cost * float(share.mean()) for block, share in zip(blocks, shares, strict=True)])
    numbers = np.array([float(share.sum()) for share in shares])
    chances = 0.5 * costs / costs.sum() + 0.5 * numbers / numbers.sum()
    ends = np.cumsum(chances)
    seen: set[tuple[int, ...]] = set()
    for k in range(4 * _MOST_PILOTS):
        if len(seen) == _MOST_PILOTS:
            return
        n = int(np.searchsorted(ends, (0.5 + k * _AMONG_BLOCKS) % 1.0 * ends[-1], side="right"))
        n = min(n, len(blocks) - 1)
        block, inside = blocks[n], np.argwhere(shares[n])
        chosen = inside[int((0.5 + k * _WITHIN_BLOCK) % 1.0 * len(inside))]
        index = tuple((chosen + np.array(block.start)).tolist())
        if index not in seen:
            seen.add(index)
            yield index, block.cost / math.prod(block.shape), float(chances[n]) / len(inside)


def share_of(block: Block, missing: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which cases of a block are missing, of its shape."""
    return missing[tuple(slice(s, s + n) for s, n in zip(block.start, block.shape, strict=True))]
