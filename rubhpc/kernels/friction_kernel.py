"""The kernel of set-valued friction that Python calls.

A case advances in three ways that share the loop from event to event. The loop is most of what there is to
compile (90 s): in one kernel it is compiled once.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum
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


@jit_sum
def advance_friction(
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
    """Advance a case through `pieces` if there are any, by `sections` if there are any, else to `last_tick`.

    Parameters
    ----------
    last_tick : int, is_recorded : bool
        Of `friction_loop.advance_with_friction`.
    sections : (n_revolution, 2 n), limit : m, energy_limit : J
        Of `friction_sections.advance_friction_sections`; without sections, n_revolution is 0.
    pieces : Pieces, sums : Accumulator
        Of `friction_pieces.advance_friction_pieces`; without pieces, `NO_PIECES` and no rows.

    Returns
    -------
    int
        Outcome of that function.
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
