"""Samples of a record and their extrema, read from modal coordinates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels._struct import Struct
from rubhpc.kernels.accumulators import (
    HORIZONTAL,
    TWIST,
    TWIST_ACCELERATION,
    VERTICAL,
    Accumulator,
    Samples,
)
from rubhpc.kernels.contact_modes import (
    LANES,
    LATERAL_RATE,
    LATERAL_ROW,
    N_ROTOR_ROW,
    SAMPLES_AT_ONCE,
    TWIST_ACCELERATION_ROW,
    ModeTables,
)
from rubhpc.kernels.cubics import turning_value

Floats = NDArray[np.float64]


class Recorder(Struct):
    """Work space of a case's measures, for o output rows and q pairs; made by `recorder`."""

    value: Floats  # (SAMPLES_AT_ONCE o,), outputs sample by sample
    last: Floats  # (2, 3 + q), signals with extrema and their rates at the last sample; NaN before the first
    node: Floats  # (4, q), force, slip speed (N, m/s) and their rates of closed pairs at the last step
    begun: Floats  # (2, m), coordinates where the span under way began, in one contact mode throughout
    gained: Floats  # (2,), J, damping loss and unbalance work since then, but for their steady parts


def recorder(q: int, n_probe: int = 0) -> Recorder:
    """Work space for q pairs and the probes, before the first sample; without that for coordinates."""
    n_row = N_ROTOR_ROW + 3 * q + n_probe
    return Recorder(
        value=np.zeros(SAMPLES_AT_ONCE * n_row),
        last=np.full((2, 3 + q), np.nan),
        node=np.zeros((4, q)),
        begun=np.zeros((2, 0)),
        gained=np.zeros(2),
    )


def with_coordinates(recorder: Recorder, m: int) -> Recorder:
    """The same with work space for m coordinates."""
    return recorder._replace(begun=np.zeros((2, m)))


class Measured(Struct):
    """What is measured of a case: work space, samples, and sums and extrema."""

    recorder: Recorder
    samples: Samples
    accumulator: Accumulator


@linked_sum
def read_outputs(output: Floats, mode: int, z_re: Floats, z_im: Floats, n_value: int, value: Floats) -> None:
    """Fill the first `n_value` outputs from the modal coordinates; their number is a multiple of four.

    Coordinates at zero are skipped, such as those of all stators of a ring before any contact.
    """
    m = z_re.size
    for r in range(n_value):
        value[r] = 0.0
    for part in range(2):
        z = z_re if part == 0 else z_im
        for k in range(0, m, 4):
            a, b, c, d = z[k], z[k + 1], z[k + 2], z[k + 3]
            if a == 0.0 and b == 0.0 and c == 0.0 and d == 0.0:
                continue
            j = part * m + k
            for r in range(n_value):
                value[r] += (
                    output[mode, j, r] * a
                    + output[mode, j + 1, r] * b
                    + output[mode, j + 2, r] * c
                    + output[mode, j + 3, r] * d
                )


@linked_sum
def take_samples(
    tables: ModeTables,
    mode: int,
    z_re: Floats,
    z_im: Floats,
    first: int,
    count: int,
    interval: float,
    measured: Measured,
) -> None:
    """Record `count` samples from `first` on in one mode; one past the record counts for extrema only.

    `interval` (s) is the time between samples, `z` the coordinates at the first one.
    """
    recorder, samples, accumulator = measured.recorder, measured.samples, measured.accumulator
    read_samples(
        tables.output,
        mode,
        z_re,
        z_im,
        first,
        count,
        recorder.value,
        samples.rotor,
        samples.axial,
        samples.lateral,
        samples.probe,
    )
    widen_extrema(
        recorder.value,
        count,
        interval,
        recorder.last,
        accumulator.lowest,
        accumulator.highest,
        accumulator.peak_lateral,
    )


@linked_sum
def read_samples(
    output: Floats,
    mode: int,
    z_re: Floats,
    z_im: Floats,
    first: int,
    count: int,
    value: Floats,
    rotor: Floats,
    axial: Floats,
    lateral: Floats,
    probe: Floats,
) -> None:
    """Fill `value` with the outputs of `count` samples, and the record with those that belong to it."""
    n_row = value.size // SAMPLES_AT_ONCE
    read_outputs(output, mode, z_re, z_im, -(-count * n_row // LANES) * LANES, value)
    store_samples(value, n_row, first, count, rotor, axial, lateral, probe)


@linked_sum
def store_samples(
    value: Floats,
    n_row: int,
    first: int,
    count: int,
    rotor: Floats,
    axial: Floats,
    lateral: Floats,
    probe: Floats,
) -> None:
    """Store in the record those of `count` samples, with `n_row` outputs each, that belong to it."""
    q = axial.shape[0]
    first_probe = N_ROTOR_ROW + 3 * q
    for j in range(min(count, rotor.shape[1] - first)):
        start = j * n_row
        rotor[VERTICAL, first + j] = value[start + VERTICAL]
        rotor[HORIZONTAL, first + j] = value[start + HORIZONTAL]
        rotor[TWIST, first + j] = value[start + TWIST]
        rotor[TWIST_ACCELERATION, first + j] = value[start + TWIST_ACCELERATION_ROW]
        for i in range(q):
            tip = start + N_ROTOR_ROW + 3 * i
            axial[i, first + j] = value[tip]
            lateral[i, first + j] = value[tip + LATERAL_ROW]
        for i in range(probe.shape[0]):
            probe[i, first + j] = value[start + first_probe + i]


@linked_sum
def widen_extrema(
    value: Floats,
    count: int,
    interval: float,
    last: Floats,
    lowest: Floats,
    highest: Floats,
    peak_lateral: Floats,
) -> None:
    """Update the extrema of signals by `count` samples, an `interval` (s) apart."""
    q = peak_lateral.size
    n_row = value.size // SAMPLES_AT_ONCE
    for k in range(3 + q):
        tip = N_ROTOR_ROW + 3 * (k - 3)
        row, rate_row = (k, 3 + k) if k < 3 else (tip + LATERAL_ROW, tip + LATERAL_RATE)
        before, rate_before = last[0, k], last[1, k]
        low, high = np.inf, -np.inf
        for j in range(count):
            now, rate = value[j * n_row + row], value[j * n_row + rate_row]
            if rate_before * rate < 0.0:
                turning = turning_value(before, rate_before, now, rate, interval)
                low = turning if turning < low else low
                high = turning if turning > high else high
            low = now if now < low else low
            high = now if now > high else high
            before, rate_before = now, rate
        last[0, k], last[1, k] = before, rate_before
        if k < 3:
            lowest[k], highest[k] = min(lowest[k], low), max(highest[k], high)
        else:
            peak_lateral[k - 3] = max(peak_lateral[k - 3], high, -low)
