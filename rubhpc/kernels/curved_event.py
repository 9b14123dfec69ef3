"""An event of curved gaps: its effect on the motion and on the record."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.case_progress import (
    CONTACT_UNSOLVED,
    DIVERGED,
    NONE,
    UNDER_WAY,
    Clock,
    Coordinates,
    Progress,
    shaft_turn,
)
from rubhpc.kernels.contact_event import MOST_EVENTS
from rubhpc.kernels.contact_modes import FORCED_LEVEL, ModeTables, Reduced
from rubhpc.kernels.curved_change import change_curved
from rubhpc.kernels.curved_contact import CurvedPairs, CurvedTables, CurvedWork, is_closed
from rubhpc.kernels.curved_measuring import place
from rubhpc.kernels.event_steps import end_mode, record_event, record_touch
from rubhpc.kernels.mode_change import EventWork  # noqa: TC001 - part of a kernel's signature

if TYPE_CHECKING:
    from rubhpc.kernels.sampling import Measured

Floats = NDArray[np.float64]


@linked_sum
def take_curved_event(
    tables: ModeTables,
    curved: CurvedTables,
    pairs: CurvedPairs,
    reduced: Reduced,
    clock: Clock,
    crossing: int,
    is_recorded: bool,
    progress: Progress,
    coordinates: Coordinates,
    work: CurvedWork,
    events: EventWork,
    measured: Measured,
) -> int:
    """Take the event of the pairs `crossing`, as `contact_event.take_event` does."""
    mode, z, motion = progress.mode, coordinates.z, coordinates.motion
    samples, accumulator = measured.samples, measured.accumulator
    closed = int(tables.mask[mode])
    place(tables, curved, mode, z[0], z[1], work.h[0], work.rate[0], motion)
    if closed != 0:
        progress.energy_from = NONE  # energies are added step by step
    if not end_mode(tables, reduced, clock, is_recorded, progress, coordinates, events.impulse, measured):
        return DIVERGED
    cosine, sine = shaft_turn(clock, progress.tick)
    progress.wanted = change_curved(
        pairs,
        reduced,
        closed,
        crossing,
        clock.spin,
        (1 << FORCED_LEVEL) * clock.tick,
        cosine,
        sine,
        motion,
        is_recorded,
        work,
        events,
        accumulator,
    )
    if progress.wanted < 0 or progress.n_event > MOST_EVENTS:
        return CONTACT_UNSOLVED
    if is_recorded:
        for i in range(reduced.radius.size):
            record_event(clock, progress, events.impulse, i, samples, accumulator)
            record_touch(i, is_closed(progress.wanted, i), accumulator)
    return UNDER_WAY
