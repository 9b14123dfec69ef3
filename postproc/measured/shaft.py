"""The time at which the shaft has turned by an angle: from pulses of a key-phasor, or from a speed."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from postproc.measured.keys import SpeedKeys

    Floats = NDArray[np.float64]

_BAND = 0.1  # of the range of a key-phasor, which it has to cross to pulse again
_WINDOW = 11  # intervals whose median the pulses around are held against
_MISSED, _SPURIOUS = 1.5, 0.6  # times the median: pulses are missing, or one is none
_MOST_MISSED = 0.2  # share of pulses
_FEWEST = 4  # pulses
_SLOWEST = 0.02  # of the highest speed of a column: below, the shaft counts as standing


class Turning(NamedTuple):
    """How the shaft turned."""

    time_at: Callable[[Floats], Floats]  # of revolutions from the angle 0, s from the first sample
    first: float  # revolutions at the beginning and at the end
    last: float
    notes: list[str]
    is_absolute: bool = False  # whether the angle is that from straight up, as in a simulation


def at_constant_speed(speed: float, duration: float) -> Turning:
    """Return the turning at a constant speed, rad/s, whose angle is 0 at the first sample."""
    rate = speed / (2.0 * math.pi)
    note = "the angle of the shaft counts from the first sample: phases are relative to one another"
    return Turning(lambda turns: turns / rate, 0.0, duration * rate, [note])


def by_speed_column(speed: Floats, step: float, where: str) -> Turning:
    """Return the turning of a shaft whose speed (n_sample,), rad/s, was measured `step` seconds apart."""
    size = np.abs(speed)
    turning = np.flatnonzero(size > _SLOWEST * size.max(initial=0.0))
    if not turning.size:
        raise InputError(f"{where}: the speed is 0 throughout; give its value, or the column of a key-phasor")
    first, end = int(turning[0]), int(turning[-1]) + 1
    size = np.maximum(size, _SLOWEST * size.max())
    rates = size[first:end] / (2.0 * math.pi)
    turns = np.concatenate([[0.0], np.cumsum(0.5 * step * (rates[1:] + rates[:-1]))])
    time = step * np.arange(first, end)
    note = "the angle of the shaft is the integral of its speed: phases are relative to one another"
    return Turning(lambda wanted: np.interp(wanted, turns, time), 0.0, float(turns[-1]), [note])


def by_key_phasor(values: Floats, step: float, keys: SpeedKeys, where: str) -> Turning:
    """Return the turning of a shaft with a key-phasor, or another sensor of pulses.

    Pulses that are missing or spurious are found by the intervals around them, and corrected. The time over
    the angle is a cubic spline that is as far from the pulses as a clock of `step` seconds places them.
    InputError where there are too few pulses, or too many are missing.
    """
    from scipy.interpolate import UnivariateSpline

    sign = 1.0 if keys.edge == "rising" else -1.0
    level = float(keys.level or 0.0)
    low, high = float(values.min()), float(values.max())
    pulses = _crossings(sign * values, sign * level, _BAND * (high - low)) * step
    if pulses.size < _FEWEST:
        found = f"{pulses.size} pulses cross {level:g}, and the column goes from {low:.4g} to {high:.4g}"
        fix = "give a longer record, or the value of its speed"
        if not low < level < high and low < high:
            fix = f"set level = {0.5 * (low + high):.3g}"
        raise InputError(f"{where}: no key-phasor: {found}; {fix}")
    pulses, number, notes = _numbered(pulses, where)
    turns = number / keys.per_revolution
    if keys.zero == "straight_up":
        turns = turns + (keys.angle or 0.0) / (2.0 * math.pi)
    if keys.per_revolution > 1:
        notes.append("the angle of the shaft counts from one of several pulses: phases are relative")
    # A logic pulse is placed by its sample alone, within a step: variance step^2 / 12.
    spline = UnivariateSpline(turns, pulses, k=3, s=pulses.size * step**2 / 12.0)
    return Turning(
        time_at=lambda wanted: np.asarray(spline(wanted)),
        first=float(turns[0]),
        last=float(turns[-1]),
        notes=notes,
        is_absolute=keys.per_revolution == 1 and keys.zero == "straight_up" and keys.angle is not None,
    )


def _crossings(values: Floats, level: float, band: float) -> Floats:
    """Return where values rise through a level, in samples, if they have been a band below since the last."""
    state = np.where(values >= level, 1, np.where(values < level - band, -1, 0))
    known = np.flatnonzero(state)
    rises = known[1:][(state[known[1:]] == 1) & (state[known[:-1]] == -1)]
    before, after = values[rises - 1], values[rises]
    share = (level - before) / np.where(after > before, after - before, 1.0)
    return np.asarray(rises - 1 + np.clip(share, 0.0, 1.0), dtype=float)


def _numbered(pulses: Floats, where: str) -> tuple[Floats, NDArray[np.int64], list[str]]:
    """Return the pulses that are some, their numbers, and what was wrong with them."""
    from scipy.ndimage import median_filter

    given = pulses.size
    for _ in range(3):  # several in one revolution are found one after the other
        steps = np.diff(pulses)
        usual = median_filter(steps, min(_WINDOW, steps.size), mode="nearest")
        padded = np.pad(steps, 1, mode="edge")
        # Of the pulses at both ends of a short interval, the one without which the next is as usual is none.
        off_first, off_second = (abs(padded[i : i + steps.size] + steps - usual) for i in (0, 2))
        short = np.flatnonzero(steps < _SPURIOUS * usual)
        if not short.size:
            break
        pulses = np.delete(pulses, np.unique(short + (off_second < off_first)[short]))
    steps = np.diff(pulses)
    usual = median_filter(steps, min(_WINDOW, steps.size), mode="nearest")
    counts = np.where(steps > _MISSED * usual, np.rint(steps / usual), 1).astype(np.int64)
    missing, dropped = int(counts.sum() - counts.size), given - pulses.size
    notes = []
    if dropped:
        notes.append(f"key-phasor: {dropped} of {given} pulses are spurious and left out")
    if missing:
        longest = int(counts.max()) - 1
        notes.append(f"key-phasor: {missing} pulses are missing, up to {longest} in a row; interpolated")
    if max(missing, dropped) > _MOST_MISSED * (counts.sum() + 1):
        problem = f"{missing} pulses are missing and {dropped} spurious, of {int(counts.sum()) + 1}"
        raise InputError(f"{where}: key-phasor: {problem}; set the level, or give the speed's value")
    return pulses, np.concatenate([[0], np.cumsum(counts)]), notes
