"""Shorter cases that stand for a whole one: a share of its recording, or parts of its changing speed."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.study.drive_law import DriveLaw
from rubhpc.study.speed_law import SpeedLaw

if TYPE_CHECKING:
    from rubhpc.study.study import Recording

_WINDOWS = 4  # parts of a law


def parts(law: SpeedLaw | DriveLaw, turns: int) -> list[SpeedLaw | DriveLaw]:
    """So many revolutions of a changing speed: the first ones of a drive, else parts spread over the law."""
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


def shortened(whole: Recording, share: float) -> Recording:
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
