"""Samples of spans between events under set-valued friction, in one contact mode, read several at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.contact_modes import SAMPLES_AT_ONCE
from rubhpc.kernels.friction_spans import ROWS_AT_ONCE
from rubhpc.kernels.sampling import store_samples

if TYPE_CHECKING:
    from rubhpc.kernels.accumulators import Samples
    from rubhpc.kernels.friction_spans import Spans
    from rubhpc.kernels.transitions import Transitions

Floats = NDArray[np.float64]


@linked_sum
def read_noted(
    transitions: Transitions,
    mode: int,
    n_noted: int,
    used: int,
    n_row: int,
    first_sample: int,
    spans: Spans,
    samples: Samples,
) -> None:
    """Read the first samples of `spans.sample`, with the coordinates `spans.point`, the first ones used."""
    m = spans.point.shape[2]
    rows, width = transitions.value[transitions.output[mode] :], spans.read.size // SAMPLES_AT_ONCE
    read_rows(rows, width, used, m, spans.point, n_noted, spans.read)
    for j in range(n_noted):
        sample, value = spans.sample[j], spans.read[j * width :]
        store_samples(value, n_row, sample, 1, samples.rotor, samples.axial, samples.lateral, samples.probe)
        place = (sample - first_sample) * n_row
        for r in range(n_row):
            spans.value[place + r] = value[r]


@linked_sum
def read_rows(rows: Floats, width: int, used: int, m: int, point: Floats, count: int, value: Floats) -> None:
    """Fill `value` (n_point width,) with output rows (width 2 m,) at `count` points, two or one more.

    Four rows are read for two points: sums would wait for their terms, and rows be read for each point.
    """
    for j in range(0, count, 2):
        for r in range(0, width, ROWS_AT_ONCE):
            a, b, c, d, e, f, g, h = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for part in range(2):
                at = (2 * r + part) * m
                first, second = rows[at : at + used], rows[at + 2 * m : at + 2 * m + used]
                third, fourth = rows[at + 4 * m : at + 4 * m + used], rows[at + 6 * m : at + 6 * m + used]
                here, there = point[j, part], point[j + 1, part]
                for k in range(used):
                    x, y = here[k], there[k]
                    a += first[k] * x
                    b += second[k] * x
                    c += third[k] * x
                    d += fourth[k] * x
                    e += first[k] * y
                    f += second[k] * y
                    g += third[k] * y
                    h += fourth[k] * y
            one, other = value[j * width + r :], value[(j + 1) * width + r :]
            one[0], one[1], one[2], one[3] = a, b, c, d
            other[0], other[1], other[2], other[3] = e, f, g, h
