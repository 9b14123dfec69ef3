"""A revolution of a motion, and its linear pieces: what happened from one event to the next."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels.closed_form.flow import BEFORE
from rubhpc.kernels.closed_form.revolutions import AFTER, PieceRows, piece_rows

if TYPE_CHECKING:
    from collections.abc import Iterable

Floats = NDArray[np.float64]

NO_PAIR, NO_SPEED = np.zeros(0, dtype=np.int64), np.zeros(0)


class Piece(NamedTuple):
    """Motion in one contact mode, n reduced degrees.

    Attributes
    ----------
    states : int
        Set of closed pairs.
    begin, duration : float, s
        Since the shaft passed its angle 0, and until the event or the end of the revolution.
    crossing : int
        Pairs whose switch functions vanish at the end; 0 where the revolution ends.
    before, after : (2 n,)
        Reduced displacements and velocities at the end, before and after the event.
    touching, approach : (k,)
        Pairs whose gaps close at the end, and their speeds of approach, m/s.
    states_after : int
        What goes on.
    """

    states: int
    begin: float
    duration: float
    crossing: int
    before: Floats
    touching: NDArray[np.int64]
    approach: Floats
    after: Floats
    states_after: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Revolution:
    """One revolution of the shaft, from angle 0 to angle 0 unless another was asked for.

    Attributes
    ----------
    rows : PieceRows
        Its pieces, one more than there are events.
    least_gap, least_force : (q,), m, N
        Smallest gap and force of each pair where it turns between events; inf where it never does.
    """

    rows: PieceRows
    least_gap: Floats
    least_force: Floats

    @property
    def end(self) -> Floats:
        """Motion at the end, (2 n,)."""
        return np.asarray(self.rows.motions[-1, AFTER])

    @property
    def states(self) -> int:
        """Set of closed pairs at the end."""
        return int(self.rows.states[-1, 3])

    @cached_property
    def pieces(self) -> list[Piece]:
        """Its pieces."""
        rows = self.rows
        columns = rows.states.tolist(), rows.times.tolist(), rows.motions, rows.rates
        return [_piece(*row) for row in zip(*columns, strict=True)]


def _piece(states: list[int], times: list[float], motions: Floats, rates: Floats) -> Piece:
    """Return the piece of a row."""
    before, crossing, gaps, after = states
    touching, approach = NO_PAIR, NO_SPEED
    if gaps:
        touching = np.array([i for i in range(rates.size) if gaps >> i & 1])
        approach = -rates[touching]
    return Piece(
        states=before,
        begin=times[0],
        duration=times[1],
        crossing=crossing,
        before=motions[BEFORE],
        touching=touching,
        approach=approach,
        after=motions[AFTER],
        states_after=after,
    )


class HasLeast(Protocol):
    """A revolution with the smallest gaps and forces in it."""

    @property
    def least_gap(self) -> Floats:
        """Smallest gap of each pair where it turns, (q,), m."""

    @property
    def least_force(self) -> Floats:
        """Smallest force of each pair where it turns, (q,), N."""


def least_of(revolutions: Iterable[HasLeast]) -> tuple[Floats, Floats]:
    """Smallest gap and force (q,), m and N, of each pair where it turns between events; inf: none."""
    gaps, forces = zip(*((one.least_gap, one.least_force) for one in revolutions), strict=True)
    return np.min(gaps, axis=0), np.min(forces, axis=0)


def whole_revolutions(rows: PieceRows, least: Floats) -> list[Revolution]:
    """Revolutions of rows, each ending with a piece without an event; least values (r, 2, q)."""
    ends = (np.flatnonzero(rows.states[:, 1] == 0) + 1).tolist()
    return [
        Revolution(rows=cut(rows, first, last), least_gap=least[i, 0], least_force=least[i, 1])
        for i, (first, last) in enumerate(pairwise([0, *ends]))
    ]


def cut(rows: PieceRows, first: int, last: int | None) -> PieceRows:
    """Rows from the first up to the last, which is not among them; None: up to the end."""
    return PieceRows._make(part[first:last] for part in rows)


def joined(rows: list[PieceRows]) -> PieceRows:
    """Return rows one after another."""
    return PieceRows(*(np.concatenate(part) for part in zip(*rows, strict=True))) if rows[1:] else rows[0]


def copied(rows: PieceRows, k: int) -> PieceRows:
    """Copy the first k rows."""
    return PieceRows._make(part[:k].copy() for part in rows)


def longer(rows: PieceRows) -> PieceRows:
    """Return these rows, and room for as many again."""
    k, q = rows.given.shape
    found = piece_rows(2 * k, rows.motions.shape[2], q)
    for part, old in zip(found, rows, strict=True):
        part[:k] = old
    return found
