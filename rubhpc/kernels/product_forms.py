"""Growth of quadratic forms of modal coordinates, by tables of their blocks (`transitions.Transitions`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.friction_spans import AT_ONCE

if TYPE_CHECKING:
    from rubhpc.kernels.friction_spans import Spans
    from rubhpc.kernels.transitions import Transitions

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@linked_sum
def forms_gained(
    transitions: Transitions, place: int, spans: Spans, which: Ints, count: int, m: int, gained: Floats
) -> None:
    """Fill `gained` with the growth of a form, from a place in `number`, in up to AT_ONCE spans of a mode.

    `which` are their places. With the difference d and the sum s of the coordinates (2, m) at the ends of a
    span, its growth is `d' P s`.
    """
    number = transitions.number
    n_block = number[place]
    place += 1
    for j in range(AT_ONCE):
        gained[j] = 0.0
    for _ in range(n_block):
        size, at = number[place], number[place + 1]
        place += 2
        n_whole = (count + 3) // 4 * 4
        for j in range(n_whole):
            change, total = transitions.source[j * size :], transitions.target[j * size :]
            if j < count:
                begun, ended = spans.begun[which[j]].reshape(2 * m), spans.ended[which[j]].reshape(2 * m)
                for k in range(size):
                    new, old = ended[number[place + k]], begun[number[place + k]]
                    change[k], total[k] = new - old, new + old
            else:
                for k in range(size):
                    change[k], total[k] = 0.0, 0.0
        rows = transitions.value[at:]
        add_products(rows, size, n_whole, transitions.source, transitions.target, gained)
        place += size


@linked_sum
def add_products(rows: Floats, size: int, count: int, change: Floats, total: Floats, gained: Floats) -> None:
    """Add products of a block (size size,) with changes and sums (count size,) to `gained`.

    Four rows are read for four spans: sums would wait for their terms, and rows be read for each span.
    """
    for k in range(0, size, 4):
        p, q = rows[k * size : (k + 1) * size], rows[(k + 1) * size : (k + 2) * size]
        r, s = rows[(k + 2) * size : (k + 3) * size], rows[(k + 3) * size : (k + 4) * size]
        for n in range(0, count, 4):
            at = n * size
            first, second = total[at : at + size], total[at + size : at + 2 * size]
            third, fourth = total[at + 2 * size : at + 3 * size], total[at + 3 * size : at + 4 * size]
            at += k
            a, b, c, d = change[at], change[at + 1], change[at + 2], change[at + 3]
            at += size
            e, f, g, h = change[at], change[at + 1], change[at + 2], change[at + 3]
            at += size
            t, u, v, w = change[at], change[at + 1], change[at + 2], change[at + 3]
            at += size
            x, y, z, o = change[at], change[at + 1], change[at + 2], change[at + 3]
            one, two, three, four = 0.0, 0.0, 0.0, 0.0
            for j in range(size):
                i, ii, iii, iv = p[j], q[j], r[j], s[j]
                one += (a * i + b * ii + c * iii + d * iv) * first[j]
                two += (e * i + f * ii + g * iii + h * iv) * second[j]
                three += (t * i + u * ii + v * iii + w * iv) * third[j]
                four += (x * i + y * ii + z * iii + o * iv) * fourth[j]
            gained[n] += one
            gained[n + 1] += two
            gained[n + 2] += three
            gained[n + 3] += four
