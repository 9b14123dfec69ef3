"""The paper's integrator: central difference with contact by Lagrange multipliers (Eqs. 20-24)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit, linked
from rubhpc.kernels._struct import Struct
from rubhpc.kernels.accumulators import (
    DAMPING_LOSS,
    IMPACT_LOSS,
    STEP,
    TWIST_ACCELERATION,
    UNBALANCE_WORK,
    Accumulator,
    Samples,
    centred,
    observe_contact,
    observe_motion,
    observe_rub,
    observe_solution,
    take_sample,
)
from rubhpc.kernels.central_difference.contact_forces import solve_contact
from rubhpc.kernels.central_difference.linear import Linear, circulatory_power, free_velocity, turning_force
from rubhpc.kernels.complementarity import UNSOLVED
from rubhpc.kernels.contact_pairs import (
    N_DEGREE,
    Pairs,
    V,
    W,
    Workspace,
    fill_start,
    is_any_closed,
    rim_sense,
)
from rubhpc.kernels.laws import is_bouncing, is_penalty, is_plain

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FINISHED, DIVERGED, CONTACT_UNSOLVED = range(3)
DECAYED = 1e-150  # m, m/s, rad or rad/s


class Stepper(Struct):
    """Bodies of one rig and speed, and the steps in which a case of them is advanced."""

    linear: Linear
    spin: float  # rad/s
    step: float  # s
    samples_per_revolution: int
    displacement_limit: float  # m, of the output node or of a rim, beyond which a case has diverged
    output_row: Ints  # (3,), of vertical, horizontal and torsional displacement of the output node; -1: held
    probe: Floats  # (3, n_probe, n_dof), weights of displacements, velocities and accelerations


@linked
def apply_contact(
    start: Ints,
    inverse: Floats,
    row: Ints,
    block: Ints,
    force_direction: Floats,
    force: Floats,
    step: float,
    share: Floats,
    motion: Floats,
) -> None:
    """Add the change of velocity by the contact forces of a step, the correction of Eqs. 23 and 24.

    `share` (q,) is the fraction added to `motion`; 1 for velocities.
    """
    for i in range(force.size):
        if force[i] > 0.0 and share[i] != 0.0:
            for a in range(N_DEGREE):
                b = block[i, a]
                if b >= 0 and force_direction[i, a] != 0.0:
                    impulse = share[i] * step * force_direction[i, a] * force[i]
                    # Row of the transpose: the block's response to a force on this degree.
                    response = inverse[b, row[i, a] - start[b]]
                    target = motion[start[b] : start[b + 1]]
                    for k in range(target.size):
                        target[k] += impulse * response[k]


@jit
def advance(
    stepper: Stepper,
    pairs: Pairs,
    steps_per_sample: int,
    first_sample: int,
    last_sample: int,
    is_recorded: bool,
    state: Floats,
    work: Workspace,
    scratch: Floats,
    samples: Samples,
    accumulator: Accumulator,
    reached: Ints,
) -> int:
    """Advance a case over samples `first_sample` to `last_sample` (excluded).

    The shaft's angle is `2 pi i / samples_per_revolution` at sample i and is integrated from there, so that
    no phase error accumulates. One step solves Eq. 20 for every block, finds the contact forces, and
    corrects.

    Parameters
    ----------
    steps_per_sample : int
        Steps that fill the interval between two samples.
    is_recorded : bool
        Whether to fill `samples` (at index i - first recorded sample = i) and `accumulator`.
    state : (2, n_dof), m and m/s (rad and rad/s)
        Displacement, and velocity half a step earlier; advanced in place.
    scratch : (3, n_dof)
        Work space.
    reached : (1,)
        The last sample reached by a case that had to stop.

    Returns
    -------
    int
        FINISHED, DIVERGED or CONTACT_UNSOLVED.
    """
    linear, spin, step, output_row = stepper.linear, stepper.spin, stepper.step, stepper.output_row
    samples_per_revolution = stepper.samples_per_revolution
    displacement, velocity = state[0], state[1]
    velocity_next, damping_force, residual = scratch[0], scratch[1], scratch[2]
    row, axis_y, axis_z, radius, clearance, aside = (
        pairs.row,
        pairs.axis_y,
        pairs.axis_z,
        pairs.radius,
        pairs.clearance,
        pairs.aside,
    )
    is_updated, at, gap, contact_force = pairs.is_updated, work.at, work.gap, work.force
    friction, traction = pairs.friction, work.traction
    block, force_direction, matrix, start, inverse = (
        pairs.block,
        work.force_direction,
        work.matrix,
        linear.start,
        linear.inverse,
    )
    highest, lowest, peak_lateral, energy = (
        accumulator.highest,
        accumulator.lowest,
        accumulator.peak_lateral,
        accumulator.energy,
    )
    force_row = linear.force_row
    n_dof, q = displacement.size, gap.size
    twist = output_row[2]
    is_direct = is_plain(pairs.law)
    is_linear_pair = q == 1 and not is_updated and is_direct  # one division solves it
    may_press_open, bounces = is_penalty(pairs.law), is_bouncing(pairs.law)
    start_position, start_rate, delay = work.now, work.rate, work.delay
    solution = work.solution
    whole, late = np.ones(q), np.zeros(q)
    turn_cosine, turn_sine = np.cos(spin * step), np.sin(spin * step)
    sense = rim_sense(spin)
    was_touching = True
    for i_sample in range(first_sample, last_sample):
        angle = sense * 2.0 * np.pi * (i_sample % samples_per_revolution) / samples_per_revolution
        cosine, sine = np.cos(angle), np.sin(angle)
        if is_recorded:
            take_sample(displacement, output_row, row, i_sample, samples)
        for i_step in range(steps_per_sample):
            free_velocity(
                linear, step, cosine, sine, displacement, velocity, velocity_next, damping_force, residual
            )
            for k in range(n_dof):
                residual[k] = displacement[k] + step * velocity_next[k]
            is_touching = is_any_closed(
                row, axis_y, axis_z, radius, clearance, aside, is_updated, residual, at, gap
            )
            if is_touching or (may_press_open and was_touching):
                if is_linear_pair and matrix[0, 0] > 0.0:
                    contact_force[0] = -gap[0] / matrix[0, 0]
                    traction[0] = friction[0] * contact_force[0]
                    solution[0], solution[2] = 1.0, -gap[0]
                    solution[1] = abs(gap[0] + matrix[0, 0] * contact_force[0])
                else:
                    if not is_direct:
                        fill_start(row, displacement, velocity, start_position, start_rate)
                    n_touching = solve_contact(pairs, work, step, spin)
                    if n_touching == UNSOLVED:
                        reached[0] = i_sample
                        return CONTACT_UNSOLVED
                    is_touching = n_touching > 0
                if bounces:
                    for k in range(n_dof):
                        residual[k] = velocity_next[k] - velocity[k]  # over a step without its forces
                if is_recorded:
                    observe_solution(STEP, int(solution[0]), solution[1], solution[2], accumulator)
                apply_contact(
                    start, inverse, row, block, force_direction, contact_force, step, whole, velocity_next
                )
            elif was_touching:
                contact_force[:] = 0.0
            if is_recorded:
                observe_motion(displacement, output_row, row, highest, lowest, peak_lateral)
                if is_touching or was_touching:
                    begin = (i_sample * steps_per_sample + i_step) * step
                    observe_contact(pairs, work, spin, begin, step, velocity, velocity_next, accumulator)
                    for i in range(q):
                        samples.force[i, i_sample] += contact_force[i] / steps_per_sample
                    if is_touching and bounces:
                        observe_delays(row, work, residual, accumulator)
                loss = circulatory_power(linear, displacement, velocity)
                for k in range(n_dof):
                    loss += velocity[k] * damping_force[k]
                energy[DAMPING_LOSS] += step * loss
                for k in range(force_row.size):
                    force = turning_force(linear, k, cosine, sine)
                    energy[UNBALANCE_WORK] += step * force * centred(force_row[k], velocity, velocity_next)
                if i_step == 0 and twist >= 0:
                    samples.rotor[TWIST_ACCELERATION, i_sample] = (
                        velocity_next[twist] - velocity[twist]
                    ) / step
                if i_step == 0:
                    read_probes(
                        stepper.probe, step, displacement, velocity, velocity_next, i_sample, samples.probe
                    )
            if is_touching and bounces:  # displacement by a force before the time of its impact
                late[:] = -delay
                for k in range(n_dof):
                    residual[k] = -displacement[k]
                apply_contact(
                    start, inverse, row, block, force_direction, contact_force, step, late, displacement
                )
                if is_recorded:  # the loads have done work on it too
                    for k in range(n_dof):
                        residual[k] += displacement[k]
                        energy[DAMPING_LOSS] += residual[k] * damping_force[k]
                    energy[DAMPING_LOSS] += circulatory_power(linear, displacement, residual)
                    for k in range(force_row.size):
                        force = turning_force(linear, k, cosine, sine)
                        if force_row[k] >= 0:
                            energy[UNBALANCE_WORK] += force * residual[force_row[k]]
            for k in range(n_dof):
                displacement[k] += step * velocity_next[k]
                velocity[k] = velocity_next[k]
            cosine, sine = (
                cosine * turn_cosine - sine * turn_sine,
                sine * turn_cosine + cosine * turn_sine,
            )
            was_touching = is_touching
        flush_decayed(state)
        if has_diverged(displacement, output_row, row, stepper.displacement_limit):
            reached[0] = i_sample
            return DIVERGED
    return FINISHED


@linked
def observe_delays(row: Ints, work: Workspace, change: Floats, accumulator: Accumulator) -> None:
    """Correct the work of a step's impulses for the velocities at their instants, each after its delay.

    `change` (n_dof,) is the change of the velocities over a step without contact forces.
    """
    for i in range(row.shape[0]):
        opened, slipped = 0.0, 0.0
        for a in range(N_DEGREE):
            if row[i, a] >= 0:
                moved = work.delay[i] * work.force[i] * change[row[i, a]]
                opened += work.gap_jacobian[i, a] * moved
                slipped -= (work.force_direction[i, a] - work.gap_jacobian[i, a]) * moved
        observe_rub(i, 0.0, 0.0, slipped, accumulator)
        accumulator.energy[IMPACT_LOSS] -= opened


@linked
def read_probes(
    probe: Floats,
    step: float,
    displacement: Floats,
    velocity: Floats,
    velocity_next: Floats,
    i_sample: int,
    seen: Floats,
) -> None:
    """Record probe readings, (n_probe, n_sample), from the velocities half a step before and after."""
    for i in range(seen.shape[0]):
        value = 0.0
        for k in range(displacement.size):
            value += (
                probe[0, i, k] * displacement[k]
                + probe[1, i, k] * 0.5 * (velocity[k] + velocity_next[k])
                + probe[2, i, k] * (velocity_next[k] - velocity[k]) / step
            )
        seen[i, i_sample] = value


@linked
def flush_decayed(state: Floats) -> None:
    """Set decayed motion to zero: subnormal numbers make a step ten times slower."""
    for i in range(state.shape[0]):
        for k in range(state.shape[1]):
            if abs(state[i, k]) < DECAYED:
                state[i, k] = 0.0


@linked
def has_diverged(displacement: Floats, output_row: Ints, pair_row: Ints, limit: float) -> bool:
    """Whether a displacement of the output node or of a rim is not finite or beyond the limit, m."""
    for k in range(2):
        if output_row[k] >= 0 and not abs(displacement[output_row[k]]) <= limit:
            return True
    for i in range(pair_row.shape[0]):
        for a in (V, W):
            if pair_row[i, a] >= 0 and not abs(displacement[pair_row[i, a]]) <= limit:
                return True
    return False
