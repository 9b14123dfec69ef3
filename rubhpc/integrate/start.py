"""Start of a case: at rest, contact-free or at the end of another; displaced, knocked, fitted to gaps."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from rubhpc.errors import InputError
from rubhpc.fem.model import state_size
from rubhpc.fem.response import check_response_node, steady_lines
from rubhpc.fem.stability import instability_message
from rubhpc.fem.statics import rigid_body_row
from rubhpc.integrate.modal_setup import ModalSetup
from rubhpc.integrate.overlaps import gaps, with_overlap
from rubhpc.integrate.packing import normal_laws
from rubhpc.integrate.record import State
from rubhpc.kernels.complementarity import UNSOLVED
from rubhpc.kernels.laws import HERTZ
from rubhpc.kernels.lemke import solve_lemke
from rubhpc.study.initial import CONTACT_FREE, REST

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.setup import Setup
    from rubhpc.study.initial import Initial

    Floats = NDArray[np.float64]


TOLERANCE = 1e-12  # m, a hundred times the tolerance of the integrators: a continued run is not changed
PARTED = 1e-9  # m, beyond which a closed contact has opened
TURNED = 1e-10  # of the forces, by which they may have turned with their normals in the last pass
LEAST_FORCE = np.finfo(float).tiny  # N, least force that marks a contact as closed
MOST_PASSES = 100  # for curved gaps and springs; three or four are usual, in bores ten
SLOW, LEAST_TURN = 0.3, 0.01  # turn over that of the pass before, from which it is relaxed; share, at least


def fit_to_gaps(state: State, setup: Setup, clearance: float) -> State:
    """Return a state as the start of a case: no gap overlaps more than before, and none is pulled shut.

    Parameters
    ----------
    state : State
        Final state of another case; its `overlap` is that allowed by a penalty.
    clearance : float, m
        Radial clearance at rest; a stator's `clearance_offset` is added.

    Raises
    ------
    InputError
        The state is of a rig with other degrees of freedom, the stators leave no room for the shaft, or no
        start without overlap is found near the state.
    """
    if state.packed().size != state_size(setup.model):
        raise InputError(
            f"initial: a state of {state.packed().size} numbers for a rig of {state_size(setup.model)}; "
            "use it only for cases with the same degrees of freedom"
        )
    fitted, is_found = _fitted(state, setup, clearance)
    if not is_found:
        left, begun = (gaps(one.displacement, setup, clearance)[0] for one in (fitted, state))
        allowed = 0.0 if state.overlap is None else state.overlap
        if np.any(left + allowed < -PARTED):
            raise InputError(
                f"initial: this state overlaps by {-begun.min():.2g} m, and no start within the clearances "
                "is found near it; start nearer to them, or from rest"
            )
    return fitted


def _fitted(state: State, setup: Setup, clearance: float, *, is_soft: bool = False) -> tuple[State, bool]:
    """The state of `fit_to_gaps`, and whether its forces are found.

    Gaps that are soft give to the forces by the springs of the law.
    """
    allowed = np.zeros_like(state.contact_force) if state.overlap is None else state.overlap
    begin = displacement = _as_seen(state.displacement, setup)
    gap, gap_jacobian = gaps(displacement, setup, clearance)
    force, is_found = np.zeros_like(gap), not np.any(gap + allowed < -TOLERANCE)
    softness = np.zeros_like(gap)  # m/N
    share, last = 1.0, np.zeros_like(gap_jacobian)  # of the turn of normals that a pass takes
    if not is_found:
        for _ in range(MOST_PASSES):
            shape = static_shapes(gap_jacobian.T, setup)
            compliance = gap_jacobian @ shape + np.diag(softness)
            force = _least_forces(compliance, gap + allowed + gap_jacobian @ (begin - displacement))
            displacement = begin + shape @ force
            before = gap_jacobian
            softness = compression(setup, force) if is_soft else softness
            gap, gap_jacobian = gaps(displacement, setup, clearance)
            excess = gap + allowed + softness * force
            turn = gap_jacobian - before
            is_turned = np.abs(turn.T @ force).max() > TURNED * force.max()
            is_shut = np.all(excess >= -TOLERANCE) and np.all(excess[force > 0.0] <= TOLERANCE)
            if is_found := bool(is_shut and not is_turned):
                break
            change = turn - last
            is_slow = last.any() and change.any() and np.abs(turn).max() > SLOW * np.abs(last).max()
            if is_slow:  # Aitken's relaxation
                share *= -float(np.vdot(last, change) / np.vdot(change, change))
                share = min(max(share, LEAST_TURN), 1.0)
            gap_jacobian, last = before + share * turn, turn
        rotor, *stators = setup.model.split(displacement)
        state = replace(state, rotor_displacement=rotor, stator_displacement=tuple(stators))
    is_closed = (state.contact_force > 0.0) & (gap <= PARTED)
    state = replace(state, contact_force=np.where(is_closed, state.contact_force + force, 0.0))
    return state, is_found


def at_rest(setup: Setup, clearance: float) -> State:
    """Return the shaft at rest under its constant loads, on stators that it reaches, without friction.

    Clearance in m; stators carry the weight that rests on them, and the springs of a penalty give by it.

    Raises
    ------
    InputError
        The stators leave no room for the shaft, or do not hold it.
    """
    state = State.at_rest(setup.model)
    gap, _ = gaps(state.displacement, setup, clearance)
    if not np.any(gap < 0.0):
        return state
    state = replace(state, contact_force=np.full(gap.size, LEAST_FORCE))  # some may be pushed onto others
    is_soft = bool(np.any(normal_laws(setup.model, setup.law)["stiffness"] > 0.0))
    state, is_found = _fitted(state, setup, clearance, is_soft=is_soft)
    force = state.contact_force
    state = replace(state, contact_force=np.where(force > LEAST_FORCE, force, 0.0))
    is_held = isinstance(setup, ModalSetup) or not state.contact_force.any()  # the former takes no others
    if not is_held:
        pressed = gaps(state.displacement, setup, clearance)[1][state.contact_force > 0.0].any(axis=0)
        is_held = not np.any(pressed & _unheld(setup.model))
    if not (is_found and is_held):
        raise InputError(
            "initial: the shaft finds no rest on the stators that it reaches; constrain them, or set "
            'from = "contact_free"'
        )
    return with_overlap(state, setup, clearance) if is_soft else state


def compression(setup: Setup, force: Floats) -> Floats:
    """Compression of the springs of the laws under forces (q,), over these, m/N; none of multipliers."""
    laws = normal_laws(setup.model, setup.law)
    stiffness = np.where(laws["stiffness"] > 0.0, laws["stiffness"], np.inf)
    of_hertz = stiffness ** (-2 / 3) * np.maximum(force, LEAST_FORCE) ** (-1 / 3)
    found: Floats = np.where(
        laws["normal_law"] == HERTZ, np.where(force > 0.0, of_hertz, 0.0), 1.0 / stiffness
    )
    return found


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
        shapes: Floats = basis @ np.linalg.solve(stiffness, basis.T @ force)
        return shapes
    packed = setup.packed
    resisting, is_seen = packed.stiffness, packed.row >= 0
    unheld = np.zeros(len(resisting))
    unheld[packed.row[is_seen]] = _unheld(setup.model)[is_seen]
    resisting = resisting + setup.spin**2 * unheld[:, np.newaxis] * packed.mass
    ordered = np.zeros((len(resisting), force.shape[1]))
    ordered[packed.row[is_seen]] = force[is_seen]
    shapes = np.zeros_like(force)
    shapes[is_seen] = np.linalg.solve(resisting, ordered)[packed.row[is_seen]]
    return shapes


def _unheld(model: Model) -> NDArray[np.bool_]:
    """Degrees (n_all,) of parts with a rigid-body mode, which have no static displacement."""
    is_free = [np.zeros(body.n_dof, dtype=bool) for body in model.bodies]
    for body, rows in zip(model.bodies, is_free, strict=True):
        for number in range(body.part.max(initial=-1) + 1):
            is_part = body.part == number
            rows[is_part] = rigid_body_row(body, np.flatnonzero(is_part).tolist()) > 0
    return np.concatenate(is_free)


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


def start_of(initial: Initial, setup: Setup, clearance: float, spin: float | None = None) -> State:
    """Return the state in which a case starts, the unbalance at its phase 0.

    Parameters
    ----------
    initial : Initial
        Displacement and velocity of the output node, and an impulse, on top of a motion.
    clearance : float, m
        Radial clearance at rest; a stator's `clearance_offset` is added. Overlaps are removed
        (`fit_to_gaps`).
    spin : float, rad/s, optional
        Of the contact-free motion, by default that of the set-up; with changing speed, the first one.

    Raises
    ------
    InputError
        The rotor has no contact-free motion, the state of a store is of other bodies, the output node is held
        in a direction given, or the node of the impulse does not move sideways.
    """
    if initial.from_ == CONTACT_FREE:
        state = _contact_free(setup, setup.spin if spin is None else spin)
    elif initial.state is not None:
        initial.state.check_fit(setup.model)
        state = State.unpacked(initial.state.packed, setup.model)
    else:
        state = at_rest(setup, clearance)
    if initial.is_disturbed:
        state = _disturbed(state, initial, setup)
    elif initial.from_ == REST:
        return state
    return fit_to_gaps(state, setup, clearance)


@dataclass(eq=False)
class _Shared:
    """Results that the starts of a set-up share, computed when first needed."""

    shapes: dict[tuple[int, ...], Floats] = field(default_factory=dict)
    contact_free: dict[float, State] = field(default_factory=dict)  # by speed, rad/s


_SHARED: WeakKeyDictionary[Setup, _Shared] = WeakKeyDictionary()


def _shared(setup: Setup) -> _Shared:
    """Shared results of a set-up, as long as it is kept."""
    if setup not in _SHARED:
        _SHARED[setup] = _Shared()
    return _SHARED[setup]


def _contact_free(setup: Setup, spin: float) -> State:
    """Steady response to unbalance and harmonics about the sagged shaft at a speed (rad/s), not touching."""
    known, model = _shared(setup).contact_free, setup.model
    if spin not in known:
        if problem := instability_message(model, spin):
            raise InputError(f'[initial] from: {problem}; set from = "rest"')
        lines = steady_lines(model, spin)
        known[spin] = replace(
            State.at_rest(model),
            rotor_displacement=model.sag + sum(line.real for line in lines.values()),
            rotor_velocity=np.sum([(1j * order * spin * line).real for order, line in lines.items()], axis=0),
        )
    return known[spin]


def _disturbed(state: State, initial: Initial, setup: Setup) -> State:
    """A state with displacement, velocity and impulse added; closed contacts may part."""
    model = setup.model
    displacement, velocity = state.displacement, state.velocity
    moved = np.array([initial.vertical, initial.horizontal])
    moving = np.array([initial.vertical_velocity, initial.horizontal_velocity])
    if moved.any() or moving.any():
        wanted = tuple(np.flatnonzero((moved != 0.0) | (moving != 0.0)).tolist())
        shapes = _shared(setup).shapes
        if wanted not in shapes:
            shapes[wanted] = _shapes_of_output(setup, wanted)
        shape = shapes[wanted]
        displacement = displacement + shape @ moved
        velocity = velocity + shape @ moving
    if initial.impulse != 0.0:
        node = model.output_node if initial.impulse_node is None else initial.impulse_node
        rotor = np.linalg.solve(model.rotor.mass, _impulse(model, node, initial))
        velocity[: rotor.size] += rotor
    return State.of_bodies(model, displacement, velocity, np.zeros_like(state.contact_force), state.overlap)


def _shapes_of_output(setup: Setup, wanted: tuple[int, ...]) -> Floats:
    """Static shapes (n_dof, 2) of all bodies that move the output node by 1 m up, or sideways."""
    model = setup.model
    rows = [model.rotor.index(model.output_node, name) for name in ("v", "w")]
    for i in wanted:
        if rows[i] < 0:
            key = ("vertical", "horizontal")[i]
            raise InputError(
                f"[initial] {key}: the output node is constrained in this direction; leave it out"
            )
    free = [i for i in (0, 1) if rows[i] >= 0]
    seen = [rows[i] for i in free]
    force = np.zeros((model.body_start[-1], len(free)))
    force[seen, range(len(free))] = 1.0
    follows = static_shapes(force, setup)
    shape = np.zeros((len(force), 2))
    shape[:, free] = np.linalg.solve(follows[seen].T, follows.T).T
    return shape


def _impulse(model: Model, node: int, initial: Initial) -> Floats:
    """Impulse on the rotor, (n_rotor_dof,), N s."""
    check_response_node(model, node, "[initial] impulse_node")
    impulse = np.zeros(model.rotor.n_dof)
    for name, share in (("v", math.cos(initial.impulse_angle)), ("w", math.sin(initial.impulse_angle))):
        row = model.rotor.index(node, name)
        if row >= 0:
            impulse[row] = initial.impulse * share
    return impulse
