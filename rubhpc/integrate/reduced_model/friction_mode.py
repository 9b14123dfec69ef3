"""Motion of a reduced model with pairs that are open, slide in either sense or stick, in closed form."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.reduced_model.contact_mode import (
    ContactMode,
    Places,
    confine,
    confined_modes,
    damped,
    steady_response,
)
from rubhpc.integrate.reduced_model.products import expanded, real_times
from rubhpc.integrate.reduced_model.secular_modes import Contact
from rubhpc.kernels.friction_states import BACKWARD, OPEN, STUCK, lifted_place

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.integrate.reduced_model.reduction import ReducedModel
    from rubhpc.integrate.reduced_model.secular_modes import Within
    from rubhpc.integrate.reduced_model.system_modes import Solved

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]
    Complexes = NDArray[np.complex128]


@dataclass(frozen=True, kw_only=True, eq=False)
class FrictionMode(ContactMode):
    """Motion with a state for each pair, `x = Re(motion @ z)`.

    In addition to the coordinates of a contact mode there are a constant 1, and for each sticking pair the
    displacement phi along its rim, m, which grows as the rim moves: m + 1 + q + 1 + q in all. `mask` has two
    bits per pair (`kernels.friction_states`), `switch` two rows a pair; `enter` (all, 2 n) and `take_off` (3
    + q, all) include phi, and subtract the response to the rims' speed.
    """

    n_mode: int
    growth: Floats  # (m + 2 + 2 q,), m/s, of the coordinates phi; zero elsewhere

    @property
    def n_eigenmode(self) -> int:
        """Number of eigenmodes among the coordinates, m."""
        return self.n_mode

    @property
    def drift(self) -> Floats:
        """Rates of linearly growing coordinates, m/s."""
        return self.growth

    @classmethod
    def places(cls, own: int, m: int, q: int, pairs: Ints) -> Places:
        """Places of `own` eigenmodes and these pairs (r,) among m eigenmodes and q pairs."""
        one = m + 1 + q
        return Places(
            coordinate=np.concatenate([np.arange(own), [m], m + 1 + pairs, [one], one + 1 + pairs]),
            take_off=np.concatenate([[0, 1], 2 + pairs, [2 + q]]),
            switch=(2 * pairs[:, None] + np.arange(2)).ravel(),
        )

    def other_fields(self, columns: Ints, m: int, end: int) -> dict[str, Any]:
        """Further fields of a contact mode with m eigenmodes and `end` coordinates."""
        growth = np.zeros(end)
        growth[columns] = self.growth
        return {"n_mode": m, "growth": growth}


@dataclass(frozen=True, kw_only=True, eq=False)
class FrictionPairs:
    """The q pairs of a friction, in reduced coordinates."""

    gap_jacobian: Floats  # (q, n)
    friction_direction: Floats  # (q, n), force of a unit friction; its negative is the slip with the motion
    friction: float
    static_ratio: float  # coefficient at rest over that in sliding
    rim_speed: Floats  # (q,), m/s, not negative
    stiffness: float = 0.0  # N/m, of a penalty; 0: closed gaps are constraints
    damping: float = 0.0  # N s/m, of a penalty

    def closed(self, mask: int) -> list[int]:
        """Pairs that are closed in a set of states."""
        return [i for i, state in enumerate(states_of(mask, len(self.gap_jacobian))) if state != OPEN]

    def damped(self, reduced: ReducedModel, mask: int) -> ReducedModel:
        """The model with the penalty's dampers of the closed pairs."""
        return (
            damped(reduced, self.damping, self.gap_jacobian[self.closed(mask)]) if self.stiffness else reduced
        )

    def friction_forces(self, mode: ContactMode) -> Complexes:
        """Friction forces on the motion with each coordinate of a mode, (n, m + 2 + 2 q), N."""
        closed = self.closed(mode.mask)
        traction = np.zeros((len(closed), mode.exponent.size), dtype=np.complex128)
        states = states_of(mode.mask, len(self.gap_jacobian))
        for along, i in zip(traction, closed, strict=True):
            first, second = mode.switch[2 * i], mode.switch[2 * i + 1]
            if states[i] == STUCK:
                along[:] = 0.5 * (second - first)
            else:
                along[:] = (-self.friction if states[i] == BACKWARD else self.friction) * first
        forces: Complexes = self.friction_direction[closed].T @ traction
        return forces


