"""Initial states: rest in the sag, or a motion of another case adapted to the gaps of this one.

Overlaps are removed quasi-statically: rotor and stators move by their static shapes under the contact forces
that close the gaps, with the least strain energy. If the first step closed the gaps instead, it would throw
the bodies apart at micrometres per microsecond.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError
from rubhpc.fem.constraints import find_rigid_body_mode
from rubhpc.fem.model import state_size
from rubhpc.integrate.modal_setup import ModalSetup
from rubhpc.integrate.packing import degrees_of
from rubhpc.integrate.record import State
from rubhpc.kernels.complementarity import UNSOLVED
from rubhpc.kernels.contact_pairs import AXIAL, normal_and_gap
from rubhpc.kernels.lemke import solve_lemke

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.setup import Setup

    Floats = NDArray[np.float64]

TOLERANCE = 1e-12  # m, a hundred times the tolerance of the integrators: a continued run is not changed
PARTED = 1e-9  # m, beyond which a closed contact has opened
LEAST_FORCE = np.finfo(float).tiny  # N, least force that marks a contact as closed
MOST_PASSES = 20  # for the curved gap of the updated normal; three or four are usual


def fit_to_gaps(state: State, setup: Setup, clearance: float, softness: float = 0.0) -> State:
    """Return a state as the start of a case: no gap overlaps more than before, and none is pulled shut.

    Parameters
    ----------
    state : State
        Final state of another case; its `overlap` is that allowed by a penalty.
    clearance : float, m
        Radial clearance at rest; a stator's `clearance_offset` is added.
    softness : float, m/N
        Overlap that remains, over the force that closes a gap.

    Raises
    ------
    InputError
        The state is of a rig with other degrees of freedom, or the stators leave no room for the shaft.
    """
    if state.packed().size != state_size(setup.model):
        raise InputError(
            f"initial: a state of {state.packed().size} numbers for a rig of {state_size(setup.model)}; "
            "use it only for cases with the same degrees of freedom"
        )
    allowed = np.zeros_like(state.contact_force) if state.overlap is None else state.overlap
    displacement = _as_seen(state.displacement, setup)
    gap, gap_jacobian = gaps(displacement, setup, clearance)
    force = np.zeros_like(gap)
    if np.any(gap + allowed < -TOLERANCE):
        for _ in range(MOST_PASSES):
            shape = static_shapes(gap_jacobian.T, setup)
            compliance = gap_jacobian @ shape
            soft = compliance + softness * np.eye(force.size)
            wanted = _least_forces(soft, gap + allowed - compliance @ force)
            displacement, force = displacement + shape @ (wanted - force), wanted
            gap, gap_jacobian = gaps(displacement, setup, clearance)
            excess = gap + allowed + softness * force
            if np.all(excess >= -TOLERANCE) and np.all(excess[force > 0.0] <= TOLERANCE):
                break
        rotor, *stators = setup.model.split(displacement)
        state = replace(state, rotor_displacement=rotor, stator_displacement=tuple(stators))
    is_closed = (state.contact_force > 0.0) & (gap <= PARTED)
    return replace(state, contact_force=np.where(is_closed, state.contact_force + force, 0.0))


def at_rest(setup: Setup, clearance: float) -> State:
    """Return the shaft at rest under its constant loads, on stators that the sag reaches, without friction.

    Clearance in m; stators carry the weight that rests on them, and overlap under a penalty.
    """
    state = State.at_rest(setup.model)
    if not setup.model.sag.any():
        return state
    gap, _ = gaps(state.displacement, setup, clearance)
    state = replace(state, contact_force=np.where(gap < 0.0, LEAST_FORCE, 0.0))
    if not setup.law.stiffness > 0.0:
        return fit_to_gaps(state, setup, clearance)
    return with_overlap(fit_to_gaps(state, setup, clearance, 1.0 / setup.law.stiffness), setup, clearance)


def with_overlap(state: State, setup: Setup, clearance: float) -> State:
    """Return the final state of a case with the overlap of its gaps."""
    gap, _ = gaps(state.displacement, setup, clearance)
    return replace(state, overlap=np.maximum(-gap, 0.0))


def gaps(displacement: Floats, setup: Setup, clearance: float) -> tuple[Floats, Floats]:
    """Gap of each pair (q,), m, and its change with each degree of the bodies (q, n_dof)."""
    model = setup.model
    degree = degrees_of(model)
    gap, gap_jacobian = np.zeros(len(degree)), np.zeros((len(degree), displacement.size))
    for i, (stator, rows) in enumerate(zip(model.stators, degree, strict=True)):
        at = np.where(rows >= 0, displacement[rows], 0.0)
        body = slice(model.stator_start[i], model.stator_start[i] + stator.body.n_dof)
        drawn = np.zeros(stator.body.n_dof)
        if stator.squared_slope is not None:
            drawn = stator.squared_slope @ displacement[body]
            at[AXIAL] += 0.5 * displacement[body] @ drawn
        ey, ez = float(np.cos(stator.angle)), float(np.sin(stator.angle))
        reach = clearance + stator.clearance_offset
        ny, nz, gap[i] = normal_and_gap(ey, ez, stator.radius, reach, 0.0, setup.is_updated, at)
        change = np.array([-ny, -nz, 0.0, ny * ey + nz * ez, ny * -ez + nz * ey])
        gap_jacobian[i, rows[rows >= 0]] = change[rows >= 0]
        gap_jacobian[i, body] += change[AXIAL] * drawn
    return gap, gap_jacobian


def _as_seen(displacement: Floats, setup: Setup) -> Floats:
    """Displacement of all bodies that the integrator can represent in its reduced coordinates."""
    if not isinstance(setup, ModalSetup):
        return displacement
    n, sag = setup.model.rotor.n_dof, setup.model.sag
    moved = displacement.copy()
    moved[:n] -= sag
    seen: Floats = setup.reduced.basis @ (setup.reduced.project @ moved)
    seen[:n] += sag
    return seen


def static_shapes(force: Floats, setup: Setup) -> Floats:
    """Static displacements (n_dof, k) under forces (n_dof, k); free bodies follow by their inertia."""
    if isinstance(setup, ModalSetup):
        basis, stiffness = setup.reduced.basis, setup.reduced.stiffness
        shapes: Floats = basis @ np.linalg.solve(0.5 * (stiffness + stiffness.T), basis.T @ force)
        return shapes
    packed = setup.packed
    resisting = 0.5 * (packed.stiffness + packed.stiffness.T)
    if find_rigid_body_mode(setup.model):
        resisting = resisting + setup.spin**2 * packed.mass
    is_seen = packed.row >= 0
    ordered = np.zeros((len(resisting), force.shape[1]))
    ordered[packed.row[is_seen]] = force[is_seen]
    shapes = np.zeros_like(force)
    shapes[is_seen] = np.linalg.solve(resisting, ordered)[packed.row[is_seen]]
    return shapes


def _least_forces(compliance: Floats, gap: Floats) -> Floats:
    """Compressive forces (q,), N, that leave no gap below zero; some, where walls share them."""
    q = gap.size
    scale = np.abs(compliance).max()
    tableau = np.hstack([np.eye(q), -compliance / scale, -np.ones((q, 1)), gap[:, None]])
    basis = np.arange(q)
    if solve_lemke(tableau, basis, q) == UNSOLVED:
        raise InputError("initial: the stators leave no room for the shaft; take a larger clearance")
    force = np.zeros(2 * q + 1)
    force[basis] = np.maximum(tableau[:, -1], 0.0) / scale
    return force[q : 2 * q]
