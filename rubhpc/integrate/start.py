"""Start of a case: at rest, contact-free or at the final state of another; displaced or knocked."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from rubhpc.errors import InputError
from rubhpc.fem.response import check_response_node, steady_response
from rubhpc.fem.stability import instability_message
from rubhpc.integrate.initial_state import at_rest, fit_to_gaps, static_shapes
from rubhpc.integrate.record import State
from rubhpc.study.initial import CONTACT_FREE, REST

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.setup import Setup
    from rubhpc.study.initial import Initial

    Floats = NDArray[np.float64]


def start_of(initial: Initial, setup: Setup, clearance: float, spin: float | None = None) -> State:
    """Return the state in which a case starts, the unbalance at its phase 0.

    Parameters
    ----------
    initial : Initial
        Displacement and velocity of the output node, and an impulse, on top of a motion.
    clearance : float, m
        Radial clearance at rest; a stator's `clearance_offset` is added. Overlaps are removed
        (`initial_state.fit_to_gaps`).
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
    """The steady unbalance response about the sagged shaft at a speed, rad/s; no stator touches."""
    known, model = _shared(setup).contact_free, setup.model
    if spin not in known:
        if problem := instability_message(model, spin):
            raise InputError(f'[initial] from: {problem}; set from = "rest"')
        response = steady_response(model, spin)
        known[spin] = replace(
            State.at_rest(model),
            rotor_displacement=model.sag + response.real,
            rotor_velocity=(1j * spin * response).real,
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
