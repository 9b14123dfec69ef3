"""The trail of a motion from event to event, along which its tangent is propagated afterwards."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked
from rubhpc.kernels._struct import Struct

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_BYTES = 2**25  # of a trail
MOST_EVENTS = 2**14
BROKEN = -1  # instead of the number of events: there was no room for all, or collocation between them


class Trail(Struct):
    """Pieces of a motion; m modal coordinates, q pairs. Without room none are stored.

    Piece k + 1 begins where event k ends piece k.
    """

    n_event: Ints  # (1,), number of events, or BROKEN
    states: Ints  # (room + 1,), set of closed pairs
    tick: Ints  # (room,), of each event
    crossing: Ints  # (room,), pairs whose switch functions vanish there
    begun: Floats  # (room + 1, 2, m), modal coordinates with which each piece begins
    rate: Floats  # (room, q), rates of gaps after each event, m/s, of pairs with impulses
    given: Floats  # (room, q), normal impulses of each event, N s


def new_trail(m: int, q: int) -> Trail:
    """Room for a trail of a case with m modal coordinates and q pairs."""
    room = max(1, min(MOST_EVENTS, MOST_BYTES // (8 * (2 * m + 2 * q))))
    return _with_room(room, m, q)


def no_trail() -> Trail:
    """A trail without room."""
    return _with_room(0, 1, 1)


def _with_room(room: int, m: int, q: int) -> Trail:
    return Trail(
        n_event=np.zeros(1, dtype=np.int64),
        states=np.zeros(room + 1, dtype=np.int64),
        tick=np.zeros(room, dtype=np.int64),
        crossing=np.zeros(room, dtype=np.int64),
        begun=np.empty((room + 1, 2, m)),
        rate=np.empty((room, q)),
        given=np.empty((room, q)),
    )


def begin_trail(trail: Trail, states: int, z: Floats) -> None:
    """Begin at a motion, given by its closed pairs and modal coordinates (2, m)."""
    trail.n_event[0], trail.states[0], trail.begun[0] = 0, states, z


@linked
def note_event(trail: Trail, tick: int, crossing: int) -> None:
    """Store an event."""
    room, k = trail.tick.size, trail.n_event[0]
    if room > 0 and k >= 0:
        if k == room:
            trail.n_event[0] = BROKEN
        else:
            trail.tick[k], trail.crossing[k] = tick, crossing


@linked
def note_after(trail: Trail, rate: Floats, given: Floats) -> None:
    """Store rates of gaps (q,), m/s, after the event, and its impulses (q,)."""
    k = trail.n_event[0]
    if trail.tick.size > 0 and k >= 0:
        for i in range(given.size):
            trail.rate[k, i], trail.given[k, i] = rate[i], given[i]


@linked
def note_piece(trail: Trail, states: int, z: Floats) -> None:
    """Store the closed pairs and coordinates (2, m) after the event."""
    k = trail.n_event[0]
    if trail.tick.size > 0 and k >= 0:
        trail.states[k + 1] = states
        for i in range(z.shape[1]):
            trail.begun[k + 1, 0, i], trail.begun[k + 1, 1, i] = z[0, i], z[1, i]
        trail.n_event[0] = k + 1
