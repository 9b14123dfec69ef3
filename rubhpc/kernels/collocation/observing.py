"""Records of the collocation integrator: samples, contact forces and energies of flights and steps.

In flight, signals are rows of the coordinates, and energies are quadratic forms of them. In a step, signals
are polynomials through their values at the nodes, and their rates at both ends; energies are quadratures.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels._struct import Struct
from rubhpc.kernels.accumulators import (
    DAMPING_LOSS,
    IMPACT_LOSS,
    UNBALANCE_WORK,
    observe_force,
    observe_rub,
    observe_sense,
)
from rubhpc.kernels.case_progress import Clock, Progress  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.collocation.structures import (
    BACKWARD,
    FORWARD,
    FRICTION,
    NORMAL,
    RATE,
    SLIP,
    STICKING,
    Bodies,
    Nodes,
    Solution,
    Tables,
)
from rubhpc.kernels.collocation.tables import turn_freely, weights
from rubhpc.kernels.laws import LAGRANGE
from rubhpc.kernels.sampling import Measured, store_samples, widen_extrema

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Ints = NDArray[np.int64]


N_LOOK = 8  # parts of a step in which the least slip is looked for


class Signals(Struct):
    """Output rows, in the order of `contact_modes.N_ROTOR_ROW`, and rows of powers; o rows, k slots.

    `smooth` rows are displacements, known with their rates; `rough` rows contain accelerations.
    """

    value: Floats  # (o, nx), from the coordinates
    direct: Floats  # (o, R), from the loads
    smooth: Ints  # (a,), their places
    rate_place: Ints  # (a,), where the rate of a smooth row is recorded, or -1
    rate: Floats  # (a, nx)
    rate_direct: Floats  # (a, R)
    rough: Ints  # (b,)
    power: Floats  # (p, nx), factors of powers
    left: Ints  # (w,), factors of each power
    right: Ints
    sign: Floats  # (w,)
    n_loss: int  # the first powers are losses by damping, the others works of the unbalance
    gained: Floats  # (2, nx, nx), quadratic forms whose growth is loss, work, J
    drift: Floats  # (2, nx, nx), quadratic forms that grow with the time, W
    is_filled: NDArray[np.bool_]  # (k,)
    # (k, n, nx): smooth rows, rough ones and powers, node by node after the first; then rates at the end
    free: Floats
    forced: Floats  # (k, s R, n)


class Seen(Struct):
    """Work space of a record."""

    begun: Floats  # (nx,), coordinates where a flight begins
    moving: Floats  # (nx,)
    other: Floats  # (nx,)
    node: Floats  # (o, s), values of output rows at the nodes
    end_rate: Floats  # (2, a), rates of smooth rows at both ends
    factor: Floats  # (s, p), factors of powers at the nodes
    read: Floats  # (n,), rows of `Signals.free`
    part: Floats  # (s,), a polynomial on a part of a step
    measured: Measured


@linked_sum
def fill_signals(bodies: Bodies, nodes: Nodes, tables: Tables, signals: Signals, slot: int) -> None:
    """Fill the tables of signals for one length of step."""
    n_mode, n_complex, n_row, s = bodies.exponent.size, bodies.n_complex, bodies.load.shape[0], nodes.at.size
    n_smooth, n_rough, n_power = signals.smooth.size, signals.rough.size, signals.power.shape[0]
    step = tables.tick * 2.0 ** (tables.first_level + slot)
    phi, weight = np.empty(s + 1, np.complex128), np.empty(s, np.complex128)
    turn, row, turned = (
        np.empty(n_mode, np.complex128),
        np.empty(n_complex + n_mode),
        np.empty(n_complex + n_mode),
    )
    moved = np.empty((s * n_row, n_complex + n_mode))
    per_node = n_smooth + n_rough + n_power
    for i in range(1, s):
        for k in range(n_mode):
            weights(nodes, bodies.exponent[k], step * nodes.at[i], nodes.at[i], phi, weight)
            turn[k] = phi[0]
            re = k if k < n_complex else n_complex + k
            for j in range(s):
                for r in range(n_row):
                    value = weight[j] * bodies.load[r, k]
                    moved[j * n_row + r, re] = value.real
                    if k < n_complex:
                        moved[j * n_row + r, n_complex + k] = value.imag
        n_kind = n_smooth if i == s - 1 else 0  # rates at the end
        for r in range(per_node + n_kind):
            at = (i - 1) * per_node + r
            is_direct, direct = False, signals.direct[0]
            if r < n_smooth:
                row[:] = signals.value[signals.smooth[r]]
            elif r < n_smooth + n_rough:
                row[:] = signals.value[signals.rough[r - n_smooth]]
                is_direct, direct = True, signals.direct[signals.rough[r - n_smooth]]
            elif r < per_node:
                row[:] = signals.power[r - n_smooth - n_rough]
            else:
                row[:] = signals.rate[r - per_node]
                is_direct, direct = True, signals.rate_direct[r - per_node]
            for k in range(n_complex):
                a, b, c, d = row[k], row[n_complex + k], turn[k].real, turn[k].imag
                turned[k], turned[n_complex + k] = a * c + b * d, b * c - a * d
            for k in range(n_complex, n_mode):
                turned[n_complex + k] = row[n_complex + k] * turn[k].real
            for k in range(row.size):
                signals.free[slot, at, k] = turned[k]
            for col in range(s * n_row):
                total = 0.0
                for k in range(row.size):
                    total += moved[col, k] * row[k]
                if is_direct and col >= i * n_row and col < (i + 1) * n_row:
                    total += direct[col - i * n_row]
                signals.forced[slot, col, at] = total
    signals.is_filled[slot] = True


@linked_sum
def value_at(nodes: Nodes, values: Floats, x: float) -> float:
    """Polynomial with the values (s,) at the nodes, at x."""
    s, total = nodes.at.size, 0.0
    for m in range(s - 1, -1, -1):
        coefficient = 0.0
        for j in range(s):
            coefficient += nodes.power[j, m] * values[j]
        total = total * x + coefficient
    return total


@linked_sum
def integral_of(nodes: Nodes, values: Floats, a: float, b: float) -> float:
    """Integral from a to b of the polynomial with the values (s,) at the nodes."""
    x, y = 0.0, 0.0
    for m in range(nodes.at.size - 1, -1, -1):
        coefficient = 0.0
        for j in range(nodes.at.size):
            coefficient += nodes.power[j, m] * values[j]
        coefficient /= m + 1
        x = x * a + coefficient
        y = y * b + coefficient
    return y * b - x * a


@linked_sum
def take_row_sample(n_row: int, clock: Clock, progress: Progress, measured: Measured) -> None:
    """Record the outputs in the recorder as the next sample."""
    recorder, samples, accumulator = measured.recorder, measured.samples, measured.accumulator
    i_sample, interval = progress.next_sample, clock.tick * (1 << clock.sample_level)
    store_samples(
        recorder.value, n_row, i_sample, 1, samples.rotor, samples.axial, samples.lateral, samples.probe
    )
    widen_extrema(
        recorder.value,
        1,
        interval,
        recorder.last,
        accumulator.lowest,
        accumulator.highest,
        accumulator.peak_lateral,
    )
    progress.next_sample = i_sample + 1


@linked_sum
def read_rows(rows: Floats, x: Floats, value: Floats) -> None:
    """Values of rows (n, nx) at the coordinates x."""
    for r in range(rows.shape[0]):
        row, total = rows[r], 0.0
        for k in range(x.size):
            total += row[k] * x[k]
        value[r] = total


@linked_sum
def form_of(form: Floats, x: Floats) -> float:
    """Quadratic form of the coordinates x."""
    total = 0.0
    for k in range(x.size):
        row, along = form[k], 0.0
        for j in range(x.size):
            along += row[j] * x[j]
        total += along * x[k]
    return total


@linked_sum
def record_flight(
    bodies: Bodies,
    signals: Signals,
    power: Complexes,
    clock: Clock,
    begun_tick: int,
    tick: int,
    x: Floats,
    progress: Progress,
    seen: Seen,
) -> None:
    """Record a flight from `begun_tick`, with the coordinates `seen.begun`, to `tick`, with x."""
    level, measured, moving, other = clock.sample_level, seen.measured, seen.moving, seen.other
    accumulator, time = measured.accumulator, (tick - begun_tick) * clock.tick
    n_row, is_first = signals.value.shape[0], True
    while progress.next_sample << level < tick:
        if is_first:
            after = ((progress.next_sample << level) - begun_tick) * clock.tick
            turn = np.exp(bodies.exponent * after)
            turn_freely(bodies.n_complex, turn, seen.begun, moving)
            is_first = False
        else:
            turn_freely(bodies.n_complex, power[level], moving, other)
            moving[:] = other
        read_rows(signals.value, moving, measured.recorder.value)
        take_row_sample(n_row, clock, progress, measured)
    for kind in range(2):
        gained = form_of(signals.gained[kind], x) - form_of(signals.gained[kind], seen.begun)
        gained += time * form_of(signals.drift[kind], seen.begun)
        accumulator.energy[DAMPING_LOSS if kind == 0 else UNBALANCE_WORK] += gained


@linked_sum
def record_instant(
    bodies: Bodies,
    signals: Signals,
    clock: Clock,
    force: Floats,
    x: Floats,
    progress: Progress,
    seen: Seen,
    load: Floats,
) -> None:
    """Record the sample at the coordinates x, under the loads of the instant, the first R of `load`."""
    value, direct = seen.measured.recorder.value, signals.direct
    read_rows(signals.value, x, value)
    for r in range(direct.shape[0]):
        for a in range(direct.shape[1]):
            value[r] += direct[r, a] * load[a]
    take_row_sample(direct.shape[0], clock, progress, seen.measured)


@linked_sum
def record_step(
    bodies: Bodies,
    nodes: Nodes,
    tables: Tables,
    signals: Signals,
    slot: int,
    clock: Clock,
    taken: int,
    state: Ints,
    force: Floats,
    n_closed: int,
    x: Floats,
    progress: Progress,
    solution: Solution,
    seen: Seen,
) -> None:
    """Record the first ticks `taken` of a step from the coordinates x."""
    read_step(bodies, nodes, tables, signals, slot, x, solution, seen)
    s, level, step = nodes.at.size, clock.sample_level, tables.tick * 2.0 ** (tables.first_level + slot)
    ticks = 1 << (tables.first_level + slot)
    value, n_output, tick = seen.measured.recorder.value, signals.value.shape[0], progress.tick
    while progress.next_sample << level < tick + taken:
        at = ((progress.next_sample << level) - tick) / ticks
        for r in range(signals.smooth.size):
            place, total, slope = signals.smooth[r], 0.0, 0.0
            for m in range(s + 1, -1, -1):
                row = nodes.hermite[m]
                coefficient = step * (row[s] * seen.end_rate[0, r] + row[s + 1] * seen.end_rate[1, r])
                for j in range(s):
                    coefficient += row[j] * seen.node[place, j]
                slope = slope * at + total
                total = total * at + coefficient
            value[place] = total
            if signals.rate_place[r] >= 0:
                value[signals.rate_place[r]] = slope / step
        for r in range(signals.rough.size):
            value[signals.rough[r]] = value_at(nodes, seen.node[signals.rough[r]], at)
        take_row_sample(n_output, clock, progress, seen.measured)
    for c in range(n_closed):
        record_contact(
            bodies,
            nodes,
            solution.closed[c],
            clock,
            step,
            taken,
            ticks,
            state,
            force,
            progress,
            solution,
            seen,
        )
    record_powers(nodes, signals, step, taken / ticks, seen)


@linked_sum
def read_step(
    bodies: Bodies,
    nodes: Nodes,
    tables: Tables,
    signals: Signals,
    slot: int,
    x: Floats,
    solution: Solution,
    seen: Seen,
) -> None:
    """Read signals and factors of powers at the nodes of a step."""
    s, n_row = nodes.at.size, bodies.load.shape[0]
    n_smooth, n_rough, n_power = signals.smooth.size, signals.rough.size, signals.power.shape[0]
    per_node, load, read, forced = (
        n_smooth + n_rough + n_power,
        solution.load,
        seen.read,
        signals.forced[slot],
    )
    read_rows(signals.free[slot], x, read)
    for c in range(load.size):
        f, row = load[c], forced[c]
        if f != 0.0:
            for r in range(read.size):
                read[r] += f * row[r]
    for r in range(n_smooth):
        row, rate, total, slope = signals.value[signals.smooth[r]], signals.rate[r], 0.0, 0.0
        for k in range(x.size):
            total += row[k] * x[k]
            slope += rate[k] * x[k]
        for a in range(n_row):
            slope += signals.rate_direct[r, a] * load[a]
        seen.node[signals.smooth[r], 0], seen.end_rate[0, r] = total, slope
        seen.end_rate[1, r] = read[(s - 1) * per_node + r]
        for i in range(1, s):
            seen.node[signals.smooth[r], i] = read[(i - 1) * per_node + r]
    for r in range(n_rough):
        place, total = signals.rough[r], 0.0
        row, direct = signals.value[place], signals.direct[place]
        for k in range(x.size):
            total += row[k] * x[k]
        for a in range(n_row):
            total += direct[a] * load[a]
        seen.node[place, 0] = total
        for i in range(1, s):
            seen.node[place, i] = read[(i - 1) * per_node + n_smooth + r]
    for r in range(n_power):
        row, total = signals.power[r], 0.0
        for k in range(x.size):
            total += row[k] * x[k]
        seen.factor[0, r] = total
        for i in range(1, s):
            seen.factor[i, r] = read[(i - 1) * per_node + n_smooth + n_rough + r]


@linked_sum
def record_powers(nodes: Nodes, signals: Signals, step: float, taken: float, seen: Seen) -> None:
    """Add the works of damping and unbalance over a part of a step."""
    s, part, energy = nodes.at.size, seen.part, seen.measured.accumulator.energy
    for kind in range(2):
        first, end = (0, signals.n_loss) if kind == 0 else (signals.n_loss, signals.sign.size)
        for i in range(s):
            total, factor = 0.0, seen.factor[i]
            for w in range(first, end):
                total += signals.sign[w] * factor[signals.left[w]] * factor[signals.right[w]]
            part[i] = total
        energy[DAMPING_LOSS if kind == 0 else UNBALANCE_WORK] += step * integral_of(nodes, part, 0.0, taken)


@linked_sum
def record_contact(
    bodies: Bodies,
    nodes: Nodes,
    i: int,
    clock: Clock,
    step: float,
    taken: int,
    ticks: int,
    state: Ints,
    force: Floats,
    progress: Progress,
    solution: Solution,
    seen: Seen,
) -> None:
    """Add the force and the slip of a closed pair over the first ticks `taken` of a step."""
    s, part, samples, accumulator = nodes.at.size, seen.part, seen.measured.samples, seen.measured.accumulator
    n, t, share = force[i, NORMAL], force[i, FRICTION], taken / ticks
    length, begin = taken * clock.tick, progress.tick * clock.tick
    # The force of each interval between samples.
    level, done, interval = clock.sample_level, 0, clock.tick * (1 << clock.sample_level)
    while done < taken:
        i_sample = (progress.tick + done) >> level
        until = min(taken, ((i_sample + 1) << level) - progress.tick)
        if i_sample < samples.force.shape[1]:
            impulse = step * integral_of(nodes, n, done / ticks, until / ticks)
            samples.force[i, i_sample] += impulse / interval
            if samples.push.shape[0] > 0:
                for k in range(4):
                    fill_push(bodies, s, i, k, n, t, solution, part)
                    impulse = step * integral_of(nodes, part, done / ticks, until / ticks)
                    samples.push[i, k, i_sample] += impulse / interval
        done = until
    if bodies.radius[i] < 0.0:
        accumulator.turned[i] += turn_of(nodes, i, share, solution, part)
    accumulator.contact_time[i] += length
    before, first = value_at(nodes, n, 0.0), 0.0
    for k in range(1, s):
        at = nodes.at[k] * share
        after = value_at(nodes, n, at)
        impulse = step * integral_of(nodes, n, first, at)
        observe_force(i, begin + first * step, (at - first) * step, impulse, before, after, accumulator)
        before, first = after, at
    if state[i] == STICKING:
        accumulator.stick_time[i] += length
    for k in range(s):
        slip = solution.seen[i * s + k, SLIP]
        if state[i] != STICKING and nodes.at[k] <= share and slip != 0.0:
            sense = FORWARD if slip > 0.0 else BACKWARD
            observe_sense(i, state[i] if bodies.may_stick else sense, accumulator)  # at rest slip is rounding
    drive = bodies.rim_speed[i] * step * integral_of(nodes, t, 0.0, share)
    worked = 0.0
    for k in range(s):
        part[k] = solution.seen[i * s + k, SLIP]
    lowest = part[0]
    for k in range(1, N_LOOK + 1):
        lowest = min(lowest, value_at(nodes, part, share * k / N_LOOK))
    if state[i] != STICKING:
        for k in range(s):
            part[k] *= t[k]
        worked = step * integral_of(nodes, part, 0.0, share)
    if state[i] == STICKING or (state[i] == FORWARD and bodies.may_stick):  # below zero it is an error
        lowest = max(0.0, lowest) if state[i] == FORWARD else 0.0
    accumulator.least_slip[i] = min(accumulator.least_slip[i], lowest)
    observe_rub(i, step * integral_of(nodes, n, 0.0, share), drive, worked, accumulator)
    if bodies.normal_law[i] != LAGRANGE:
        for k in range(s):
            part[k] = n[k] * solution.seen[i * s + k, RATE]
        accumulator.energy[IMPACT_LOSS] -= step * integral_of(nodes, part, 0.0, share)


@linked_sum
def push_of(bodies: Bodies, i: int, row: int, k: int, n: float, t: float, solution: Solution) -> float:
    """Item k of `Samples.push` of pair i by its forces n and t, N, in a row of the solution."""
    along, across = n * solution.unit[row, 0], n * solution.unit[row, 1]
    if k >= 2:
        along, across = along - t * solution.unit[row, 1], across + t * solution.unit[row, 0]
    return float(bodies.space[i, k % 2, 0] * along + bodies.space[i, k % 2, 1] * across)


@linked_sum
def fill_push(
    bodies: Bodies, s: int, i: int, k: int, n: Floats, t: Floats, solution: Solution, part: Floats
) -> None:
    """Fill `part` (s,) with it at the nodes, by the forces (s,) there."""
    for j in range(s):
        part[j] = push_of(bodies, i, i * s + j, k, n[j], t[j], solution)


@linked_sum
def turn_of(nodes: Nodes, i: int, share: float, solution: Solution, part: Floats) -> float:
    """Angle, rad, by which the normal of pair i turns in a part of a step."""
    s = nodes.at.size
    for k in range(s):
        part[k] = solution.unit[i * s + k, 0]
    along = value_at(nodes, part, share)
    for k in range(s):
        part[k] = solution.unit[i * s + k, 1]
    across = value_at(nodes, part, share)
    a, b = solution.unit[i * s, 0], solution.unit[i * s, 1]
    return math.atan2(a * across - b * along, a * along + b * across)


@linked_sum
def record_impulses(
    bodies: Bodies, s: int, clock: Clock, progress: Progress, solution: Solution, seen: Seen
) -> None:
    """Add the impulses of an event, with the local motions `start` after it and the speeds before it."""
    samples, accumulator = seen.measured.samples, seen.measured.accumulator
    interval = clock.tick * (1 << clock.sample_level)
    i_sample = progress.tick >> clock.sample_level
    for i in range(bodies.radius.size):
        n, t = solution.impulse[i, NORMAL], solution.impulse[i, FRICTION]
        if n == 0.0 and t == 0.0:
            continue
        rate = 0.5 * (solution.speed[i, NORMAL] + solution.seen[i * s, RATE])
        before, after = solution.speed[i, FRICTION], solution.seen[i * s, SLIP]
        slip = 0.5 * (before + after)
        if i_sample < samples.force.shape[1]:
            samples.force[i, i_sample] += n / interval
            for k in range(4 if samples.push.shape[0] > 0 else 0):
                samples.push[i, k, i_sample] += push_of(bodies, i, i * s, k, n, t, solution) / interval
        observe_force(i, progress.tick * clock.tick, 0.0, n, 0.0, 0.0, accumulator)
        accumulator.least_slip[i] = min(accumulator.least_slip[i], before, after)
        observe_rub(i, n, t * bodies.rim_speed[i], t * slip, accumulator)
        accumulator.energy[IMPACT_LOSS] -= n * rate
