"""Pieces of a run-up under set-valued friction, one after the other, as `piece_loop` takes them without."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.case_progress import (
    CONTACT_UNSOLVED,
    DIVERGED,
    FINISHED,
    MODE_WANTED,
    Clock,
    Coordinates,
    Progress,
    Sections,
)
from rubhpc.kernels.contact_modes import FORCED_LEVEL, ModeTables, Reduced, dot
from rubhpc.kernels.event_forces import FrictionWork  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.friction_change import change_states
from rubhpc.kernels.friction_loop import advance_with_friction
from rubhpc.kernels.friction_states import (
    BACKWARD,
    FORWARD,
    OPEN,
    STUCK,
    FrictionBodies,
    lifted_place,
    state_of,
)
from rubhpc.kernels.mode_change import product
from rubhpc.kernels.penalty_events import pressed_pairs
from rubhpc.kernels.pieces import (
    PART,
    PART_TO_BEGIN,
    PIECE,
    STAGE,
    TO_BEGIN,
    TO_ENTER,
    Pieces,
    begin_part,
    begin_piece,
    clock_of,
    end_part,
    end_piece,
    row_of,
    set_masks,
    start_piece,
)
from rubhpc.kernels.sampling import Measured

if TYPE_CHECKING:
    from rubhpc.kernels.accumulators import Accumulator

Floats = NDArray[np.float64]

AT_REST = 1e-4  # of the rim speed: a pair that slips less than that at the beginning of a case has stuck
LEAST_FORCE = float(np.finfo(float).tiny)  # N, of a closed pair


@linked_sum
def advance_friction_pieces(
    tables: ModeTables,
    reduced: Reduced,
    bodies: FrictionBodies,
    clock: Clock,
    pieces: Pieces,
    progress: Progress,
    coordinates: Coordinates,
    work: FrictionWork,
    measured: Measured,
    sums: Accumulator,
    sections: Sections,
) -> int:
    """Advance a case through pieces, as `piece_loop.advance_pieces` does.

    `bodies.rim_speed` is that of `reduced`; `bodies.turned` is set.

    Returns
    -------
    int
        FINISHED, or what `friction_loop.advance_with_friction` stopped with in the piece under way;
        CONTACT_UNSOLVED too where no states go on from its beginning.
    """
    is_recorded = bool(np.bool_(True))  # no literal: the loop is compiled for one type
    recorder, samples, z = measured.recorder, measured.samples, coordinates.z
    at, n_part = pieces.at, pieces.n_sample // pieces.n_part_sample
    while at[PIECE] < pieces.spin.size:
        piece = at[PIECE]
        set_masks(tables.mask, pieces.table, pieces.n_room, piece)
        now, begun = clock_of(clock, pieces, piece), pieces.motion[piece]
        if at[STAGE] == TO_BEGIN:
            start_piece(reduced, pieces, piece, recorder, samples)
            turn_unbalance(reduced, bodies)
            states = first_states(reduced, bodies, begun, pieces.pressing[piece])
            moment, before = (1 << FORCED_LEVEL) * now.tick, row_of(sums, piece * n_part)
            none, no = (
                int(np.int64(0)),
                bool(np.bool_(False)),
            )  # no literals, for which it would be compiled again
            states = change_states(reduced, bodies, states, none, moment, 1.0, 0.0, begun, no, work, before)
            if states < 0:
                return CONTACT_UNSOLVED
            progress.wanted, at[STAGE] = states, TO_ENTER
        if at[STAGE] == TO_ENTER:
            if not begin_piece(tables, reduced, pieces, clock.sample_level, progress, z):
                return MODE_WANTED
            at[PART], at[STAGE] = 0, PART_TO_BEGIN
        while at[PART] < n_part:
            place = 1 + piece * n_part + at[PART]
            part = row_of(sums, place)
            if at[STAGE] == PART_TO_BEGIN:
                closed = closed_set(tables.mask[progress.mode], part.is_touching.size)
                begin_part(pieces, progress, part, row_of(sums, place - 1), closed)
            last_tick = ((at[PART] + 1) * pieces.n_part_sample) << clock.sample_level
            outcome = advance_with_friction(
                tables,
                reduced,
                bodies,
                now,
                last_tick,
                is_recorded,
                progress,
                coordinates,
                work,
                Measured(recorder, samples, part),
                sections,
            )
            if outcome != FINISHED:
                return outcome
            if not end_part(tables, reduced, pieces, progress.mode, z, part):
                return DIVERGED
        read_pressing(tables, bodies, progress.mode, z, pieces.pressing[piece + 1])
        end_piece(pieces, piece, progress.n_step, tables.mask[progress.mode], z, samples)
    return FINISHED


@linked_sum
def turn_unbalance(reduced: Reduced, bodies: FrictionBodies) -> None:
    """Set `bodies.turned` by the unbalance of `reduced`."""
    q = reduced.radius.size
    for i in range(q):
        for row, place in ((reduced.gap_jacobian[i], i), (reduced.slip[i], q + i)):
            bodies.turned[place, 0] = product(row, reduced.force_cosine)
            bodies.turned[place, 1] = product(row, reduced.force_sine)


@linked_sum
def first_states(reduced: Reduced, bodies: FrictionBodies, motion: Floats, pressing: Floats) -> int:
    """States with which a piece begins but for what forces make of them, as pairs press (N) and slip."""
    q, n = reduced.gap_jacobian.shape
    found, overlapped = int(np.int64(0)), int(np.int64(0))
    if reduced.spring > 0.0:
        overlapped = pressed_pairs(reduced, motion)
        found |= (overlapped >> q) << lifted_place(q, 0)
    for i in range(q):
        if (overlapped >> i) & 1 == 1 if reduced.spring > 0.0 else pressing[i] > 0.0:
            slip = bodies.rim_speed[i] + product(reduced.slip[i], motion[n:])
            state = FORWARD if slip >= 0.0 else BACKWARD
            if abs(slip) <= AT_REST * bodies.rim_speed[i]:
                state = STUCK
            found |= state << (2 * i)
    return found


@linked_sum
def closed_set(states: int, q: int) -> int:
    """Set of the pairs that are not open, a bit each."""
    found = int(np.int64(0))
    for i in range(q):
        if state_of(states, i) != OPEN:
            found |= 1 << i
    return found


@linked_sum
def read_pressing(tables: ModeTables, bodies: FrictionBodies, mode: int, z: Floats, force: Floats) -> None:
    """Fill in the normal forces (q,), N, of coordinates (2, m); of a pair that sticks by its two cones."""
    for i in range(force.size):
        state, force[i] = state_of(tables.mask[mode], i), 0.0
        if state == OPEN:
            continue
        pressed = dot(tables.switch_re[mode, 2 * i], tables.switch_im[mode, 2 * i], z[0], z[1])
        if state == STUCK:
            other = dot(tables.switch_re[mode, 2 * i + 1], tables.switch_im[mode, 2 * i + 1], z[0], z[1])
            pressed = 0.5 * (pressed + other) / (bodies.static[i] if bodies.static[i] != 0.0 else 1.0)
        force[i] = max(pressed, LEAST_FORCE)
