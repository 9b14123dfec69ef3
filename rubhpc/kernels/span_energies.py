"""Energies of spans between events under set-valued friction, in one contact mode.

Losses of damping and works of friction are growths of forms of the coordinates. Where these are tabulated
(`transitions.Transitions`) they are read once for several spans.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.accumulators import DAMPING_LOSS, UNBALANCE_WORK, observe_rub
from rubhpc.kernels.friction_coordinates import add_energies, used_width, work_form
from rubhpc.kernels.friction_spans import AT_ONCE, RUBBED
from rubhpc.kernels.friction_states import BACKWARD, FORWARD, OPEN, STUCK, FrictionBodies, state_of
from rubhpc.kernels.friction_work import rub_through, still_rub
from rubhpc.kernels.product_forms import forms_gained

if TYPE_CHECKING:
    from rubhpc.kernels.accumulators import Accumulator
    from rubhpc.kernels.case_progress import Clock
    from rubhpc.kernels.contact_modes import ModeTables
    from rubhpc.kernels.friction_spans import Spans
    from rubhpc.kernels.sampling import Recorder
    from rubhpc.kernels.transitions import Transitions

Floats = NDArray[np.float64]


@linked_sum
def add_losses(
    tables: ModeTables,
    clock: Clock,
    mode: int,
    n_alike: int,
    recorder: Recorder,
    accumulator: Accumulator,
    transitions: Transitions,
) -> None:
    """Add what damping took and the unbalance gave in the spans `alike` in a contact mode.

    The loss includes what friction took less what the drive gave (`add_rubs`).
    """
    spans, m, form = recorder.spans, recorder.spans.begun.shape[2], -1
    used, steady = used_width(tables, mode), tables.steady_power[mode]
    if transitions.mode.size > 0:
        form = transitions.energy[mode]
    for first in range(0, n_alike, AT_ONCE):
        count = min(AT_ONCE, n_alike - first)
        if form >= 0:
            forms_gained(transitions, form, spans, spans.alike[first:], count, m, spans.gained)
        for j in range(count):
            s = spans.alike[first + j]
            time, begun, ended = (
                (spans.tick[s, 1] - spans.tick[s, 0]) * clock.tick,
                spans.begun[s],
                spans.ended[s],
            )
            if form >= 0:
                gained = work_form(tables, mode, ended[0, :used], ended[1, :used])
                gained -= work_form(tables, mode, begun[0, :used], begun[1, :used])
                accumulator.energy[DAMPING_LOSS] += spans.gained[j] + steady[0] * time
                accumulator.energy[UNBALANCE_WORK] += gained + steady[1] * time
            else:
                add_energies(tables, mode, time, begun, ended, recorder, accumulator)


@linked_sum
def add_rubs(
    tables: ModeTables,
    bodies: FrictionBodies,
    clock: Clock,
    mode: int,
    n_alike: int,
    spans: Spans,
    accumulator: Accumulator,
    transitions: Transitions,
) -> None:
    """Add times of contact, slips and works of friction in the spans `alike` in a contact mode.

    Of drive and friction together `add_losses` knows the work in closed form, and counts it with the damping:
    what is added to them here is taken off there. Work alone is a form of the coordinates. The least slip
    takes a search, but that of a pair that slides forward lies above 0.
    """
    m = spans.begun.shape[2]
    for i in range(bodies.rim_speed.size):
        state, form = state_of(tables.mask[mode], i), -1
        if state == OPEN:
            continue
        if state == FORWARD and accumulator.least_slip[i] <= 0.0 and transitions.mode.size > 0:
            form = transitions.rub[mode, i]
        for first in range(0, n_alike, AT_ONCE):
            count = min(AT_ONCE, n_alike - first)
            if form >= 0:
                forms_gained(transitions, form, spans, spans.alike[first:], count, m, spans.gained)
            for j in range(count):
                s = spans.alike[first + j]
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
                    if form >= 0:
                        work = spans.gained[j] + still_rub(tables, mode, i, time, begun, ended)
                    else:
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
