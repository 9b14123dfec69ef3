"""What a run of a study spends its time on: cases and preparations are counted, a few short pilots timed.

Times are those of the processor: other work on the machine does not count.
"""

from __future__ import annotations

import math
import time
from collections import OrderedDict
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from rubhpc.integrate.case import compile_kernels, run_case
from rubhpc.integrate.compilation import seconds_compiling
from rubhpc.running.worker import MOST_SETUPS, set_up
from rubhpc.storage.resume import missing_share

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.setup import Setup
    from rubhpc.rig.rig import Rig
    from rubhpc.storage.manifest import Manifest
    from rubhpc.study.cases import Block, CaseGrid
    from rubhpc.study.study import Recording

_PILOTS, _FEW_PILOTS, _ENOUGH = 9, 3, 20.0  # cases; run even if slow; seconds after which no more are started
_FIRST_STEPS, _PILOT_TIME = 50_000, 1.0  # predicted, of a pilot's first try; seconds of its longest, about
_STRETCHES, _MOST_COUNTED = 10, 2_000  # parts of a run, and cases in all, in which preparations are counted
_RUN_UP_COST = 3.5  # times that of a constant speed
_SECTION = 0.618  # golden: shares k * _SECTION (mod 1) spread evenly, however many

_Kept: TypeAlias = "OrderedDict[tuple[int, float], tuple[Rig, set[float]]]"  # rig and speed -> its frictions


class Pace(NamedTuple):
    """What a run spends its time on, seconds.

    `step` is that of a predicted step, `rig` of assembling a rig, `speed` of preparing it at a speed with the
    modes, `friction` of solving the contact modes of a friction.
    """

    step: float
    rig: float
    speed: float
    friction: float


class Preparations(NamedTuple):
    """How many times a rank that computes all alone assembles a rig, prepares a speed, and a friction."""

    rig: float
    speed: float
    friction: float


def seconds_of(pace: Pace, steps: float, n: Preparations) -> float:
    """Time of a whole run on one core."""
    return pace.step * steps + pace.rig * n.rig + pace.speed * n.speed + pace.friction * n.friction


def count_preparations(grid: CaseGrid, missing: NDArray[np.bool_]) -> Preparations:
    """Go through the missing cases in the order of a run, as a worker does that keeps the latest set-ups.

    Of many cases a few stretches are gone through, and stand for the rest.
    """
    sequences = [[b for b in sequence if missing_share(b, missing)] for sequence in grid.sequences()]
    sequences = [sequence for sequence in sequences if sequence]
    sizes = [sum(math.prod(block.shape) for block in sequence) for sequence in sequences]
    n_stretch = _STRETCHES if sum(sizes) > _MOST_COUNTED else 1
    counted, found = 0, np.zeros(3)
    kept: _Kept = OrderedDict()
    for part in np.array_split(np.arange(len(sequences)), min(n_stretch, len(sequences) or 1)):
        n_here = 0
        for k in part.tolist():
            for block in sequences[k]:
                n_here += _count_in(grid, block, missing, kept, found)
            if n_stretch > 1 and n_here > _MOST_COUNTED / _STRETCHES:
                break
        counted += n_here
    share = int(missing.sum()) / counted if counted else 0.0
    return Preparations(*(share * found).tolist())


def _count_in(
    grid: CaseGrid, block: Block, missing: NDArray[np.bool_], kept: _Kept, found: NDArray[np.float64]
) -> int:
    """Add to `found` what the missing cases of a block prepare, given what is kept; returns their number."""
    try:
        cases = grid.cases(block)
    except Exception:  # its cases will fail
        return 0
    wanted = [cases[i] for i in grid.in_turn(cases) if missing[cases[i].index]]
    for case in wanted:
        key = id(case.rig), case.speed
        if key not in kept:
            found[0] += all(rig is not case.rig for rig, _ in kept.values())
            found[1] += 1
            kept[key] = case.rig, set()
            if len(kept) > MOST_SETUPS:
                kept.popitem(last=False)
        frictions = kept[key][1]
        found[2] += case.friction not in frictions
        frictions.add(case.friction)
    return len(wanted)


