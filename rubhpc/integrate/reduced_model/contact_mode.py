"""Motion of a reduced model with one set of sliding contacts closed, in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from rubhpc.integrate.reduced_model.system_modes import modes_of, parts_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.reduced_model.reduction import ReducedModel

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]
    Complexes = NDArray[np.complex128]


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactMode:
    """Motion with one set of pairs closed: `x = Re(motion @ z)`, x (2 n,) displacements, then velocities.

    To the m modes come the unbalance response, z = exp(i angle), and the clearances of the q pairs, z in m.
    """

    mask: int
    exponent: Complexes  # (m + 1 + q,), 1/s
    motion: Complexes  # (2 n, m + 1 + q)
    enter: Complexes  # (m, 2 n)
    take_off: Complexes  # (2 + q, m), of the unbalance response, times cosine and sine; of unit clearances
    switch: Complexes  # (q, m + 1 + q), gap of an open pair or force of a closed one

    @property
    def n_eigenmode(self) -> int:
        """Number of eigenmodes among the coordinates, m."""
        return len(self.enter)


def solve_contact_mode(
    reduced: ReducedModel,
    gap_jacobian: Floats,
    force_direction: Floats,
    mask: int,
) -> ContactMode:
    """Solve the linear system with the pairs of `mask` closed.

    With J the gap Jacobian and F the contact-force directions of the closed pairs, closed gaps confine the
    motion to `x = x0 + T y` with `J T = 0`. The equations are projected on L with `L^T F^T = 0`, which
    removes the contact forces. These follow from zero accelerations of the gaps (the constraint of Eq. 18 of
    the paper, differentiated twice).

    Raises
    ------
    InputError
        Where eigenvectors coincide (rigid-body motion, exactly critical damping).
    """
    n, q = reduced.stiffness.shape[0], gap_jacobian.shape[0]
    closed = np.array([i for i in range(q) if mask >> i & 1], dtype=int)
    rate, force = gap_jacobian[closed], force_direction[closed].T
    tangent, project, system = confine(reduced, rate, force)
    offset = np.zeros((q, n))  # displacement that closes a unit clearance
    if closed.size:
        offset[closed] = -np.linalg.pinv(rate).T
    n_free = tangent.shape[1]
    exponent, shape, inverse = modes_of(system)
    phasor = reduced.force[0] - 1j * reduced.force[1]
    lower = np.concatenate([np.zeros(n_free), project @ phasor])
    response = steady_response(system, reduced.spin, lower, q)
    constant = np.zeros((q, 2 * n_free))
    if closed.size:
        load = -project @ reduced.stiffness @ offset[closed].T
        constant[closed] = _at_rest(system, load, q).T
    expand = np.zeros((2 * n, 2 * n_free))
    expand[:n, :n_free] = expand[n:, n_free:] = tangent
    still = constant @ expand.T + np.hstack([offset, np.zeros((q, n))])  # (q, 2 n)
    motion = np.hstack([expand @ shape, (expand @ response)[:, None], still.T])
    clear = np.hstack([np.zeros((q, exponent.size + 1)), np.eye(q)])
    switch = gap_jacobian @ motion[:n] + clear
    if closed.size:
        reaction = np.linalg.solve(rate @ force, rate)
        switch[closed] = reaction @ (np.hstack([reduced.stiffness, reduced.damping]) @ motion)
        switch[closed, exponent.size] -= reaction @ phasor
    entry = constant + np.hstack([offset @ tangent, np.zeros((q, n_free))])
    return ContactMode(
        mask=mask,
        exponent=np.concatenate([exponent, [1j * reduced.spin], np.zeros(q)]),
        motion=motion,
        enter=inverse @ expand.T,
        take_off=np.vstack([inverse @ response.real, -inverse @ response.imag, entry @ inverse.T]),
        switch=switch,
    )


def steady_response(system: Floats, spin: float, load: Complexes, q: int) -> Complexes:
    """Coordinates and rates (2 n_free,) under a load (2 n_free,) that turns with the shaft.

    The load drives rates alone. With several pairs (q) each uncoupled part is solved separately.
    """
    response, n = np.zeros(len(system), dtype=np.complex128), len(system) // 2
    if q <= 1:
        whole = 1j * spin * np.eye(2 * n) - system
        return np.asarray(np.linalg.solve(whole, load)) if np.any(load) else response
    for rows in parts_of(system, q):
        if np.any(load[rows] != 0.0):
            first = rows[rows < n]
            second = n + first
            stiffness, damping = -system[second[:, None], first], -system[second[:, None], second]
            turned = stiffness + 1j * spin * damping - spin**2 * np.eye(first.size)
            response[first] = np.linalg.solve(turned, load[second])
            response[second] = 1j * spin * response[first]
    return response


def _at_rest(system: Floats, load: Floats, q: int) -> Floats:
    """Static coordinates and rates (2 n_free, k) under loads (n_free, k), each part separately."""
    found, n = np.zeros((len(system), load.shape[1])), len(load)
    if q <= 1:
        return -np.asarray(np.linalg.solve(system, np.vstack([np.zeros_like(load), load])))
    for rows in parts_of(system, q):
        first = rows[rows < n]
        if np.any(load[first] != 0.0):
            found[first] = np.linalg.solve(-system[n + first[:, None], first], load[first])
    return found


def confine(reduced: ReducedModel, rate: Floats, force: Floats) -> tuple[Floats, Floats, Floats]:
    """Motions that keep gaps closed T (n, n_free), projection that removes contact forces, and the system.

    `rate` (r, n) is the gap Jacobian of the closed pairs and `force` (n, r) their contact-force directions;
    the system (2 n_free, 2 n_free) is that of the coordinates y and their rates.
    """
    n = reduced.stiffness.shape[0]
    system: Floats
    if not len(rate):
        whole, system = np.eye(n), np.zeros((2 * n, 2 * n))
        system[:n, n:], system[n:, :n], system[n:, n:] = whole, -reduced.stiffness, -reduced.damping
        return whole, whole, system
    tangent, project = left_free(rate, force)
    m = tangent.shape[1]
    system = np.zeros((2 * m, 2 * m))
    system[:m, m:] = np.eye(m)
    system[m:, :m] = -project @ reduced.stiffness @ tangent
    system[m:, m:] = -project @ reduced.damping @ tangent
    return tangent, project, system


def left_free(rate: Floats, force: Floats) -> tuple[Floats, Floats]:
    """Motions and projection of `confine`, which do not depend on the speed."""
    if not len(rate):
        return np.eye(len(force)), np.eye(len(force))
    tangent, left = _null_space(rate), _null_space(force.T)
    project = np.asarray(np.linalg.solve(left.T @ tangent, left.T), dtype=np.float64)
    return tangent, project


def _null_space(rows: Floats) -> Floats:
    """Orthonormal basis of the null space of `rows` (r, n); unaffected coordinates stay unchanged."""
    seen = np.flatnonzero(np.any(rows != 0.0, axis=0))
    unseen = np.flatnonzero(np.all(rows == 0.0, axis=0))
    inside = null_space(rows[:, seen]) if seen.size else np.zeros((0, 0))
    columns = np.zeros((rows.shape[1], inside.shape[1] + unseen.size))
    columns[seen, : inside.shape[1]] = inside
    columns[unseen, np.arange(inside.shape[1], columns.shape[1])] = 1.0
    return columns


class SlidingPairs(NamedTuple):
    """The q pairs of steady sliding, in reduced coordinates."""

    gap_jacobian: Floats  # (q, n)
    force_direction: Floats  # (q, n), force of a unit contact force, friction included

    def closed(self, mask: int) -> list[int]:
        """Closed pairs of a set."""
        return [i for i in range(len(self.gap_jacobian)) if mask >> i & 1]

    def friction_forces(self, mode: ContactMode) -> Complexes:
        """Friction forces on the motion with each coordinate of a mode, (n, m + 1 + q), N."""
        closed = self.closed(mode.mask)
        friction: Complexes = (self.force_direction - self.gap_jacobian)[closed].T @ mode.switch[closed]
        return friction
