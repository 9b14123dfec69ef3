"""Several revolutions without a record under set-valued friction, and the motions at their ends."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.case_progress import FINISHED, Clock, Progress
from rubhpc.kernels.friction_loop import advance_with_friction
from rubhpc.kernels.sections_loop import note_section

if TYPE_CHECKING:
    from rubhpc.kernels.accumulators import Accumulator, Samples
    from rubhpc.kernels.contact_modes import ModeTables, Reduced
    from rubhpc.kernels.event_forces import FrictionWork
    from rubhpc.kernels.friction_states import FrictionBodies
    from rubhpc.kernels.sampling import Recorder
    from rubhpc.kernels.transitions import Transitions

Floats = NDArray[np.float64]


@linked_sum
def advance_friction_sections(
    tables: ModeTables,
    reduced: Reduced,
    bodies: FrictionBodies,
    clock: Clock,
    limit: float,
    energy_limit: float,
    progress: Progress,
    z: Floats,
    z_next: Floats,
    motion: Floats,
    work: FrictionWork,
    recorder: Recorder,
    samples: Samples,
    accumulator: Accumulator,
    sections: Floats,
    transitions: Transitions,
) -> int:
    """Advance from the tick reached to tick 0 as `sections_loop.advance_sections` does.

    Returns
    -------
    int
        As of `friction_loop.advance_with_friction`; FINISHED before tick 0 where the motion is beyond a limit
        there.
    """
    per_revolution = clock.samples_per_revolution << clock.sample_level
    is_recorded = bool(np.bool_(False))  # no literal: the loop is compiled for one type
    motion_re, motion_im, n_revolution = tables.motion_re, tables.motion_im, sections.shape[0]
    while progress.tick < 0:
        k = n_revolution + progress.tick // per_revolution
        outcome = advance_with_friction(
            tables,
            reduced,
            bodies,
            clock,
            (k + 1 - n_revolution) * per_revolution,
            is_recorded,
            progress,
            z,
            z_next,
            motion,
            work,
            recorder,
            samples,
            accumulator,
            transitions,
        )
        if outcome != FINISHED:
            return outcome
        if not note_section(
            motion_re, motion_im, reduced, limit, energy_limit, progress, z, accumulator, sections[k]
        ):
            break
    return FINISHED
