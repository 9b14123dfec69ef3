"""Several revolutions without a record, with the motions at their ends."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum, linked_sum
from rubhpc.kernels.case_progress import FINISHED, Clock, Progress
from rubhpc.kernels.contact_modes import ModeTables, Reduced, dot, is_within
from rubhpc.kernels.event_loop import advance

if TYPE_CHECKING:
    from rubhpc.kernels.accumulators import Accumulator, Samples
    from rubhpc.kernels.contact_event import EventWork
    from rubhpc.kernels.sampling import Recorder

Floats = NDArray[np.float64]


@jit_sum
def advance_sections(
    tables: ModeTables,
    reduced: Reduced,
    clock: Clock,
    limit: float,
    energy_limit: float,
    progress: Progress,
    z: Floats,
    z_next: Floats,
    motion: Floats,
    work: EventWork,
    recorder: Recorder,
    samples: Samples,
    accumulator: Accumulator,
    sections: Floats,
) -> int:
    """Advance from the current tick to tick 0 (`event_loop.advance`), and store motions on the way.

    Parameters
    ----------
    limit, energy_limit : float, m and J
        Limits of divergence (`contact_modes.is_within`).
    sections : (n_revolution, 2 n)
        Filled in: the reduced motion at the end of each of the last revolutions before tick 0.

    Returns
    -------
    int
        As in `event_loop.advance`; FINISHED before tick 0 where the motion is beyond a limit.
    """
    per_revolution = clock.samples_per_revolution << clock.sample_level
    motion_re, motion_im, n_revolution = tables.motion_re, tables.motion_im, sections.shape[0]
    while progress.tick < 0:
        k = n_revolution + progress.tick // per_revolution
        outcome = advance(
            tables,
            reduced,
            clock,
            (k + 1 - n_revolution) * per_revolution,
            False,
            progress,
            z,
            z_next,
            motion,
            work,
            recorder,
            samples,
            accumulator,
        )
        if outcome != FINISHED:
            return outcome
        if not note_section(
            motion_re, motion_im, reduced, limit, energy_limit, progress, z, accumulator, sections[k]
        ):
            break
    return FINISHED


@linked_sum
def note_section(
    motion_re: Floats,
    motion_im: Floats,
    reduced: Reduced,
    limit: float,
    energy_limit: float,
    progress: Progress,
    z: Floats,
    accumulator: Accumulator,
    section: Floats,
) -> bool:
    """Fill in the motion (2 n,) at coordinates (2, m); returns whether it is within the limits."""
    for row in range(section.size):
        section[row] = dot(motion_re[progress.mode, row], motion_im[progress.mode, row], z[0], z[1])
    return is_within(
        section,
        reduced.translations,
        reduced.stiffness,
        accumulator.highest,
        accumulator.lowest,
        limit,
        energy_limit,
    )
