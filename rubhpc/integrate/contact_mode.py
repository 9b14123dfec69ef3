"""Motion of a reduced model with one set of contacts closed, in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag, null_space
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from rubhpc.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.reduction import ReducedModel

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]

WORST_CONDITION = 1e11  # of the eigenvectors; beyond it modes coincide and their sum loses its digits


@dataclass(frozen=True, kw_only=True, eq=False)
class Phase:
    """Motion with one set of pairs closed: `x = Re(motion @ z)`, x (2 n,) displacements, then velocities.

    To the m modes come the unbalance response, z = exp(i angle), and the clearances of the q pairs, z in m.
    """

    mask: int
    exponent: Complexes  # (m + 1 + q,), 1/s
    motion: Complexes  # (2 n, m + 1 + q)
    enter: Complexes  # (m, 2 n)
    take_off: Complexes  # (2 + q, m), of the unbalance response, times cosine and sine; of unit clearances
    switch: Complexes  # (q, m + 1 + q), gap of an open pair or force of a closed one


def make_phase(reduced: ReducedModel, push: Floats, pull: Floats, mask: int) -> Phase:
    """Solve the linear system with the pairs of `mask` closed.

    Closed gaps confine the motion to `x = x0 + T y` with `push T = 0`; the contact forces drop out of the
    equations projected on L with `L^T pull^T = 0`, and follow from the accelerations of the gaps being zero
    (the constraint of Eq. 18 of the paper, differentiated twice).

    Raises
    ------
    InputError
        Where eigenvectors coincide (rigid-body motion, exactly critical damping).
    """
    n, q = reduced.stiffness.shape[0], push.shape[0]
    closed = np.array([i for i in range(q) if mask >> i & 1], dtype=int)
    rate, force = push[closed], pull[closed].T
    tangent, left = _null_space(rate), _null_space(force.T)
    offset = np.zeros((q, n))  # displacement that closes a unit clearance
    if closed.size:
        offset[closed] = -np.linalg.pinv(rate).T
    n_free = tangent.shape[1]
    project = np.linalg.solve(left.T @ tangent, left.T)
    system = np.block(
        [
            [np.zeros((n_free, n_free)), np.eye(n_free)],
            [-project @ reduced.stiffness @ tangent, -project @ reduced.damping @ tangent],
        ]
    )
    exponent, shape, inverse = _modes(system)
    phasor = reduced.force[0] - 1j * reduced.force[1]
    lower = np.concatenate([np.zeros(n_free), project @ phasor])
    response = np.linalg.solve(1j * reduced.spin * np.eye(2 * n_free) - system, lower)
    constant = np.zeros((q, 2 * n_free))
    if closed.size:
        load = -project @ reduced.stiffness @ offset[closed].T
        constant[closed] = -np.linalg.solve(system, np.vstack([np.zeros_like(load), load])).T
    expand = block_diag(tangent, tangent)
    still = constant @ expand.T + np.hstack([offset, np.zeros((q, n))])  # (q, 2 n)
    motion = np.hstack([expand @ shape, (expand @ response)[:, None], still.T])
    clear = np.hstack([np.zeros((q, exponent.size + 1)), np.eye(q)])
    switch = push @ motion[:n] + clear
    if closed.size:
        reaction = np.linalg.solve(rate @ force, rate)
        switch[closed] = reaction @ (np.hstack([reduced.stiffness, reduced.damping]) @ motion)
        switch[closed, exponent.size] -= reaction @ phasor
    entry = constant + np.hstack([offset @ tangent, np.zeros((q, n_free))])
    return Phase(
        mask=mask,
        exponent=np.concatenate([exponent, [1j * reduced.spin], np.zeros(q)]),
        motion=motion,
        enter=inverse @ expand.T,
        take_off=np.vstack([inverse @ response.real, -inverse @ response.imag, entry @ inverse.T]),
        switch=switch,
    )


def _null_space(rows: Floats) -> Floats:
    """Orthonormal columns that `rows` (r, n) take to zero; coordinates unseen by them stay as they are."""
    seen = np.flatnonzero(np.any(rows != 0.0, axis=0))
    unseen = np.flatnonzero(np.all(rows == 0.0, axis=0))
    inside = null_space(rows[:, seen]) if seen.size else np.zeros((0, 0))
    columns = np.zeros((rows.shape[1], inside.shape[1] + unseen.size))
    columns[seen, : inside.shape[1]] = inside
    columns[unseen, np.arange(inside.shape[1], columns.shape[1])] = 1.0
    return columns


def _modes(system: Floats) -> tuple[Complexes, Complexes, Complexes]:
    """Exponents, shapes and inverse shapes of a first-order system; one of each conjugate pair, doubled.

    What nothing couples is solved by itself: of a ring of stators only those that touch move with the rotor.
    """
    n_state = len(system)
    _, part = connected_components(csr_array(system != 0.0), directed=False)
    exponents: list[Complexes] = [np.zeros(0, dtype=np.complex128)]  # a mass on a rigid wall has no modes
    shapes, inverses = [np.zeros((n_state, 0))], [np.zeros((0, n_state))]
    for number in np.unique(part):
        rows = np.flatnonzero(part == number)
        exponent, shape = np.linalg.eig(system[np.ix_(rows, rows)])
        if np.linalg.cond(shape) > WORST_CONDITION:
            raise InputError(
                "[integrator] method: modal cannot part the modes of this rig, some of which coincide (a "
                'free body, critical damping); take method = "central-difference"'
            )
        is_real = np.abs(exponent.imag) <= 1e-12 * np.abs(exponent).max()
        keep = is_real | (exponent.imag > 0.0)
        weight = np.where(is_real, 1.0, 2.0)
        wide, tall = np.zeros((2, n_state, np.count_nonzero(keep)), dtype=np.complex128)
        wide[rows], tall[rows] = (shape * weight)[:, keep], np.linalg.inv(shape)[keep].T
        exponents.append(exponent[keep].astype(np.complex128))
        shapes.append(wide)
        inverses.append(tall.T)
    return np.concatenate(exponents), np.hstack(shapes), np.vstack(inverses)
