"""Accumulators of a running case: extrema, contact statistics and the energy balance, step by step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked
from rubhpc.kernels._struct import Struct
from rubhpc.kernels.contact_pairs import AXIAL, LATERAL, TORSION, Pairs, V, W, Workspace, rim_sense
from rubhpc.kernels.force_average import add_force

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Signals of the output node, in the order of their rows in `Samples.rotor`.
VERTICAL, HORIZONTAL, TWIST, TWIST_ACCELERATION = range(4)


class Samples(Struct):
    """Shaft-locked samples; the force is the mean over the interval that begins with the sample."""

    rotor: Floats  # (4, n_sample), m, m, rad, rad/s2
    axial: Floats  # (q, n_sample), m
    lateral: Floats  # (q, n_sample), m
    force: Floats  # (q, n_sample), N
    probe: Floats  # (n_probe, n_sample), each in its own unit
    # (q, 4, n_sample), N, vectors up and horizontally: normal force on the stator, all of the force on it; or
    # (0, 4, n_sample), where no stator is a bore
    push: Floats
    whole: Floats  # (n, n_sample), the arrays above as rows, in this order


class Accumulator(Struct):
    """Running sums and extrema over the recorded revolutions."""

    highest: Floats  # (3,), of vertical, horizontal and torsional displacement
    lowest: Floats  # (3,)
    is_touching: NDArray[np.bool_]  # (q,), at the last step
    n_contact: Ints  # (q,), contacts begun
    contact_time: Floats  # (q,), s
    impulse: Floats  # (q,), N s
    stick_time: Floats  # (q,), s in contact without slip
    sense: Ints  # (q,), 1 or -1: of the last slip in contact, positive in steady sliding; 0 before any
    reversals: Ints  # (q,), changes of that sense
    friction_work: Floats  # (q,), J
    least_slip: Floats  # (q,), m/s
    turned: Floats  # (q,), rad, of the contact point in a bore while it touches, positive forward
    peak_force: Floats  # (q,), N, largest mean over the averaging time: see `force_average`
    force_piece: Floats  # (q, 7, n), pieces of the force within the averaging time
    force_held: Ints  # (q, 2), oldest piece and number of pieces
    origin: Floats  # (1,), s, by which their clock is ahead of the integrator's
    peak_lateral: Floats  # (q,), m
    energy: Floats  # (6,), J: see the indices below
    pivots: Ints  # (1,), most pivots of one contact problem
    residual: Floats  # (3, 2), largest deviation from the laws, displacement by the forces: indices below


# How the parts of a record are joined: these are added, of the others the extreme value is kept.
SUMMED = (
    *("n_contact", "contact_time", "impulse", "stick_time", "friction_work", "energy", "reversals"),
    "turned",
)
EXTREMA: dict[str, np.ufunc] = dict.fromkeys(
    ("highest", "peak_force", "peak_lateral", "pivots", "residual"), np.maximum
)
EXTREMA |= dict.fromkeys(("lowest", "least_slip"), np.minimum)

UNBALANCE_WORK, DRIVE_WORK, DAMPING_LOSS, FRICTION_LOSS, IMPACT_LOSS, RUB_WORK = range(6)

# Contact problems: gaps of a step, m; velocities of an impact, m/s; accelerations after it, m/s2.
STEP, IMPACT, PRESSING = range(3)


@linked
def observe_rub(i: int, impulse: float, drive: float, loss: float, accumulator: Accumulator) -> None:
    """Add an impulse of pair i, N s, the work of the drive against its friction, and the frictional loss, J.

    `RUB_WORK` is a sum of differences. The difference of the two sums would carry their rounding errors,
    which grow with all the friction work of a rotor that stands and rubs.
    """
    accumulator.impulse[i] += impulse
    accumulator.friction_work[i] += loss
    accumulator.energy[DRIVE_WORK] += drive
    accumulator.energy[FRICTION_LOSS] += loss
    accumulator.energy[RUB_WORK] += drive - loss


@linked
def take_sample(
    displacement: Floats, output_row: Ints, pair_row: Ints, i_sample: int, samples: Samples
) -> None:
    """Record the displacements of output node and stator tips; constrained degrees stay zero."""
    for k in range(3):
        if output_row[k] >= 0:
            samples.rotor[k, i_sample] = displacement[output_row[k]]
    for i in range(pair_row.shape[0]):
        if pair_row[i, AXIAL] >= 0:
            samples.axial[i, i_sample] = displacement[pair_row[i, AXIAL]]
        if pair_row[i, LATERAL] >= 0:
            samples.lateral[i, i_sample] = displacement[pair_row[i, LATERAL]]


@linked
def observe_motion(
    displacement: Floats,
    output_row: Ints,
    pair_row: Ints,
    highest: Floats,
    lowest: Floats,
    peak_lateral: Floats,
) -> None:
    """Update the extrema of the output node's degrees (3,) and the tips (q,); row -1 is constrained."""
    for k in range(3):
        value = displacement[output_row[k]] if output_row[k] >= 0 else 0.0
        highest[k] = max(highest[k], value)
        lowest[k] = min(lowest[k], value)
    for i in range(peak_lateral.size):
        row = pair_row[i, LATERAL]
        if row >= 0:
            peak_lateral[i] = max(peak_lateral[i], abs(displacement[row]))


