"""Time of a case of changing speed for `rubhpc plan`, from representative parts."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.changing_speed.case import RunUpRecord
from rubhpc.running.worker import integrate
from rubhpc.study.drive_law import DriveLaw
from rubhpc.study.speed_law import SpeedLaw

if TYPE_CHECKING:
    from rubhpc.integrate.setup import Setup
    from rubhpc.running.stopwatch import Stopwatch
    from rubhpc.study.cases import Case
    from rubhpc.study.study import Study

_FIRST_TURNS = 64  # revolutions of a changing speed that are tried first
_WHOLE_TURNS = 3.0  # s: such cases are run whole if that takes no longer
_WINDOWS = 4  # parts of a law


def parts(law: SpeedLaw | DriveLaw, turns: int) -> list[SpeedLaw | DriveLaw]:
    """Parts with so many revolutions: the first ones of a drive, else parts spread over the law."""
    if isinstance(law, DriveLaw):
        return [replace(law, n_revolution=turns)]
    n = law.n_revolution
    if turns >= n:
        return [law]
    each = max(turns // _WINDOWS, 1)
    firsts = [round((k + 0.5) / _WINDOWS * (n - each)) for k in range(_WINDOWS)]
    return [_between(law, first, first + each) for first in firsts]


def _between(law: SpeedLaw, first: int, last: int) -> SpeedLaw:
    """A law from one revolution to another."""
    (begin, end), speeds, _ = law.at_angle(2.0 * np.pi * np.array([first, last * (1.0 + 1e-9)]))
    inner = [(t, v) for t, v in zip(law.time, law.speed, strict=True) if begin < t < end]
    points = [(begin, speeds[0]), *inner, (end, speeds[1])]
    times, values = zip(*points, strict=True)
    return SpeedLaw(time=tuple(map(float, times)), speed=tuple(map(float, values)))


def time_run_up(
    study: Study, case: Case, setup: Setup, law: SpeedLaw | DriveLaw, stopwatch: Stopwatch
) -> tuple[float, RunUpRecord]:
    """Time of a run-up or drive, s, mainly for the set-up of its pieces, and a record of it."""
    n, turns = law.n_revolution, min(law.n_revolution, _FIRST_TURNS)
    while True:
        taken = 0.0
        for part in parts(law, turns):
            run = partial(integrate, study, replace(case, speed_law=part), setup, case.initial)
            seconds, record = stopwatch.timed(run, math.inf)
            taken += seconds
        whole = taken * n / turns
        longer = n if whole <= _WHOLE_TURNS else min(n, round(turns * _WHOLE_TURNS / 2 / taken))
        if turns == n or longer < 2 * turns:
            assert isinstance(record, RunUpRecord)
            return whole, record
        turns = longer
