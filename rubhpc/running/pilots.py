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

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from rubhpc.running.preparations import Preparations
    from rubhpc.storage.manifest import Manifest
    from rubhpc.study.cases import Block, CaseGrid

_MOST_PILOTS, _FEW_PILOTS, _FEW_BRANCHED = 64, 6, 2  # cases; timed even if slow, and of a branch study
_ENOUGH, _MOST = 3.0, 12.0  # processor seconds after which no more are begun: where they agree, and at all
_AGREED = 0.25  # standard error of the mean pace, as a share of it, where cases agree
_DEAR = 0.2  # share of the time of all pilot cases from which one that was shortened is run whole
_LONGEST = 20.0  # s, in which such cases are run whole, together
_LEAST, _SHARE = 10.0, 0.2  # s that all may take, or that share of the time foreseen where it is more
_FEWEST = 3  # cases, timed in any case
# Positions that spread evenly over a square, however many (R. Kronecker; steps of M. Roberts' R2 sequence).
_AMONG_BLOCKS, _WITHIN_BLOCK = 0.7548776662466927, 0.5698402909980532


@dataclass(frozen=True, kw_only=True)
class Timing:
    """What pilot cases have shown.

    Attributes
    ----------
    pace : Pace
        Means over them; NaN where all failed.
    n_pilot : int
        Cases that were timed.
    spread : float
        Standard error of the mean time of a step, as a share of it: 0 where all cases were timed, NaN
        where one of several was.
    is_bound : bool
        Whether a case took longer than is waited for, so that the pace is a lower bound.
    seconds : float
        Processor time that it took, but for what a run takes as well: kernels that are loaded.
    failures : tuple of str
        Coordinates of the cases that failed, and why.
    """

    pace: Pace
    n_pilot: int = 0
    spread: float = math.nan
    is_bound: bool = False
    seconds: float = 0.0
    failures: tuple[str, ...] = ()


def seconds_of(pace: Pace, steps: float, n: Preparations, n_block: int) -> float:
    """Time of a whole run on one core."""
    prepared = pace.rig * n.rig + pace.speed * n.speed + pace.friction * n.friction
    return pace.step * steps + prepared + pace.block * n_block


def time_pilots(
    grid: CaseGrid, manifest: Manifest, blocks: list[Block], missing: NDArray[np.bool_]
) -> Timing:
    """Time cases of the blocks that are missing, until enough time has gone by.

    A case is picked with a probability proportional to its predicted steps, so that the mean pace of the
    picked ones is that of all; they spread evenly over the blocks and over the cases of a block.
    """
    paces: list[Pace] = []
    picked: list[tuple[tuple[int, ...], float]] = []
    failures: list[str] = []
    is_bound = False
    began = time.process_time()
    pilots = Pilots(grid)
    few = _FEW_PILOTS if grid.study.branch is None else _FEW_BRANCHED
    all_steps = sum(block.cost * float(share_of(block, missing).mean()) for block in blocks)

    def allowed() -> float:
        """Seconds that are left."""
        foreseen = all_steps * float(np.mean([pace.step for pace in paces])) if paces else 0.0
        spent = time.process_time() - began - pilots.loading - pilots.compiling
        return max(_LEAST, _SHARE * foreseen) - spent

    for k, (index, steps) in enumerate(_picked(blocks, missing)):
        spent = time.process_time() - began - pilots.loading - pilots.compiling
        if k >= few and spent > (_ENOUGH if _spread(paces, missing) <= _AGREED else _MOST):
            break  # a few rubs among many free motions take most of the time of some studies
        if k >= min(few, _FEWEST) and allowed() < spent:  # as much is left to run dear cases whole
            break
        try:
            paces.append(pilots.pace(index, steps))
            picked.append((index, steps))
        except Exception as error:  # whatever is wrong with the case: the others are timed all the same
            where = manifest.name_case(int(np.ravel_multi_index(index, grid.shape)))
            failures.append(f"{where}: {type(error).__name__}: {' '.join(str(error).split())}")
        if pilots.was_cut:  # another would take as long
            is_bound = True
            break
    is_bound |= _run_dear_ones(pilots, picked, paces, min(_LONGEST, allowed()))
    block = time_block(manifest, pilots.arrays) if pilots.arrays else 0.0
    seconds = time.process_time() - began - pilots.loading
    if not paces:
        return Timing(pace=Pace(*[math.nan] * len(Pace._fields)), seconds=seconds, failures=tuple(failures))
    return Timing(
        pace=Pace(*np.mean(paces, axis=0).tolist())._replace(block=block),
        n_pilot=len(paces),
        spread=_spread(paces, missing),
        is_bound=is_bound,
        seconds=seconds,
        failures=tuple(failures),
    )


def _run_dear_ones(
    pilots: Pilots, picked: list[tuple[tuple[int, ...], float]], paces: list[Pace], left: float
) -> bool:
    """Run whole, the dearest first, the shortened cases that cost most of all; whether one was cut off.

    All of them take `left` seconds at most.

    What such a case comes to is hardly known from its beginning: more and more sets of contacts, neighbours
    of a motion without a period.
    """
    guessed = [pace.step * steps for pace, (_, steps) in zip(paces, picked, strict=True)]
    for k in sorted(range(len(paces)), key=lambda k: -guessed[k]):
        index, steps = picked[k]
        if index not in pilots.shortened or guessed[k] < _DEAR * sum(guessed) or left <= guessed[k]:
            continue
        began = time.process_time()
        paces[k] = pilots.whole(index, steps, paces[k], left)
        left -= time.process_time() - began
        if pilots.was_cut:
            return True
    return False


def _spread(paces: list[Pace], missing: NDArray[np.bool_]) -> float:
    """Standard error of the mean time of a step, as a share of it; NaN of one case among several."""
    steps = np.array([pace.step for pace in paces])
    unseen = 1.0 - len(paces) / max(int(missing.sum()), len(paces))  # share of the cases
    if len(paces) < 2:
        return 0.0 if unseen == 0.0 and len(paces) else math.nan
    return float(steps.std(ddof=1) * math.sqrt(unseen / len(paces)) / steps.mean())


def _picked(blocks: list[Block], missing: NDArray[np.bool_]) -> Iterator[tuple[tuple[int, ...], float]]:
    """Missing cases, none twice, with their predicted steps."""
    costs = []
    for block in blocks:
        costs.append(block.cost * float(share_of(block, missing).mean()))
    ends = np.cumsum(costs)
    seen: set[tuple[int, ...]] = set()
    for k in range(4 * _MOST_PILOTS if blocks else 0):
        if len(seen) == _MOST_PILOTS:
            return
        n = int(np.searchsorted(ends, (0.5 + k * _AMONG_BLOCKS) % 1.0 * ends[-1], side="right"))
        block = blocks[min(n, len(blocks) - 1)]
        inside = np.argwhere(share_of(block, missing))
        chosen = inside[int((0.5 + k * _WITHIN_BLOCK) % 1.0 * len(inside))]
        index = tuple((chosen + np.array(block.start)).tolist())
        if index not in seen:
            seen.add(index)
            yield index, block.cost / math.prod(block.shape)


def share_of(block: Block, missing: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which cases of a block are missing, of its shape."""
    return missing[tuple(slice(s, s + n) for s, n in zip(block.start, block.shape, strict=True))]