def states_of(mask: int, q: int) -> list[int]:
    """States of the q pairs in a set of states."""
    return [mask >> 2 * i & 3 for i in range(q)]


def mask_of(states: Sequence[int]) -> int:
    """Set of states, two bits a pair."""
    return sum(int(state) << 2 * i for i, state in enumerate(states))


def solve_friction_mode(
    reduced: ReducedModel,
    pairs: FrictionPairs,
    mask: int,
    known: Solved | None = None,
    opened: Within | None = None,
) -> FrictionMode:
    """Solve the linear system with the pairs in the states of `mask`.

    A closed gap and a sticking slip are constraints `R x = c(t)`, where c has the clearances and the
    displacements phi, which grow as the rims move. With `x = T y + E c`, `R T = 0`, the projection of the
    equations on L, `L^T B = 0`, removes the forces. B are their directions: the normal force of a sliding
    pair includes its friction, that of a sticking pair does not. Under a penalty gaps are not constraints:
    `k P Q` and `c P Q` are added to the matrices, and `-k P` is the load of the clearances, as in
    `pressed_mode`. `opened` are the bodies with every pair open.
    """
    n, q = reduced.stiffness.shape[0], len(pairs.gap_jacobian)
    states = np.array(states_of(mask, q))
    closed, stuck = np.flatnonzero(states != OPEN), np.flatnonzero(states == STUCK)
    held, soft = (closed[:0], closed) if pairs.stiffness else (closed, closed[:0])
    sense = np.where(states == STUCK, 0.0, np.where(states == BACKWARD, -1.0, 1.0))[closed]
    rows = np.vstack([pairs.gap_jacobian[held], pairs.friction_direction[stuck]])
    pressed = pairs.gap_jacobian[closed] + pairs.friction * sense[:, None] * pairs.friction_direction[closed]
    contacts: list[Contact] = []
    if soft.size:
        spring = pairs.stiffness, pairs.damping
        contacts += [
            Contact(pairs.gap_jacobian[i], along, *spring) for i, along in zip(soft, pressed, strict=True)
        ]
        along = pressed.T @ pairs.gap_jacobian[soft]
        reduced = replace(
            reduced,
            stiffness=reduced.stiffness + pairs.stiffness * along,
            damping=reduced.damping + pairs.damping * along,
        )
    force = np.vstack([pressed[: held.size], pairs.friction_direction[stuck]]).T
    tangent, project, system = confine(reduced, rows, force)
    contacts += map(Contact, rows, force.T)
    n_free, n_held, n_row = tangent.shape[1], held.size, len(rows)
    exponent, moved, inverse = confined_modes(tangent, system, contacts, opened, known)
    m = exponent.size
    phasor = reduced.force[0] - 1j * reduced.force[1]
    lower = np.concatenate([np.zeros(n_free), project @ phasor])
    response = steady_response(system, reduced.spin, lower, q)
    expand = np.zeros((2 * n, 2 * n_free))
    expand[:n, :n_free] = expand[n:, n_free:] = tangent
    end = m + 2 + 2 * q
    clear, one, ahead = m + 1 + closed, m + 1 + q, m + 2 + q + stuck
    growth = np.zeros(end)
    growth[ahead] = pairs.rim_speed[stuck]
    motion = np.zeros((2 * n, end), dtype=np.complex128)
    motion[:, :m], motion[:, m] = moved, expand @ response
    enter, take_off = np.zeros((end, 2 * n), dtype=np.complex128), np.zeros((3 + q, end), dtype=np.complex128)
    enter[:m] = expanded(tangent, inverse.T).T
    take_off[0, :m], take_off[1, :m] = inverse @ response.real, -inverse @ response.imag
    switch = np.zeros((2 * q, end), dtype=np.complex128)
    forces = np.zeros((n_row, end), dtype=np.complex128)
    if n_row:
        # Quasi-static: y = constant @ c + ramp, both in closed form because c grows linearly.
        offset, speed = np.linalg.pinv(rows), np.concatenate([np.zeros(n_held), pairs.rim_speed[stuck]])
        pulled, drawn = project @ reduced.stiffness, project @ reduced.damping
        constant = -np.linalg.solve(pulled @ tangent, pulled @ offset)
        ramp = -np.linalg.solve(pulled @ tangent, drawn @ (tangent @ constant + offset) @ speed)
        still = tangent @ constant + offset
        motion[:n, m + 1 + held], motion[:n, ahead] = -still[:, :n_held], still[:, n_held:]
        motion[:n, one], motion[n:, one] = tangent @ ramp, still @ speed
        into = inverse[:, :n_free] @ constant  # (m, n_row)
        enter[:m, :n] -= into[:, n_held:] @ pairs.friction_direction[stuck]
        enter[ahead, :n] = pairs.friction_direction[stuck]
        take_off[2 + held, :m] = -into[:, :n_held].T
        take_off[2 + q, :m] = inverse @ np.concatenate([ramp, constant @ speed])
    if soft.size:
        load = -pairs.stiffness * pressed.T  # (n, closed), of unit clearances
        yielding = np.linalg.solve(project @ reduced.stiffness @ tangent, project @ load)
        motion[:n, clear] = tangent @ yielding
        take_off[2 + closed, :m] = (inverse[:, :n_free] @ yielding).T
    if n_row:
        reaction = np.linalg.solve(rows @ force, rows)
        forces += reaction @ real_times(np.hstack([reduced.stiffness, reduced.damping]), motion)
        forces[:, m] -= reaction @ phasor
        if soft.size:
            forces[:, clear] -= reaction @ load
    if soft.size:
        gap, gap_rate = pairs.gap_jacobian @ motion[:n], pairs.gap_jacobian @ motion[n:]
        gap[np.arange(q), m + 1 + np.arange(q)] += 1.0
        springs = -pairs.stiffness * gap[soft] - pairs.damping * gap_rate[soft]
        forces = np.concatenate([springs, forces]).astype(np.complex128)
    static = pairs.friction * pairs.static_ratio
    for a, i in enumerate(closed):
        if states[i] == STUCK:
            traction = forces[closed.size + np.searchsorted(stuck, i)]
            switch[2 * i], switch[2 * i + 1] = (
                static * forces[a] - traction,
                static * forces[a] + traction,
            )
        else:
            slip = -pairs.friction_direction[i] @ motion[n:]
            slip[one] += pairs.rim_speed[i]
            switch[2 * i], switch[2 * i + 1] = forces[a], sense[a] * slip
    watch_open_pairs(switch, motion, pairs, mask, m)
    return FrictionMode(
        mask=mask,
        exponent=np.concatenate([exponent, [1j * reduced.spin], np.zeros(1 + 2 * q)]),
        motion=motion,
        enter=enter,
        take_off=take_off,
        switch=switch,
        n_mode=m,
        growth=growth,
    )


def watch_open_pairs(switch: Complexes, motion: Complexes, pairs: FrictionPairs, mask: int, m: int) -> None:
    """Fill in the switch functions of open pairs: their gaps, or the tension of lifted ones, and 1."""
    q, n = pairs.gap_jacobian.shape
    watched = np.flatnonzero(np.array(states_of(mask, q)) == OPEN)
    switch[2 * watched] = pairs.gap_jacobian[watched] @ motion[:n]
    switch[2 * watched, m + 1 + watched] += 1.0
    switch[2 * watched + 1, m + 1 + q] = 1.0
    for i in watched:
        if mask >> lifted_place(q, int(i)) & 1:
            gap_rate = pairs.gap_jacobian[i] @ motion[n:]
            switch[2 * i] = pairs.stiffness * switch[2 * i] + pairs.damping * gap_rate
