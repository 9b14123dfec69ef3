"""One record of a data logger: its signals at uniform angles of the shaft, and what is wrong with it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from postproc.measured.clock import Sampled, clipped, sampled
from postproc.measured.formats import read_columns
from postproc.measured.keys import unit_factor
from postproc.measured.shaft import Turning, at_constant_speed, by_key_phasor, by_speed_column
from postproc.signals.contacts import runs_of
from postproc.signals.resampling import between, decimated
from rubhpc.errors import InputError
from rubhpc.input.messages import place

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from postproc.measured.keys import MeasuredKeys, Signal

    Floats = NDArray[np.float64]

_ONE_SPEED = 0.02  # by which the speed of revolutions varies about their mean, at one speed
_SCATTER = 8  # revolutions over whose mean single pulses scatter little
_GAP = 0.05  # of a revolution: more samples that are missing in a row cut the record
_FEWEST = 4  # whole revolutions
_ASIDE = 1  # revolutions on either side of those resampled at once, which the filter sees
_START = 6  # revolutions of a run-up, whose mean position is 0 where no gap voltage is given
_RPM = 30.0 / math.pi


class Record(NamedTuple):
    """Signals of whole revolutions."""

    signals: dict[Signal, Floats]  # (n_revolution * samples_per_revolution,) each, SI
    speed: Floats  # (n_revolution,), rad/s
    begins: Floats  # (n_revolution + 1,), s, the end of the last one too
    notes: list[str]  # what is wrong
    rate: float  # Hz, of the samples in the file
    is_absolute: bool  # whether the angle of the shaft is that from straight up

    @property
    def is_steady(self) -> bool:
        """Whether the shaft turned at one speed."""
        width = min(_SCATTER, self.speed.size)
        means = np.convolve(self.speed, np.full(width, 1.0 / width), mode="valid")
        return float(np.ptp(means)) <= _ONE_SPEED * float(self.speed.mean())


def read_record(keys: MeasuredKeys, path: Path) -> Record:
    """Return the record in a file, less its run-out where that is asked for.

    InputError where the file cannot be read, or has too few revolutions or pulses.
    """
    record = _tracked(keys, path)
    if keys.slow_roll is None:
        return record
    n = keys.samples_per_revolution
    if keys.slow_roll.data is not None:
        slow = _tracked(keys, Path(keys.file).parent / keys.slow_roll.data)
        picked = np.ones(slow.speed.size, dtype=bool)
    else:
        slow, picked = record, record.speed < float(keys.slow_roll.below or 0.0)
    if not picked.any():
        lowest = f"the lowest speed is {_RPM * float(record.speed.min()):.4g} rpm"
        raise InputError(f"{path}: [slow_roll] below: {lowest}; give one above it, or data")
    found = {}
    for signal, values in record.signals.items():
        mean = slow.signals[signal].reshape(-1, n)[picked].mean(axis=0)
        found[signal] = values - np.tile(mean - mean.mean(), record.speed.size)
    return record._replace(signals=found)


def _tracked(keys: MeasuredKeys, path: Path) -> Record:
    """The record with its run-out."""
    record, turning = _read(keys, path)
    notes = [*record.notes, *turning.notes]
    for signal in keys.signals:
        raw = record.values[signal.column]
        if not np.ptp(raw):
            notes.append(f"column {signal.column}: is {raw[0]:g} throughout; check the sensor")
        share, levels = clipped(raw)
        if levels:
            ends = " and ".join(f"{level:.4g}" for level in levels)
            notes.append(
                f"column {signal.column}: {100 * share:.2g} % of the samples are clipped, at {ends}; "
                "amplitudes are too low, raise the range"
            )
    first, end = math.ceil(turning.first - 1e-9), math.floor(turning.last + 1e-9)
    if end - first < _FEWEST:
        problem = f"holds {max(end - first, 0)} whole revolutions, fewer than {_FEWEST}"
        raise InputError(f"{path}: {problem}; give a longer record, or check [time] and [speed]")
    begins = turning.time_at(np.arange(first, end + 1).astype(float))
    begins = np.clip(begins, 0.0, record.time[-1])
    if not (np.diff(begins) > 0.0).all():
        raise InputError(f"{path}: [speed]: the shaft does not turn forward throughout; check the column")
    low, high = _longest_part(keys, record, begins)
    if (low, high) != (0, begins.size - 1):
        kept = f"{begins[low]:.3f} to {begins[high]:.3f} s, {high - low} of {begins.size - 1} revolutions"
        notes.append(f"drop-outs: only the longest part without them is used, {kept}")
    if high - low < _FEWEST:
        raise InputError(f"{path}: drop-outs leave no {_FEWEST} revolutions in a row; give another record")
    n, begins = keys.samples_per_revolution, begins[low : high + 1]
    found = Record(
        signals={},
        speed=2.0 * math.pi / np.diff(begins),
        begins=begins,
        notes=[f"{path.name}: {note}" for note in notes],
        rate=1.0 / record.step,
        is_absolute=turning.is_absolute,
    )
    for signal in keys.signals:
        column = record.values[signal.column]
        values = _by_angle(column, record.step, turning, first + low, first + high, n)
        if not np.ptp(column):
            values[:] = column[0]  # without the rounding of the filter
        offset = signal.offset
        if offset is None:
            offset = float((values if found.is_steady else values[: _START * n]).mean())
        found.signals[signal] = (values - offset) * signal.factor
    return found


def _read(keys: MeasuredKeys, path: Path) -> tuple[Sampled, Turning]:
    """The columns of a file at uniform times, and how the shaft turned."""
    assert keys.speed is not None
    of_time, of_speed = keys.time.column, keys.speed.column
    names = [signal.column for signal in keys.signals] + [name for name in (of_time, of_speed) if name]
    columns, rate = read_columns(path, names)
    if path.suffix.lower() == ".wav":
        columns = {name: values * keys.full_scale for name, values in columns.items()}
    rate = rate if keys.time.rate is None else keys.time.rate
    time = None
    if of_time is not None:
        where = place(keys.file, "time", "unit")
        time = columns.pop(of_time) * unit_factor(keys.time.unit, "s", where)
    elif rate is None:
        fix = 'add [time] with column = "t" or rate = "25.6 kHz"'
        raise InputError(f"{keys.file}: [time]: {path.suffix} states no sampling rate; {fix}")
    record = sampled(columns, time, rate, str(path), of_time or "")
    if of_speed is None:
        turning = at_constant_speed(float(keys.speed.value or 0.0), float(record.time[-1]))
    elif keys.speed.is_key_phasor:
        turning = by_key_phasor(
            record.values[of_speed], record.step, keys.speed, f"{path}: column {of_speed}"
        )
    else:
        where = place(keys.file, "speed", "unit")
        factor = unit_factor(str(keys.speed.unit), "rad/s", where)
        turning = by_speed_column(factor * record.values[of_speed], record.step, f"{path}: column {of_speed}")
    return record, turning


def _longest_part(keys: MeasuredKeys, record: Sampled, begins: Floats) -> tuple[int, int]:
    """The longest part, as revolutions from and to, in which no signal lacks a twentieth of a revolution."""
    bad = np.zeros(begins.size - 1, dtype=bool)
    lasts = np.diff(begins)
    for column in {signal.column for signal in keys.signals}:
        first, end = (at * record.step for at in runs_of(record.absent[column]))
        held = [np.clip(np.searchsorted(begins, at) - 1, 0, bad.size - 1) for at in (first, end)]
        for is_long, start, stop in zip(end - first > _GAP * lasts[held[0]], *held, strict=True):
            if is_long:
                bad[start : stop + 1] = True
    parts = [(int(first), int(end)) for first, end in zip(*runs_of(~bad), strict=True)]
    return max(parts, key=lambda part: part[1] - part[0], default=(0, 0))


def _by_angle(values: Floats, step: float, turning: Turning, first: int, end: int, n: int) -> Floats:
    """Return a signal at `n` uniform angles of each revolution from `first` up to `end`, whole ones.

    Where the shaft turns so slowly that there are more samples in a revolution than `n`, orders beyond half
    of `n` are filtered off. The values (n_sample,) are `step` seconds apart.
    """
    seen = between(values)
    parts = []
    for begin, stop, times in _blocks(step, turning, first, end, n):
        wanted = np.arange((begin - _ASIDE) * n * times, (stop + _ASIDE) * n * times) / (n * times)
        at = turning.time_at(np.clip(wanted, turning.first, turning.last))
        fine = decimated(seen(at / step), times)
        parts.append(fine[_ASIDE * n : (_ASIDE + stop - begin) * n])
    return np.concatenate(parts)


def _blocks(step: float, turning: Turning, first: int, end: int, n: int) -> Iterator[tuple[int, int, int]]:
    """Yield the revolutions in whose samples `n` fit as many times, a power of two, and that number."""
    lasts = np.diff(turning.time_at(np.arange(first, end + 1).astype(float)))
    times = [2 ** max(0, math.ceil(math.log2(last / (step * n)))) for last in lasts.tolist()]
    begin = 0
    for i in range(1, len(times) + 1):
        if i == len(times) or times[i] != times[begin]:
            yield first + begin, first + i, times[begin]
            begin = i
