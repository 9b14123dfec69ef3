"""Linear theory about a stable periodic motion: how cases near it go on, period by period."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum, linked_sum
from rubhpc.kernels._struct import Struct
from rubhpc.kernels.contact_modes import add_rows
from rubhpc.kernels.mode_change import product
from rubhpc.kernels.small_changes import add_rows_twice

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ROUNDING = float(np.finfo(float).eps)
MOST_SQUARINGS = 60  # of the monodromy matrix, until nothing is left of it
NEUTRAL = 1e12  # times the energy of the first period, in all periods: what does not decay
FIRST, LAST, BEGINS, ENDS = range(4)  # items of `Watched.parts`


class Theory(Struct):
    """A monodromy matrix (m, m) of rank r, `M = sum over a of span[a] reading[a]^T`.

    After one period a distance d is in the space of the `span`, at `y = reading @ d`, and goes on by
    `y = B y`, with `B = reading @ span^T`.
    """

    span: Floats  # (r, m)
    reading: Floats  # (r, m)
    onward: Floats  # (r, r), B, transposed
    sums: Floats  # (r, r), S: energies of all periods to come are y' S y


@jit_sum
def fill_theory(monodromy: Floats, scale: Floats, energy: Floats, rooms: Floats) -> tuple[int, bool]:
    """Fill in the theory of a monodromy matrix (m, m): its rank, and whether disturbances decay.

    What a column has outside of the span of others, if that is less than roundings of the largest, is none.
    Where a multiplier lies outside of the unit circle, or on it, the sums end with the first that shows it.

    Parameters
    ----------
    rooms : (8, m, m)
        The first four are filled in: what a `Theory` has, in their leading rows and columns.
    scale : (m,)
        What the components of motions are multiplied with, to be compared with one another.
    energy : (m,)
        Weights of their squares.
    """
    span, reading, onward, sums = rooms[0], rooms[1], rooms[2], rooms[3]
    power, turned, moved, more = rooms[4], rooms[5], rooms[6], rooms[7]
    rank, first = find_span(monodromy, scale, span, reading, power, turned), 0.0
    for a in range(rank):
        for b in range(rank):
            power[a, b] = product(reading[a], span[b])
            onward[b, a] = power[a, b]
            total = 0.0
            for i in range(energy.size):
                total += energy[i] * span[a, i] * span[b, i]
            sums[a, b] = total
        first += sums[a, a]
    is_stable = True
    for _ in range(MOST_SQUARINGS):
        for a in range(rank):
            for b in range(rank):
                turned[b, a] = power[a, b]
        multiply(rank, sums, power, moved)
        multiply(rank, turned, moved, more)
        added, largest, total = 0.0, 0.0, 0.0
        for a in range(rank):
            for b in range(rank):
                sums[a, b] += more[a, b]
            added, largest, total = max(added, more[a, a]), max(largest, sums[a, a]), total + sums[a, a]
        is_stable = total <= NEUTRAL * first
        if added <= ROUNDING * largest or not is_stable:  # no entry is larger than those of the diagonal
            break
        multiply(rank, power, power, moved)
        for a in range(rank):
            for b in range(rank):
                power[a, b] = moved[a, b]
    return rank, is_stable


@linked_sum
def find_span(
    monodromy: Floats, scale: Floats, span: Floats, reading: Floats, scaled: Floats, left: Floats
) -> int:
    """Fill in `span` and `reading` by Gram and Schmidt's method with exchanges; returns the rank."""
    m = scale.size
    for j in range(m):
        for i in range(m):
            scaled[j, i] = scale[i] * monodromy[i, j] / scale[j]
            left[j, i] = scaled[j, i]
    first, rank = 0.0, 0
    while rank < m:
        largest, chosen = 0.0, 0
        for j in range(m):
            square = product(left[j], left[j])
            if square > largest:
                largest, chosen = square, j
        if rank == 0:
            first = largest
        if largest <= ROUNDING**2 * first:
            break
        unit = span[rank]
        for i in range(m):
            unit[i] = left[chosen, i]
        for a in range(rank):  # once more, for what was lost by rounding
            along = product(unit, span[a])
            for i in range(m):
                unit[i] -= along * span[a, i]
        size = np.sqrt(product(unit, unit))
        if not size > ROUNDING * np.sqrt(first):
            left[chosen, :] = 0.0
            continue
        for i in range(m):
            unit[i] /= size
        for j in range(m):
            reading[rank, j] = product(unit, scaled[j]) * scale[j]
            along = product(unit, left[j])
            for i in range(m):
                left[j, i] -= along * unit[i]
        rank += 1
    for a in range(rank):
        for i in range(m):
            span[a, i] /= scale[i]
    return rank


@linked_sum
def multiply(n: int, first: Floats, second: Floats, found: Floats) -> None:
    """Product of the leading (n, n) parts of two matrices."""
    for i in range(n):
        for j in range(n):
            found[i, j] = 0.0
    for i in range(0, n - 1, 2):
        add_rows_twice(second, first[i, :n], first[i + 1, :n], found[i, :n], found[i + 1, :n])
    if n % 2 == 1:
        add_rows(second, first[n - 1, :n], found[n - 1, :n])


class Watched(Struct):
    """Gaps and forces at t times of a periodic motion, in s parts, each of one function along a piece."""

    parts: Ints  # (s, 4), first time and that after the last, and whether it vanishes at each of these ends
    value: Floats  # (t,), on the motion itself
    change: Floats  # (m, t), by the motion at the section
    onward: Floats  # (r, t), by y


@jit_sum
def keeps_contacts(
    theory: Theory, watched: Watched, apart: Floats, n_period: int, least: float, work: Floats
) -> bool:
    """Whether a case at a distance (m,) keeps the contacts of the periodic motion.

    Looked at are so many periods, or those until the square of the distance (`Theory.sums`) is `least`.

    Parameters
    ----------
    work : (t + 2 r,)
        Work space.
    """
    n_time, rank = watched.value.size, theory.sums.shape[0]
    value, y, moved = work[:n_time], work[n_time : n_time + rank], work[n_time + rank :]
    for period in range(n_period):
        for i in range(n_time):
            value[i] = watched.value[i]
        if period == 0:
            add_rows(watched.change, apart, value)
        else:
            add_rows(watched.onward, y, value)
        for part in range(watched.parts.shape[0]):
            first, last, begins, ends = (
                watched.parts[part, FIRST],
                watched.parts[part, LAST],
                watched.parts[part, BEGINS],
                watched.parts[part, ENDS],
            )
            if not is_kept(value[first:last], begins != 0, ends != 0):
                return False
        if period == 0:
            for a in range(rank):
                y[a] = product(theory.reading[a], apart)
        else:
            for a in range(rank):
                moved[a] = 0.0
            add_rows(theory.onward, y, moved)
            for a in range(rank):
                y[a] = moved[a]
        for a in range(rank):
            moved[a] = 0.0
        add_rows(theory.sums, y, moved)
        if product(y, moved) <= least:
            break
    return True


@linked_sum
def is_kept(value: Floats, begins: bool, ends: bool) -> bool:
    """Whether values along a piece are positive, but for times by the ends where the function vanishes."""
    n = value.size
    first, last, n_positive = n, 0, 0
    for i in range(n):
        if value[i] > 0.0:
            first, last, n_positive = min(first, i), i + 1, n_positive + 1
    return n_positive > 0 and n_positive == last - first and (first == 0 or begins) and (last == n or ends)