def time_pilots(grid: CaseGrid, manifest: Manifest, blocks: list[Block]) -> tuple[Pace, list[str]]:
    """Mean times over a few cases, and what failed.

    The cases are spread evenly from the longest block to the last, each from another place in its block: the
    first cases of all blocks share a value on every axis that a block spans.
    """
    paces, failures = [], []
    spread = np.linspace(0, len(blocks) - 1, _PILOTS).round().astype(int)
    picked: list[int] = np.unique(spread).tolist() if blocks else []
    began = time.monotonic()
    for k, i in enumerate(picked):
        if k >= _FEW_PILOTS and time.monotonic() - began > _ENOUGH:
            break
        block = blocks[i]
        box = np.unravel_index(int(k * _SECTION % 1.0 * math.prod(block.shape)), block.shape)
        index = tuple(int(start + step) for start, step in zip(block.start, box, strict=True))
        try:
            paces.append(_pilot(grid, index, block.cost / math.prod(block.shape)))
        except Exception as error:  # whatever is wrong with the case: the others are timed all the same
            where = manifest.name_case(int(np.ravel_multi_index(index, grid.shape)))
            failures.append(f"{where}: {type(error).__name__}: {' '.join(str(error).split())}")
    mean = np.mean(paces, axis=0) if paces else np.full(len(Pace._fields), math.nan)
    return Pace(*mean.tolist()), failures


def _pilot(grid: CaseGrid, index: tuple[int, ...], steps: float) -> Pace:
    """Times of a case, shortened where the whole of it takes long, and of its preparation.

    Revolutions that are recorded cost more than those thrown away: their shares stay.
    """
    study, case = grid.study, grid.case(index)
    whole = study.recording
    if case.speed_law is not None:  # timed at its highest speed
        whole = replace(
            whole,
            transient=0,
            transient_limit=None,
            transient_tolerance=None,
            revolutions=case.speed_law.n_revolution,
        )
        steps /= _RUN_UP_COST

    def seconds(recording: Recording, setup: Setup) -> float:
        while True:
            compiled, began = seconds_compiling(), time.process_time()
            run_case(
                setup,
                clearance=case.clearance,
                friction=case.friction,
                recording=recording,
                initial=case.initial,
            )
            if seconds_compiling() == compiled:
                return max(time.process_time() - began, 1e-6)

    def shortened(transient: int, revolutions: int) -> Recording:
        return replace(
            whole,
            transient=transient,
            transient_limit=None,
            transient_tolerance=None,
            revolutions=revolutions,
        )

    setup = set_up(study, case)
    compile_kernels(setup, clearance=case.clearance, friction=case.friction, recording=shortened(0, 1))
    share = min(1 / 16, _FIRST_STEPS / steps)
    while True:
        transient, revolutions = round(share * whole.longest_transient), round(share * whole.revolutions) or 1
        recording = shortened(transient, revolutions)
        taken = seconds(recording, setup)
        done = (transient + revolutions) / (whole.longest_transient + whole.revolutions)
        longer = min(1.0, done * _PILOT_TIME / taken, 4 * share)  # a rub may begin late, and then costs more
        if longer == 1.0:
            recording, done = whole, 1.0
            taken = seconds(whole, setup)
            break
        if longer < 2 * share:
            break
        share = longer
    began = time.process_time()
    model = set_up(study, case).model
    assembled = time.process_time()
    fresh = set_up(study, case, model)
    prepared = time.process_time()
    first = seconds(recording, fresh)
    again = min(taken, seconds(recording, fresh)) if first > taken else taken
    return Pace(
        step=again / (steps * done),
        rig=max(0.0, (assembled - began) - (prepared - assembled)),
        speed=prepared - assembled,
        friction=max(0.0, first - again),
    )
