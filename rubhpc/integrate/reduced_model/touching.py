"""Contact modes of several stators: touching ones move with the rotor, the others as in the open set."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.reduced_model import reduction
from rubhpc.integrate.reduced_model.contact_mode import solve_contact_mode
from rubhpc.integrate.reduced_model.coupling import coupled_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.fem.model import Model
    from rubhpc.integrate.reduced_model.contact_mode import ContactMode, SlidingPairs
    from rubhpc.integrate.reduced_model.reduction import ReducedModel

    Floats = NDArray[np.float64]

Ints = NDArray[np.int64]


class Touching(NamedTuple):
    """Coordinates that closed pairs couple or the unbalance drives; shared eigenmodes of the open set."""

    pairs: Ints  # (r,), that are closed
    rows: Ints  # (n_own,), reduced coordinates
    spared: Ints  # eigenmodes of the open set, those of all other coordinates

    def model(self, reduced: ReducedModel) -> ReducedModel:
        """The model of these coordinates and pairs alone."""
        return reduced.part(self.rows, self.pairs)

    def of_pairs(self, rows: Floats) -> Floats:
        """Rows of the closed pairs (r, n_own), from those of all (q, n)."""
        return np.ascontiguousarray(rows[self.pairs[:, None], self.rows])

    def among_all(self, own: ContactMode, opened: ContactMode, n: int, q: int) -> ContactMode:
        """The contact mode of all bodies, from that of these alone and that with every pair open.

        Switch functions of open pairs stay zero. `n` and `q` count the coordinates and pairs of all.
        """
        first, states = own.n_eigenmode, np.concatenate([self.rows, n + self.rows])
        m = first + self.spared.size
        columns = np.concatenate([np.arange(first), [m], m + 1 + self.pairs])
        end = m + 1 + q
        exponent, motion = np.zeros(end, dtype=np.complex128), np.zeros((2 * n, end), dtype=np.complex128)
        exponent[columns], motion[states[:, None], columns] = own.exponent, own.motion
        exponent[first:m], motion[:, first:m] = opened.exponent[self.spared], opened.motion[:, self.spared]
        enter = np.zeros((m, 2 * n), dtype=np.complex128)
        enter[:first, states], enter[first:] = own.enter, opened.enter[self.spared]
        take_off = np.zeros((2 + q, m), dtype=np.complex128)
        take_off[np.append([0, 1], 2 + self.pairs), :first] = own.take_off
        switch = np.zeros((q, end), dtype=np.complex128)
        switch[self.pairs[:, None], columns] = own.switch
        return replace(own, exponent=exponent, motion=motion, enter=enter, take_off=take_off, switch=switch)


class OpenBodies:
    """Bodies that are uncoupled while every pair is open.

    Parameters
    ----------
    opened : ContactMode
        With every pair open.
    seen : (q, n)
        Nonzero where a pair sees or moves a coordinate.
    """

    def __init__(self, reduced: ReducedModel, opened: ContactMode, seen: Floats) -> None:
        self.opened, self._rows = opened, seen
        n = len(reduced.stiffness)
        parts = coupled_rows((reduced.stiffness != 0.0) | (reduced.damping != 0.0))
        self._part = np.empty(n, dtype=np.int64)  # of each coordinate
        for number, rows in enumerate(parts):
            self._part[rows] = number
        is_driven, is_seen = np.any(reduced.force != 0.0, axis=0), seen != 0.0
        self._driven = np.array([is_driven[rows].any() for rows in parts])
        self._seen = np.stack([is_seen[:, rows].any(axis=1) for rows in parts], axis=1)
        is_moved = opened.motion[:, : opened.n_eigenmode] != 0.0
        self._of_mode = self._part[(is_moved[:n] | is_moved[n:]).argmax(axis=0)]  # part of each eigenmode

    def at(self, reduced: ReducedModel, opened: ContactMode) -> OpenBodies:
        """The same bodies with other matrices."""
        return OpenBodies(reduced, opened, self._rows)

    def touching(self, pairs: Sequence[int] | Ints) -> Touching | None:
        """Bodies coupled by closing these pairs; None where these are all."""
        closed = np.array(pairs, dtype=np.int64)
        own = self._driven | self._seen[closed].any(axis=0)
        if own.all():
            return None
        return Touching(closed, np.flatnonzero(own[self._part]), np.flatnonzero(~own[self._of_mode]))


def mode_among(
    among: OpenBodies | None,
    reduced: ReducedModel,
    pairs: SlidingPairs,
    mask: int,
) -> ContactMode:
    """The contact mode of a set of closed pairs, solved for the bodies that touch where there are others."""
    closed, (q, n) = pairs.closed(mask), pairs.gap_jacobian.shape
    touching = among.touching(closed) if among and closed else None
    if among is None or touching is None:
        return solve_contact_mode(reduced, pairs.gap_jacobian, pairs.force_direction, mask)
    rates, forces = touching.of_pairs(pairs.gap_jacobian), touching.of_pairs(pairs.force_direction)
    own = solve_contact_mode(touching.model(reduced), rates, forces, (1 << len(closed)) - 1)
    mode = replace(touching.among_all(own, among.opened, n, q), mask=mask)
    others = np.setdiff1d(np.arange(q), closed)
    mode.switch[others] = pairs.gap_jacobian[others] @ mode.motion[:n]
    mode.switch[others, mode.n_eigenmode + 1 + others] += 1.0
    return mode


def open_bodies(reduced: ReducedModel, model: Model, opened: ContactMode) -> OpenBodies | None:
    """Open bodies of several stators; None for one stator, where nothing is saved."""
    gap_jacobian, _, slip = reduction.directions(reduced, model, 0.0)
    return OpenBodies(reduced, opened, np.abs(gap_jacobian) + np.abs(slip)) if len(slip) > 1 else None
