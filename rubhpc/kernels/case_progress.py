"""Clock and progress of a case: the state that one kernel call leaves for the next."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum
from rubhpc.kernels._struct import Struct
from rubhpc.kernels.contact_pairs import rim_sense

Floats = NDArray[np.float64]

FINISHED, DIVERGED, CONTACT_UNSOLVED, MODE_WANTED, PAUSED, UNDER_WAY = range(6)  # outcomes
MOST_STEPS = 50_000  # of one call at most: the caller checks for stop signals between calls
NONE = -1  # no contact mode wanted, no energies to add, no halving


class Clock(Struct):
    """Resolution and counting of time."""

    spin: float  # rad/s
    tick: float  # s
    sample_level: int  # samples are 2^level ticks apart
    samples_per_revolution: int
    search_level: int  # event-search steps, up to 2^level ticks, need no bound; they are checked at their end
    contact_level: int  # longest step with a pair closed while recording
    n_sample: int  # samples of the record, which ends where the next sample would be
    growth: float  # 1/s, of the unbalance force from tick 0 on; 0 at a constant speed


class Coordinates(Struct):
    """Where a case stands in its contact mode, and its motion where it changes that."""

    z: Floats  # (2, m), modal coordinates, real and imaginary
    z_next: Floats  # (2, m), work space
    motion: Floats  # (2 n,), reduced displacements, then velocities


class Sections(Struct):
    """Ends of revolutions before tick 0, where the motion is kept."""

    motion: Floats  # (k, 2 n), the reduced motion at the end of each of the last k; filled in
    energy_limit: float  # J, of divergence


NO_SECTIONS = Sections(np.zeros((0, 0)), 0.0)


class Progress(Protocol):
    """Progress of a case: a record of integers, which kernels change in place.

    The kernels own it. Callers read it, and change it only through the functions below.
    """

    tick: int  # reached
    mode: int  # contact mode, as its index in the tables
    wanted: int  # set of pairs to close before the next step, or NONE
    n_step: int  # steps taken
    n_event: int  # events since the call before began, or since the tick `counted_from`
    counted_from: int  # tick within a revolution before the last event
    next_sample: int  # to be taken
    entered: int  # tick at which the contact mode was entered
    energy_from: int  # tick from which energies are still to be added, or NONE
    contact_age: int  # level of the contact's duration when its rate of change was last read, or NONE
    resolved_level: int  # of the longest step that resolved the contact then
    halving_level: int  # while halving towards an event: level of the longest step to try; else NONE
    is_after_event: int  # whether the next step is the first one after an event


_RECORD = np.dtype([(name, np.int64) for name in Progress.__annotations__])
LONG_AGO = -(2**61)  # tick


def new_progress(n_case: int) -> Any:
    """Records (n_case,) of cases at tick 0, with every pair open."""
    progress = np.zeros(n_case, dtype=_RECORD).view(np.recarray)
    progress.wanted = progress.energy_from = progress.contact_age = progress.halving_level = NONE
    progress.entered = LONG_AGO
    return progress


def bare(progress: Any) -> Any:
    """The same records as a plain NumPy structured array: access and kernel calls are 20 times as fast."""
    return progress.view(np.ndarray).view(_RECORD)


def restart_clock(record: Any, tick: int, sample: int, *, is_recorded: bool) -> None:
    """Restart the clock of a bare record: the case is at `tick`, and `sample` is the next sample."""
    if passed := tick - int(record["tick"]):
        record["entered"] += passed
        record["counted_from"] += passed
        record["tick"] = tick
    record["next_sample"], record["n_event"] = sample, 0
    if not is_recorded:
        record["energy_from"] = NONE


def begin_in(record: Any, mode: int) -> None:
    """Set the contact mode of a bare record, whose modal coordinates are those of that mode."""
    record["mode"] = mode


@jit_sum
def shaft_angle(clock: Clock, tick: int) -> float:
    """Angle of the shaft at a tick, rad, counted from the beginning of its revolution."""
    ticks_per_revolution = clock.samples_per_revolution << clock.sample_level
    return rim_sense(clock.spin) * 2.0 * np.pi * (tick % ticks_per_revolution) / ticks_per_revolution


@jit_sum
def shaft_turn(clock: Clock, tick: int, after: float = 0.0) -> tuple[float, float]:
    """Cosine and sine of the shaft's angle a time `after` (s) a tick, times the growth of the unbalance."""
    angle = shaft_angle(clock, tick) + clock.spin * after
    size = np.exp(clock.growth * (tick * clock.tick + after))
    return size * np.cos(angle), size * np.sin(angle)
