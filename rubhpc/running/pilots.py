"""What a run of a study spends its time on: a few of its cases, spread over all axes, are timed.

Times are those of the processor: other work on the machine does not count.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.integrate.branch_case import record_branches
from rubhpc.integrate.case import compile_kernels, run_case
from rubhpc.integrate.compilation import seconds_compiling
from rubhpc.running.block_time import time_block
from rubhpc.running.worker import operation_of, set_up

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from rubhpc.integrate.record import Record
    from rubhpc.integrate.setup import Setup
    from rubhpc.running.preparations import Preparations
    from rubhpc.storage.manifest import Manifest
    from rubhpc.study.cases import Block, Case, CaseGrid
    from rubhpc.study.contact_keys import Contact
    from rubhpc.study.study import Recording

_MOST_PILOTS, _FEW_PILOTS, _FEW_BRANCHED = 64, 6, 2  # cases; timed even if slow, and of a branch study
_ENOUGH, _MOST = 3.0, 12.0  # processor seconds after which no more are begun: where they agree, and at all
_AGREED = 0.25  # standard error of the mean pace, as a share of it, where cases agree
_LONG, _PILOT_TIME = 0.25, 0.5  # s: longer cases are shortened; of the longest run of such a case, about
_FIRST_STEPS = 50_000  # predicted, of the first run of a case that is shortened
_LONGEST_BRANCHES = 20.0  # s, after which the branches of a case are followed no further
_RUN_UP_COST = 3.5  # of a revolution with changing speed, times that of one at the highest speed
_LATE = 0.25  # least pace of what is left of a shortened case, over that of what was timed
# Positions that spread evenly over a square, however many (R. Kronecker; steps of M. Roberts' R2 sequence).
_AMONG_BLOCKS, _WITHIN_BLOCK = 0.7548776662466927, 0.5698402909980532


class Pace(NamedTuple):
    """What a run spends its time on, seconds.

    `step` is that of a predicted step, `rig` of assembling a rig, `speed` of preparing it at a speed with the
    modes, `friction` of solving the contact modes of a friction, `block` of writing a block.
    """

    step: float
    rig: float
    speed: float
    friction: float
    block: float = 0.0


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


class _Enough(Exception):  # noqa: N818 - no error: what ends the branches of a pilot case
    """A pilot case takes longer than is waited for."""


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
    failures: list[str] = []
    is_bound = False
    began = time.process_time()
    pilots = _Pilots(grid)
    few = _FEW_PILOTS if grid.study.branch is None else _FEW_BRANCHED
    for k, (index, steps) in enumerate(_picked(blocks, missing)):
        spent = time.process_time() - began - pilots.loading - pilots.compiling
        if k >= few and spent > (_ENOUGH if _spread(paces, missing) <= _AGREED else _MOST):
            break  # a few rubs among many free motions take most of the time of some studies
        try:
            paces.append(pilots.pace(index, steps))
        except Exception as error:  # whatever is wrong with the case: the others are timed all the same
            where = manifest.name_case(int(np.ravel_multi_index(index, grid.shape)))
            failures.append(f"{where}: {type(error).__name__}: {' '.join(str(error).split())}")
        if pilots.was_cut:  # another would take as long
            is_bound = True
            break
    block = time_block(manifest, pilots.record) if pilots.record is not None else 0.0
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


class _Pilots:
    """Times cases of a grid, one after another.

    Attributes
    ----------
    was_cut : bool
        The last one took longer than is waited for.
    loading, compiling : float
        Processor seconds in which kernels were loaded, and in which such were compiled that no cache held.
    record : Record or None
        Of the latest case that was run.
    """

    def __init__(self, grid: CaseGrid) -> None:
        self._grid, self._study = grid, grid.study
        self._compiled: set[Contact] = set()
        self._paces: list[float] = []  # of the cases so far, seconds a predicted step
        self.was_cut = False
        self.loading = self.compiling = 0.0
        self.record: Record | None = None

    def pace(self, index: tuple[int, ...], steps: float) -> Pace:
        """Times of a case, shortened where the whole of it takes long, and of its preparation."""
        case = self._grid.case(index)
        if self._study.branch is not None:
            return Pace(self._branches(case) / steps, 0.0, 0.0, 0.0)
        rig, speed, setup = self._prepared(case)
        runs, recording = self._runs(case, setup, steps)
        done, taken = runs[-1]
        if len(runs) == 1:  # it has solved the contact modes
            first, again = taken, min(taken, self._run(case, setup, recording))
        else:
            first = self._run(case, set_up(self._study, case, setup.model), recording)
            again = min(taken, first)
        whole = again
        if done < 1.0:  # a rub may begin late, and then costs more
            before = runs[-2] if len(runs) > 1 else (0.0, 0.0)
            slope = max((again - before[1]) / (done - before[0]), _LATE * again / done)
            whole = again + (1.0 - done) * slope
        self._paces.append(whole / steps)
        if case.speed_law is not None:
            whole *= _RUN_UP_COST
        return Pace(step=whole / steps, rig=rig, speed=speed, friction=max(0.0, first - again))

    def _prepared(self, case: Case) -> tuple[float, float, Setup]:
        """Times of assembling the rig and of preparing the speed, and the set-up, its kernels compiled."""
        if case.contact not in self._compiled:
            compiled, began = seconds_compiling(), time.process_time()
            compile_kernels(
                set_up(self._study, case),
                clearance=case.clearance,
                friction=case.friction,
                recording=self._study.recording,
            )
            self._compiled.add(case.contact)
            if seconds_compiling() == compiled:
                self.loading += time.process_time() - began
            else:
                self.compiling += time.process_time() - began
        began = time.process_time()
        setup = set_up(self._study, case)
        middle = time.process_time()
        set_up(self._study, case, setup.model)
        prepared = time.process_time() - middle
        return max(0.0, middle - began - prepared), prepared, setup

    def _runs(self, case: Case, setup: Setup, steps: float) -> tuple[list[tuple[float, float]], Recording]:
        """Shares of the case that were run, each longer than the last, what they took, s, and the longest."""
        whole = self._whole(case)
        known = max(self._paces, default=math.nan) * steps
        ends_by_itself = isinstance(whole.transient, str)  # nobody knows when, but by trying
        share = 1.0 if ends_by_itself or known < _LONG else min(1 / 16, _FIRST_STEPS / steps)
        runs: list[tuple[float, float]] = []
        while True:
            recording = _shortened(whole, share)
            taken = self._run(case, setup, recording)
            done = (recording.longest_transient + recording.revolutions) / (
                whole.longest_transient + whole.revolutions
            )
            runs.append((done, taken))
            longer = min(1.0, done * _PILOT_TIME / taken, 4 * share)
            if done == 1.0 or (longer < 1.0 and longer < 2 * share):
                return runs, recording
            share = longer

    def _whole(self, case: Case) -> Recording:
        """The recording of a case; of a run-up as many revolutions at its highest speed."""
        recording = self._study.recording
        if case.speed_law is None:
            return recording
        return replace(
            recording,
            transient=0,
            transient_limit=None,
            transient_tolerance=None,
            revolutions=case.speed_law.n_revolution,
        )

    def _branches(self, case: Case) -> float:
        """Time of the branches of a case; `was_cut` where they were not followed to their ends."""
        study = self._study
        assert study.branch is not None
        span = study.axis(study.branch.along).drawn_from
        assert span is not None

        def check() -> None:
            if time.process_time() - began > _LONGEST_BRANCHES:
                raise _Enough

        while True:
            compiled, began = seconds_compiling(), time.process_time()
            try:
                record_branches(operation_of(self._grid, case), study.branch, span, study.recording, check)
            except _Enough:
                self.was_cut = seconds_compiling() == compiled
            taken = time.process_time() - began
            if seconds_compiling() == compiled:
                return taken
            self.compiling += taken

    def _run(self, case: Case, setup: Setup, recording: Recording) -> float:
        """Processor time of a case, s; it is run once more where kernels were compiled meanwhile."""
        while True:
            compiled, began = seconds_compiling(), time.process_time()
            self.record = run_case(
                setup,
                clearance=case.clearance,
                friction=case.friction,
                recording=recording,
                initial=case.initial,
            )
            taken = time.process_time() - began
            if seconds_compiling() == compiled:
                return max(taken, 1e-6)
            self.compiling += taken


def _shortened(whole: Recording, share: float) -> Recording:
    """A recording, or a share of it: what is recorded costs more than what is not."""
    if share == 1.0:
        return whole
    return replace(
        whole,
        transient=round(share * whole.longest_transient),
        transient_limit=None,
        transient_tolerance=None,
        revolutions=round(share * whole.revolutions) or 1,
    )
