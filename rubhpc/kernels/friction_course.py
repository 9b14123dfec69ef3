"""The kernel of set-valued friction that Python calls: it compiles what all courses of a case share once.

The loop from event to event takes two minutes to compile, as long in each kernel that holds it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_lean_sum
from rubhpc.kernels.friction_loop import advance_with_friction
from rubhpc.kernels.friction_pieces import advance_friction_pieces
from rubhpc.kernels.friction_sections import advance_friction_sections

if TYPE_CHECKING:
    from rubhpc.kernels.accumulators import Accumulator, Samples
    from rubhpc.kernels.case_progress import Clock, Progress
    from rubhpc.kernels.contact_modes import ModeTables, Reduced
    from rubhpc.kernels.event_forces import FrictionWork
    from rubhpc.kernels.friction_states import FrictionBodies
    from rubhpc.kernels.pieces import Pieces
    from rubhpc.kernels.sampling import Recorder
    from rubhpc.kernels.transitions import Transitions

Floats = NDArray[np.float64]


@jit_lean_sum
def advance_by_course(
    tables: ModeTables,
    reduced: Reduced,
    bodies: FrictionBodies,
    clock: Clock,
    last_tick: int,
    is_recorded: bool,
    sections: Floats,
    limit: float,
    energy_limit: float,
    pieces: Pieces,
    sums: Accumulator,
    progress: Progress,
    z: Floats,
    z_next: Floats,
    motion: Floats,
    work: FrictionWork,
    recorder: Recorder,
    samples: Samples,
    accumulator: Accumulator,
    transitions: Transitions,
) -> int:
    """Advance a case through pieces, where there are any; else by sections, likewise; else to `last_tick`.

    Parameters
    ----------
    last_tick, is_recorded
        Of `friction_loop.advance_with_friction`.
    sections, limit, energy_limit
        Of `friction_sections.advance_friction_sections`; without any, sections are (0, 2 n).
    pieces, sums
        Of `friction_pieces.advance_friction_pieces`; without any, they are `NO_PIECES` and of no rows.

    Returns
    -------
    int
        As that function.
    """
    if pieces.spin.size > 0:
        return advance_friction_pieces(
            tables, reduced, bodies, clock, pieces, progress, z, z_next, motion, work, recorder, samples,
            sums, transitions,
        )  # fmt: skip
    if sections.shape[0] > 0:
        return advance_friction_sections(
            tables, reduced, bodies, clock, limit, energy_limit, progress, z, z_next, motion, work, recorder,
            samples, accumulator, sections, transitions,
        )  # fmt: skip
    return advance_with_friction(
        tables, reduced, bodies, clock, last_tick, is_recorded, progress, z, z_next, motion, work, recorder,
        samples, accumulator, transitions,
    )  # fmt: skip
