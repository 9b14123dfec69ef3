"""The kernel of set-valued friction that Python calls.

A case advances in two ways that share the loop from event to event. The loop is most of what there is to
compile (90 s): in one kernel it is compiled once.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum
from rubhpc.kernels.friction_loop import advance_with_friction
from rubhpc.kernels.friction_pieces import advance_friction_pieces

if TYPE_CHECKING:
    from rubhpc.kernels.accumulators import Accumulator
    from rubhpc.kernels.case_progress import Clock, Coordinates, Progress, Sections
    from rubhpc.kernels.contact_modes import ModeTables, Reduced
    from rubhpc.kernels.event_forces import FrictionWork
    from rubhpc.kernels.friction_states import FrictionBodies
    from rubhpc.kernels.pieces import Pieces
    from rubhpc.kernels.sampling import Measured

Floats = NDArray[np.float64]


@jit_sum
def advance_friction(
    tables: ModeTables,
    reduced: Reduced,
    bodies: FrictionBodies,
    clock: Clock,
    last_tick: int,
    is_recorded: bool,
    pieces: Pieces,
    sums: Accumulator,
    progress: Progress,
    coordinates: Coordinates,
    work: FrictionWork,
    measured: Measured,
    sections: Sections,
) -> int:
    """Advance a case through `pieces` if there are any, else to `last_tick` or by `sections`.

    Parameters
    ----------
    last_tick : int, is_recorded : bool, sections : Sections
        Of `friction_loop.advance_with_friction`.
    pieces : Pieces, sums : Accumulator
        Of `friction_pieces.advance_friction_pieces`; without pieces, `NO_PIECES` and no rows.

    Returns
    -------
    int
        Outcome of that function.
    """
    if pieces.spin.size > 0:
        return advance_friction_pieces(
            tables, reduced, bodies, clock, pieces, progress, coordinates, work, measured, sums, sections
        )
    return advance_with_friction(
        tables,
        reduced,
        bodies,
        clock,
        last_tick,
        is_recorded,
        progress,
        coordinates,
        work,
        measured,
        sections,
    )