@linked
def observe_contact(
    pairs: Pairs,
    work: Workspace,
    spin: float,
    begin: float,
    step: float,
    velocity: Floats,
    velocity_next: Floats,
    accumulator: Accumulator,
) -> None:
    """Add one step's contact; velocities are half a step before and after the step's forces.

    The step begins at the time `begin` (s); its force is taken as constant. The slip speed is
    `r_d (spin + thx') + t . (vA - vB)`, signed so that steady sliding is positive. The work that the normal
    force does not return, `-N` times the rate of the gap, is the loss of the impacts.
    """
    sense = rim_sense(spin)
    for i in range(pairs.radius.size):
        force = work.force[i]
        if not force > 0.0:
            accumulator.is_touching[i] = False
            continue
        rate_v, rate_w = (
            centred(pairs.row[i, V], velocity, velocity_next),
            centred(pairs.row[i, W], velocity, velocity_next),
        )
        rate_twist = centred(pairs.row[i, TORSION], velocity, velocity_next)
        rate_axial = centred(pairs.row[i, AXIAL], velocity, velocity_next)
        rate_lateral = centred(pairs.row[i, LATERAL], velocity, velocity_next)
        gap_jacobian = work.gap_jacobian[i]
        ey, ez = pairs.axis_y[i], pairs.axis_z[i]
        ny, nz = -gap_jacobian[V], -gap_jacobian[W]
        tip_v = rate_axial * ey - rate_lateral * ez
        tip_w = rate_axial * ez + rate_lateral * ey
        opening = ny * (tip_v - rate_v) + nz * (tip_w - rate_w)
        slip = sense * (pairs.radius[i] * (spin + rate_twist) - nz * (rate_v - tip_v) + ny * (rate_w - tip_w))
        friction_force = sense * work.traction[i]
        if not accumulator.is_touching[i]:
            accumulator.n_contact[i] += 1
            accumulator.is_touching[i] = True
        accumulator.contact_time[i] += step
        if work.is_sticking[i]:
            accumulator.stick_time[i] += step
        elif slip != 0.0:
            observe_sense(i, 1 if slip > 0.0 else -1, accumulator)
        accumulator.least_slip[i] = min(accumulator.least_slip[i], slip)
        observe_force(i, begin, step, force * step, force, force, accumulator)
        drive = friction_force * pairs.radius[i] * abs(spin) * step
        observe_rub(i, force * step, drive, friction_force * slip * step, accumulator)
        accumulator.energy[IMPACT_LOSS] -= force * opening * step


@linked
def observe_force(
    i: int, begin: float, step: float, impulse: float, first: float, last: float, accumulator: Accumulator
) -> None:
    """Add a piece of the force of pair i to its mean (`force_average.add_force`)."""
    add_force(
        i,
        begin,
        step,
        impulse,
        first,
        last,
        accumulator.origin,
        accumulator.force_piece,
        accumulator.force_held,
        accumulator.peak_force,
    )


@linked
def observe_sense(i: int, sense: int, accumulator: Accumulator) -> None:
    """Record the sense (1 or -1) in which pair i slides, and count a reversal if it has changed."""
    if accumulator.sense[i] == -sense:
        accumulator.reversals[i] += 1
    accumulator.sense[i] = sense


@linked
def observe_solution(
    problem: int, pivots: int, residual: float, moved: float, accumulator: Accumulator
) -> None:
    """Record the pivots of a contact problem and the deviation of its solution from the laws."""
    accumulator.pivots[0] = max(accumulator.pivots[0], pivots)
    accumulator.residual[problem, 0] = max(accumulator.residual[problem, 0], residual)
    accumulator.residual[problem, 1] = max(accumulator.residual[problem, 1], moved)


@linked
def centred(row: int, velocity: Floats, velocity_next: Floats) -> float:
    """Velocity of a degree at the time of the step's forces; zero where it is constrained."""
    return 0.5 * (velocity[row] + velocity_next[row]) if row >= 0 else 0.0
