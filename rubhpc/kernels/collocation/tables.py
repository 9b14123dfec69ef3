"""Tables of a step: the motion at the nodes and the coordinates at the end, from coordinates and loads.

A load that is a polynomial in time moves a mode with the exponent a by

    int_0^ch exp(a (ch - t)) t^m dt = m! (ch)^(m+1) phi_(m+1)(a c h),

with phi_0 = exp and phi_(k+1)(x) = (phi_k(x) - 1/k!) / x.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.collocation.structures import (  # noqa: TC001 - part of a kernel's signature
    Bodies,
    Nodes,
    Tables,
)

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

SERIES = 1.5  # size of the argument below which phi is a series: the recurrence loses digits there
MOST_TERMS = 24
ENDED = 40.0  # fading times after which an error has faded


@linked_sum
def fill_phi(x: complex, phi: Complexes) -> None:
    """Fill `phi` with phi_0 to phi_s of x."""
    s = phi.size - 1
    phi[0] = np.exp(x)
    factorial = 1.0
    if x.real * x.real + x.imag * x.imag < SERIES * SERIES:  # an absolute value takes ten times as long
        for k in range(2, s + 1):
            factorial *= k
        total = 1.0 / factorial + 0j
        term = total
        for k in range(1, MOST_TERMS):
            term *= x / (s + k)
            total += term
            if abs(term.real) + abs(term.imag) < 1e-17 * abs(total.real):
                break
        phi[s] = total
        for k in range(s - 1, 0, -1):
            factorial /= k + 1
            phi[k] = x * phi[k + 1] + 1.0 / factorial
    else:
        inverse = 1.0 / x
        for k in range(s):
            factorial *= max(k, 1)
            phi[k + 1] = (phi[k] - 1.0 / factorial) * inverse


@linked_sum
def place_row(s: int, n_local: int, pair: int, node: int) -> int:
    """First row of `y` with the displacements of a pair at a node after the first."""
    return (pair * (2 * s - 1) + node - 1) * n_local


@linked_sum
def rate_row(s: int, n_local: int, pair: int, node: int) -> int:
    """First row of `y` with the velocities of a pair at a node after the first."""
    return (pair * (2 * s - 1) + s - 1 + (0 if node == s - 1 else node)) * n_local


@linked_sum
def bend_row(s: int, n_local: int, pair: int) -> int:
    """First row of `y` with the accelerations of a pair at the end."""
    return (pair * (2 * s - 1) + 2 * s - 2) * n_local


@linked_sum
def row_of(s: int, n_local: int, r: int, kind: int, node: int) -> int:
    """Row of `y` of a local motion at a node: its displacement, velocity or acceleration (`kind`)."""
    pair, a = r // n_local, r % n_local
    if kind == 0:
        return place_row(s, n_local, pair, node) + a
    return (rate_row(s, n_local, pair, node) if kind == 1 else bend_row(s, n_local, pair)) + a


@linked_sum
def fading(time: float, fading_time: float) -> tuple[float, float, float, float]:
    """Share at a time (s) of an error of a gap, and of its rate, at the beginning; and rates of both."""
    if time > ENDED * fading_time:
        return 0.0, 0.0, 0.0, 0.0
    x = time / fading_time
    left = math.exp(-x)
    return (1.0 + x) * left, time * left, -x / fading_time * left, (1.0 - x) * left


@linked_sum
def weights(
    nodes: Nodes, exponent: complex, time: float, part: float, phi: Complexes, weight: Complexes
) -> None:
    """Response of a mode after a time (s), a part of a step, to loads that are basis polynomials (s,)."""
    s = nodes.at.size
    fill_phi(exponent * time, phi)
    for j in range(s):
        total, scale = 0j, time
        for m in range(s):
            total += nodes.power[j, m] * scale * phi[m + 1]
            scale *= part * (m + 1)
        weight[j] = total


@linked_sum
def fill_step(bodies: Bodies, nodes: Nodes, tables: Tables, slot: int) -> None:
    """Fill the tables of one length of step."""
    n_mode, n_complex, n_row = bodies.exponent.size, bodies.n_complex, bodies.load.shape[0]
    n_x, s = n_complex + n_mode, nodes.at.size
    local, free, forced = bodies.local, tables.free[slot], tables.forced[slot]
    step = tables.tick * 2.0 ** (tables.first_level + slot)
    phi, weight = np.empty(s + 1, np.complex128), np.empty(s, np.complex128)
    moved = np.empty((s * n_row, n_x))
    for i in range(s):
        a, b, c, d = fading(nodes.at[i] * step, tables.fading_time)
        tables.fade[slot, i, 0], tables.fade[slot, i, 1] = a, b
        tables.fade[slot, i, 2], tables.fade[slot, i, 3] = c, d
    for i in range(1, s):
        is_last = i == s - 1
        n_kind = 3 if is_last else 2  # displacements, velocities, accelerations
        for k in range(n_mode):
            weights(nodes, bodies.exponent[k], step * nodes.at[i], nodes.at[i], phi, weight)
            turn = phi[0]
            if is_last:
                tables.turn[slot, k] = turn
            re = k if k < n_complex else n_complex + k
            for j in range(s):
                for r in range(n_row):
                    value = weight[j] * bodies.load[r, k]
                    moved[j * n_row + r, re] = value.real
                    if k < n_complex:
                        moved[j * n_row + r, n_complex + k] = value.imag
            for kind in range(n_kind):
                for r in range(n_row):
                    at, row = kind * n_row + r, row_of(s, bodies.n_local, r, kind, i)
                    if k < n_complex:
                        a, b = local[at, k], local[at, n_complex + k]
                        free[row, k] = a * turn.real + b * turn.imag
                        free[row, n_complex + k] = b * turn.real - a * turn.imag
                    else:
                        free[row, re] = local[at, re] * turn.real
        for kind in range(n_kind):
            for col in range(s * n_row):
                for r in range(n_row):
                    total = 0.0
                    for k in range(n_x):
                        total += moved[col, k] * local[kind * n_row + r, k]
                    if kind == 2 and col >= (s - 1) * n_row:
                        total += bodies.compliance[r, col - (s - 1) * n_row]
                    forced[col, row_of(s, bodies.n_local, r, kind, i)] = total
        if is_last:
            for col in range(s * n_row):
                for k in range(n_x):
                    tables.end[slot, col, k] = moved[col, k]
    tables.is_filled[slot] = True


@linked_sum
def turn_freely(n_complex: int, turn: Complexes, x: Floats, after: Floats) -> None:
    """Coordinates after a free motion with the factors `turn` (nm,) of the modes."""
    for k in range(n_complex):
        a, b, c, d = x[k], x[n_complex + k], turn[k].real, turn[k].imag
        after[k], after[n_complex + k] = c * a - d * b, c * b + d * a
    for k in range(n_complex, turn.size):
        after[n_complex + k] = turn[k].real * x[n_complex + k]


@linked_sum
def end_of_step(bodies: Bodies, tables: Tables, slot: int, x: Floats, load: Floats, after: Floats) -> None:
    """Coordinates at the end of a step."""
    turn_freely(bodies.n_complex, tables.turn[slot], x, after)
    end = tables.end[slot]
    for col in range(load.size):
        f = load[col]
        if f != 0.0:
            row = end[col]
            for k in range(after.size):
                after[k] += f * row[k]


@linked_sum
def within_step(
    bodies: Bodies,
    nodes: Nodes,
    step: float,
    part: float,
    x: Floats,
    load: Floats,
    turn: Complexes,
    after: Floats,
) -> None:
    """Coordinates after a part of a step (s) under the loads of the whole; fills the factors `turn` (nm,)."""
    n_complex, n_row, s, power = bodies.n_complex, bodies.load.shape[0], nodes.at.size, nodes.power
    phi, monomial = np.empty(s + 1, np.complex128), np.zeros((s, n_row))
    time, scale, n_loaded, loaded = step * part, step * part, 0, np.empty(n_row, np.int64)
    for r in range(n_row):
        largest = 0.0
        for j in range(s):
            largest = max(largest, abs(load[j * n_row + r]))
        if largest > 0.0:
            loaded[n_loaded] = r
            n_loaded += 1
    for m in range(s):
        for j in range(s):
            factor = power[j, m] * scale
            for p in range(n_loaded):
                monomial[m, p] += factor * load[j * n_row + loaded[p]]
        scale *= part * (m + 1)
    for k in range(turn.size):
        fill_phi(bodies.exponent[k] * time, phi)
        turn[k] = phi[0]
        total = 0j
        for m in range(s):
            pushed = 0j
            for p in range(n_loaded):
                pushed += bodies.load[loaded[p], k] * monomial[m, p]
            total += pushed * phi[m + 1]
        c, d = phi[0].real, phi[0].imag
        if k < n_complex:
            a, b = x[k], x[n_complex + k]
            after[k], after[n_complex + k] = c * a - d * b + total.real, c * b + d * a + total.imag
        else:
            after[n_complex + k] = c * x[n_complex + k] + total.real
