"""An event of straight gaps: its effect on the motion and on the record, and the contact mode entered."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.case_progress import (
    CONTACT_UNSOLVED,
    DIVERGED,
    UNDER_WAY,
    Clock,
    Coordinates,
    Progress,
    shaft_turn,
)
from rubhpc.kernels.closed_form.event_steps import enter_wanted, leave_mode, record_event, record_touch
from rubhpc.kernels.closed_form.measuring import begin_contact, begin_span
from rubhpc.kernels.closed_form.mode_change import EventWork, change_contacts
from rubhpc.kernels.contact_modes import FORCED_LEVEL, ModeTables, Reduced
from rubhpc.kernels.sampling import Measured, Recorder  # noqa: TC001 - part of a kernel's signature

Floats = NDArray[np.float64]

MOST_EVENTS = 200_000  # in a revolution; more is chatter without end


@linked_sum
def begin_mode(
    tables: ModeTables,
    reduced: Reduced,
    clock: Clock,
    is_recorded: bool,
    progress: Progress,
    coordinates: Coordinates,
    recorder: Recorder,
) -> bool:
    """Enter the contact mode wanted, if any, with the reduced motion, and begin to measure it.

    Returns False where the mode is not tabulated.
    """
    is_entered, z = progress.wanted < 0, coordinates.z
    if not is_entered and enter_wanted(tables, reduced, clock, progress, coordinates.motion, z):
        is_entered = True
    if is_entered and is_recorded:
        if progress.energy_from < 0:
            begin_span(z, progress, recorder)
        begin_contact(tables, reduced, progress.mode, z, coordinates.z_next, recorder)
    return is_entered


@linked_sum
def take_event(
    tables: ModeTables,
    reduced: Reduced,
    clock: Clock,
    crossing: int,
    is_recorded: bool,
    progress: Progress,
    coordinates: Coordinates,
    work: EventWork,
    measured: Measured,
) -> int:
    """Take the event of the pairs `crossing`: what it makes of the motion, and the contact mode wanted next.

    Returns
    -------
    int
        UNDER_WAY, DIVERGED or CONTACT_UNSOLVED.
    """
    spin, closed, motion = clock.spin, tables.mask[progress.mode], coordinates.motion
    samples, accumulator = measured.samples, measured.accumulator
    if not leave_mode(tables, reduced, clock, is_recorded, progress, coordinates, work.impulse, measured):
        return DIVERGED
    cosine, sine = shaft_turn(clock, progress.tick)
    moment = (1 << FORCED_LEVEL) * clock.tick
    progress.wanted = change_contacts(
        reduced, closed, crossing, spin, moment, cosine, sine, motion, is_recorded, work, accumulator
    )
    if progress.wanted < 0 or progress.n_event > MOST_EVENTS:
        return CONTACT_UNSOLVED
    if is_recorded:
        for i in range(reduced.radius.size):
            record_event(clock, progress, work.impulse, i, samples, accumulator)
            record_touch(i, (progress.wanted >> i) & 1 == 1, accumulator)
    return UNDER_WAY
