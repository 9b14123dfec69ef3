"""What the exact integrator gathers: samples, extrema, contact and energy, from the modal coordinates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum
from rubhpc.kernels.events import product
from rubhpc.kernels.observe import (
    DAMPING_LOSS,
    DRIVE_WORK,
    FRICTION_LOSS,
    TWIST_ACCELERATION,
    UNBALANCE_WORK,
    Samples,
    Tally,
    widen,
)
from rubhpc.kernels.phases import (
    LATERAL_RATE,
    LATERAL_ROW,
    N_ROTOR_ROW,
    TWIST_ACCELERATION_ROW,
    Clock,
    Phases,
    Reduced,
    dot,
)

Floats = NDArray[np.float64]


@jit_sum
def observe_energy(
    reduced: Reduced, cosine: float, sine: float, weight: float, motion: Floats, energy: Floats
) -> None:
    """Add the powers of damping and unbalance at one instant, times `weight` (s), to the balance."""
    n = reduced.push.shape[1]
    displacement, velocity = motion[:n], motion[n:]
    for k in range(n):
        loss = product(reduced.damping[k], velocity) + product(reduced.circulation[k], displacement)
        energy[DAMPING_LOSS] += weight * velocity[k] * loss
        energy[UNBALANCE_WORK] += (
            weight * velocity[k] * (reduced.force_cosine[k] * cosine + reduced.force_sine[k] * sine)
        )


@jit_sum
def observe_outputs(
    phases: Phases,
    p: int,
    z: Floats,
    interval: float,
    is_first: bool,
    outputs: Floats,
    before: Floats,
    tally: Tally,
) -> None:
    """Output rows at a sample into `outputs` (o,), and the extrema since the sample before."""
    for row in range(outputs.size):
        before[row] = outputs[row]
        outputs[row] = dot(phases.output_re[p, row], phases.output_im[p, row], z[0], z[1])
    if is_first:
        before[:] = outputs
    for k in range(3):
        tally.highest[k], tally.lowest[k] = widen(
            before[k], before[3 + k], outputs[k], outputs[3 + k], interval, tally.highest[k], tally.lowest[k]
        )
    for i in range(tally.peak_lateral.size):
        first = N_ROTOR_ROW + 3 * i
        high, low = widen(
            before[first + LATERAL_ROW],
            before[first + LATERAL_RATE],
            outputs[first + LATERAL_ROW],
            outputs[first + LATERAL_RATE],
            interval,
            tally.peak_lateral[i],
            -tally.peak_lateral[i],
        )
        tally.peak_lateral[i] = max(high, -low)


@jit_sum
def take_sample(
    phases: Phases,
    reduced: Reduced,
    clock: Clock,
    p: int,
    t: int,
    last_tick: int,
    displacement_limit: float,
    z: Floats,
    motion: Floats,
    outputs: Floats,
    before: Floats,
    samples: Samples,
    tally: Tally,
) -> bool:
    """Record the sample at tick t, extrema and energy; False where the case has diverged.

    The sample at `last_tick` belongs to the next call; only the record's own end is weighed in the energy.
    """
    interval = clock.tick * clock.ticks_per_sample
    i_sample, n_sample = t // clock.ticks_per_sample, samples.rotor.shape[1]
    observe_outputs(phases, p, z, interval, i_sample == 0, outputs, before, tally)
    if not (abs(outputs[0]) <= displacement_limit and abs(outputs[1]) <= displacement_limit):
        return False
    if t < last_tick:
        for k in range(3):
            samples.rotor[k, i_sample] = outputs[k]
        samples.rotor[TWIST_ACCELERATION, i_sample] = outputs[TWIST_ACCELERATION_ROW]
        for i in range(samples.axial.shape[0]):
            samples.axial[i, i_sample] = outputs[N_ROTOR_ROW + 3 * i]
            samples.lateral[i, i_sample] = outputs[N_ROTOR_ROW + 3 * i + LATERAL_ROW]
    if i_sample % clock.energy_stride == 0 and (t < last_tick or i_sample == n_sample):
        is_edge = i_sample == 0 or i_sample == n_sample
        weight = clock.energy_stride * interval * (0.5 if is_edge else 1.0)
        turn = 2.0 * np.pi * (i_sample % clock.samples_per_revolution) / clock.samples_per_revolution
        for k in range(motion.size):
            motion[k] = dot(phases.motion_re[p, k], phases.motion_im[p, k], z[0], z[1])
        sine = np.sin(turn) if clock.spin >= 0.0 else -np.sin(turn)
        observe_energy(reduced, np.cos(turn), sine, weight, motion, tally.energy)
    return True


@jit_sum
def observe_closed(
    phases: Phases,
    reduced: Reduced,
    p: int,
    spin: float,
    step: float,
    z: Floats,
    z_next: Floats,
    i_sample: int,
    interval: float,
    samples: Samples,
    tally: Tally,
) -> None:
    """Add a step's contact to sample and tally: Hermite's cubic for the force, Simpson's rule for work."""
    for i in range(reduced.radius.size):
        if not (phases.mask[p] >> i) & 1:
            continue
        force = dot(phases.switch_re[p, i], phases.switch_im[p, i], z[0], z[1])
        slope = dot(phases.rate_re[p, i], phases.rate_im[p, i], z[0], z[1])
        force_next = dot(phases.switch_re[p, i], phases.switch_im[p, i], z_next[0], z_next[1])
        slope_next = dot(phases.rate_re[p, i], phases.rate_im[p, i], z_next[0], z_next[1])
        slip = dot(phases.slip_re[p, i], phases.slip_im[p, i], z[0], z[1])
        slip_next = dot(phases.slip_re[p, i], phases.slip_im[p, i], z_next[0], z_next[1])
        impulse = 0.5 * step * (force + force_next) + step * step / 12.0 * (slope - slope_next)
        middle = 0.5 * (force + force_next) + 0.125 * step * (slope - slope_next)
        work = step / 6.0 * (force * slip + 2.0 * middle * (slip + slip_next) + force_next * slip_next)
        work *= reduced.friction[i]
        samples.force[i, i_sample] += impulse / interval
        tally.contact_time[i] += step
        tally.impulse[i] += impulse
        tally.friction_work[i] += work
        tally.least_slip[i] = min(tally.least_slip[i], slip, slip_next)
        tally.peak_force[i], _ = widen(
            force, slope, force_next, slope_next, step, max(tally.peak_force[i], force), 0.0
        )
        tally.energy[FRICTION_LOSS] += work
        tally.energy[DRIVE_WORK] += reduced.friction[i] * impulse * reduced.radius[i] * abs(spin)
