"""What is measured of pairs under set-valued friction as a case goes from event to event."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_inline_sum
from rubhpc.kernels.accumulators import DAMPING_LOSS, observe_force, observe_rub
from rubhpc.kernels.contact_modes import DYING, RESOLVED, ModeTables
from rubhpc.kernels.cubics import turning_value
from rubhpc.kernels.force_average import AVERAGING_TIME
from rubhpc.kernels.friction_states import BACKWARD, FORWARD, OPEN, STUCK, FrictionBodies, state_of
from rubhpc.kernels.measuring import FORCE, FORCE_RATE, SLIP, SLIP_RATE, force_in_step, leave_out_dying
from rubhpc.kernels.sampling import Recorder  # noqa: TC001 - part of a kernel's signature

if TYPE_CHECKING:
    from rubhpc.kernels.accumulators import Accumulator, Samples

Floats = NDArray[np.float64]

# Of the averaging time: until that age of a contact, steps may miss more of what lasts for a shorter time.
SETTLED = 0.125


@jit_inline_sum
def read_friction(
    tables: ModeTables, bodies: FrictionBodies, mode: int, i: int, z_re: Floats, z_im: Floats
) -> tuple[float, float, float, float]:
    """Normal force (N) of closed pair i, its rate, slip speed (m/s) and its rate.

    Where the pair sticks, the last two are its friction (N) and its rate.
    """
    re, im = tables.switch_re[mode], tables.switch_im[mode]
    turning_re, turning_im = tables.rate_re[mode], tables.rate_im[mode]
    first, second = 2 * i, 2 * i + 1
    a, b, a_rate, b_rate = 0.0, 0.0, 0.0, 0.0
    for k in range(z_re.size):  # in one loop: four would wait for their sums four times
        x, y = z_re[k], z_im[k]
        a += re[first, k] * x - im[first, k] * y
        b += re[second, k] * x - im[second, k] * y
        a_rate += turning_re[first, k] * x - turning_im[first, k] * y
        b_rate += turning_re[second, k] * x - turning_im[second, k] * y
    state = state_of(tables.mask[mode], i)
    if state == STUCK:
        share = 0.5 / bodies.static[i]
        return share * (a + b), share * (a_rate + b_rate), 0.5 * (b - a), 0.5 * (b_rate - a_rate)
    sense = -1.0 if state == BACKWARD else 1.0
    return a, a_rate, sense * b, sense * b_rate


@jit_inline_sum
def resolved_friction(tables: ModeTables, mode: int, age: float, z_re: Floats, z_im: Floats) -> float:
    """Time, s, over which cubics follow the switch functions of the pairs closed in contact mode `mode`.

    As `contact_modes.resolved_time`, but for what an event has set off less than a share of the averaging
    time ago: of that, impulses and works are asked for, not values, and the shorter the `age` (s) of the
    contact, the less of them can be missed. Sizes are bounded by those of real and imaginary parts.
    """
    fourth, pace = np.inf, tables.pace[mode]
    for i in range(tables.switch_re.shape[1] // 2):
        state = state_of(tables.mask[mode], i)
        if state == OPEN:
            continue
        for j in range(2 * i, 2 * i + 2):
            # Of the slip, but for that of the steady spin.
            least = DYING if state == STUCK or j == 2 * i else 0.0
            re, im = tables.switch_re[mode, j], tables.switch_im[mode, j]
            whole, bend = 0.0, 0.0
            for k in range(z_re.size):
                if pace[k] > least:
                    part = (abs(re[k]) + abs(im[k])) * (abs(z_re[k]) + abs(z_im[k]))
                    square = pace[k] * pace[k]
                    whole += part
                    bend += part * square * square
            if bend > 0.0:
                fourth = min(fourth, whole / bend)
    spared = max(1.0, SETTLED * AVERAGING_TIME / age)
    return float(np.sqrt(np.sqrt(RESOLVED * spared * fourth)))


@jit_inline_sum
def begin_friction(
    tables: ModeTables, bodies: FrictionBodies, mode: int, z: Floats, calm: Floats, recorder: Recorder
) -> None:
    """Read the closed pairs in contact mode `mode`, at its beginning or where a record begins.

    `calm` (2, m) is work space.
    """
    leave_out_dying(tables.pace[mode], z, calm)
    for i in range(bodies.rim_speed.size):
        if state_of(tables.mask[mode], i) != OPEN:
            force, rate, across, across_rate = read_friction(tables, bodies, mode, i, calm[0], calm[1])
            recorder.node[FORCE, i], recorder.node[FORCE_RATE, i] = force, rate
            recorder.node[SLIP, i], recorder.node[SLIP_RATE, i] = across, across_rate


@jit_inline_sum
def observe_friction(
    tables: ModeTables,
    bodies: FrictionBodies,
    mode: int,
    begin: float,
    step: float,
    z_re: Floats,
    z_im: Floats,
    i_sample: int,
    share: float,
    recorder: Recorder,
    samples: Samples,
    accumulator: Accumulator,
) -> None:
    """Add a step (s) of the closed pairs: forces and slip as cubics, Simpson's rule for friction.

    Times, shares and energies as in `measuring.observe_step`.
    """
    for i in range(bodies.rim_speed.size):
        state = state_of(tables.mask[mode], i)
        if state == OPEN:
            continue
        before, rate_before = recorder.node[FORCE, i], recorder.node[FORCE_RATE, i]
        across_before, across_rate_before = recorder.node[SLIP, i], recorder.node[SLIP_RATE, i]
        after, rate_after, across_after, across_rate_after = read_friction(
            tables, bodies, mode, i, z_re, z_im
        )
        recorder.node[FORCE, i], recorder.node[FORCE_RATE, i] = after, rate_after
        recorder.node[SLIP, i], recorder.node[SLIP_RATE, i] = across_after, across_rate_after
        impulse, middle = force_in_step(before, rate_before, after, rate_after, step)
        samples.force[i, i_sample] += impulse * share
        accumulator.contact_time[i] += step
        accumulator.impulse[i] += impulse
        observe_force(i, begin, step, impulse, before, after, accumulator)
        across_bend = step * (across_rate_before - across_rate_after)
        friction_work = 0.0
        if state == STUCK:
            rubbed = step * (0.5 * (across_before + across_after) + across_bend / 12.0)
            accumulator.stick_time[i] += step
            accumulator.least_slip[i] = min(accumulator.least_slip[i], 0.0)
        else:
            sense = -1.0 if state == BACKWARD else 1.0
            rubbed = sense * bodies.sliding[i] * impulse
            across_middle = 0.5 * (across_before + across_after) + 0.125 * across_bend
            work = before * across_before + 4.0 * middle * across_middle + after * across_after
            friction_work = sense * bodies.sliding[i] * work * step / 6.0
            accumulator.friction_work[i] += friction_work
            least = min(across_before, across_after)
            if across_rate_before < 0.0 and across_rate_after > 0.0:
                least = turning_value(
                    across_before, across_rate_before, across_after, across_rate_after, step
                )
            if state == FORWARD:
                least = max(least, 0.0)
            accumulator.least_slip[i] = min(accumulator.least_slip[i], least)
        drive = bodies.rim_speed[i] * rubbed
        observe_rub(drive, friction_work, accumulator)
        accumulator.energy[DAMPING_LOSS] += drive - friction_work
