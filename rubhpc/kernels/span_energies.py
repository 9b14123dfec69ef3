"""Energies of spans between events under set-valued friction, in one contact mode.

Losses of damping are growths of forms of the coordinates; works of friction are found by a quadrature.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_inline_sum
from rubhpc.kernels.accumulators import DAMPING_LOSS, observe_rub
from rubhpc.kernels.friction_coordinates import add_energies
from rubhpc.kernels.friction_spans import RUBBED
from rubhpc.kernels.friction_states import BACKWARD, FORWARD, OPEN, STUCK, FrictionBodies, state_of
from rubhpc.kernels.friction_work import rub_through

if TYPE_CHECKING:
    from rubhpc.kernels.accumulators import Accumulator
    from rubhpc.kernels.case_progress import Clock
    from rubhpc.kernels.contact_modes import ModeTables
    from rubhpc.kernels.friction_spans import Spans
    from rubhpc.kernels.sampling import Recorder

Floats = NDArray[np.float64]


@jit_inline_sum
def add_losses(
    tables: ModeTables,
    clock: Clock,
    mode: int,
    n_alike: int,
    recorder: Recorder,
    accumulator: Accumulator,
) -> None:
    """Add what damping took and the unbalance gave in the spans `alike` in a contact mode.

    The loss includes what friction took less what the drive gave (`add_rubs`).
    """
    spans = recorder.spans
    for place in range(n_alike):
        s = spans.alike[place]
        time = (spans.tick[s, 1] - spans.tick[s, 0]) * clock.tick
        add_energies(tables, mode, time, spans.begun[s], spans.ended[s], recorder, accumulator)


@jit_inline_sum
def add_rubs(
    tables: ModeTables,
    bodies: FrictionBodies,
    clock: Clock,
    mode: int,
    n_alike: int,
    spans: Spans,
    accumulator: Accumulator,
) -> None:
    """Add times of contact, slips and works of friction in the spans `alike` in a contact mode.

    Of drive and friction together `add_losses` knows the work in closed form, and counts it with the damping:
    what is added to them here is taken off there.
    """
    for i in range(bodies.rim_speed.size):
        state = state_of(tables.mask[mode], i)
        if state == OPEN:
            continue
        for place in range(n_alike):
            s = spans.alike[place]
            n_tick, begun, ended = spans.tick[s, 1] - spans.tick[s, 0], spans.begun[s], spans.ended[s]
            time, rubbed = n_tick * clock.tick, spans.pair[s, i, RUBBED]
            if n_tick == 0:
                continue
            accumulator.contact_time[i] += time
            if state == STUCK:
                accumulator.stick_time[i] += time
                accumulator.least_slip[i] = min(accumulator.least_slip[i], 0.0)
                drive, friction_work = bodies.rim_speed[i] * rubbed, 0.0
            else:
                sense = -1.0 if state == BACKWARD else 1.0
                work, least, most = rub_through(
                    tables, bodies, clock, mode, i, n_tick, begun, ended, spans.path
                )
                slip = max(least, 0.0) if state == FORWARD else -most
                accumulator.least_slip[i] = min(accumulator.least_slip[i], slip)
                friction_work = bodies.sliding[i] * work
                drive = sense * bodies.sliding[i] * bodies.rim_speed[i] * rubbed
                accumulator.friction_work[i] += friction_work
            observe_rub(drive, friction_work, accumulator)
            accumulator.energy[DAMPING_LOSS] += drive - friction_work
