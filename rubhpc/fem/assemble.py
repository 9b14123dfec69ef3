"""A rig's finite element model: the rotor, the forces on it and the stators."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import singledispatch
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.errors import InputError, located
from rubhpc.fem.carrier import assemble_carrier
from rubhpc.fem.model import MOST_DEGREES, Model, check_computable, computable
from rubhpc.fem.rotor import assemble_rotor
from rubhpc.fem.statics import at_rest_under, caught
from rubhpc.fem.stator import assemble_stator
from rubhpc.rig.rotors import Harmonic, Load, Unbalance
from rubhpc.rig.stators import Stator

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Body, CarrierModel, StatorModel
    from rubhpc.rig.rig import Rig
    from rubhpc.rig.rotors import AnyRotor
    from rubhpc.rig.stators import AnyStator

    Floats = NDArray[np.float64]


def assemble(rig: Rig) -> Model:
    """Assemble the finite element model of a rig.

    Where bearings depend on the speed, it is the rotor at standstill: at 0, or where a table does not begin
    there at its lowest speed. `model_at` gives it at another.

    The recorded node is the first stator's, or else the first disc's, or else the middle of the shaft; a
    `MatrixRotor` may name another one.

    Raises
    ------
    InputError
        When the values of the rig leave the floating-point range, or it has too many degrees of freedom.
    """
    with computable("[rotor]"):
        body = assemble_rotor(rig.rotor)
        constant, cosine, sine = forces_on(rig.rotor, body)
        harmonics = harmonics_on(rig.rotor, body)
    check_computable("[rotor]", body)
    if bores := {stator.node for stator in rig.stator if stator.is_bore}:
        body = caught(body, bores)
    stators: list[StatorModel] = []
    n_degree = body.n_dof
    for number, stator in enumerate(rig.stator, 1):
        if number > 1 and _is_turned(rig.stator[number - 2], stator):
            model = replace(stators[-1], angle=stator.angle)
        else:
            with computable(f"[stator.{number}]"):
                model = _stator(rig, stator)
            check_computable(f"[stator.{number}]", model.body)
        stators.append(model)
        n_degree += model.body.n_dof
        if n_degree > MOST_DEGREES:
            problem = f"rotor and {len(rig.stator)} stators have more than {MOST_DEGREES} degrees of freedom"
            raise InputError(f"rig {rig.name}: {problem}; use fewer elements")
    stators, carriers = _on_carriers(rig, stators)
    if rig.rotor.aligned_at is not None:
        stators = _set_about_the_shaft(stators, body, constant, rig.rotor.aligned_at)
    sag, film = at_rest_under(body, constant, 0.0)
    return Model(
        rotor=body,
        unbalance_cosine=cosine,
        unbalance_sine=sine,
        harmonics=harmonics,
        stators=tuple(stators),
        output_node=rig.rotor.recorded_node([stator.node for stator in rig.stator]),
        sag=sag,
        load=constant,
        film=film,
        carriers=tuple(carriers),
    )


def model_at(model: Model, spin: float) -> Model:
    """Return a model at a spin (rad/s): its rotor and sag where bearings depend on the speed, or itself.

    Raises
    ------
    InputError
        When the spin is outside the table of a bearing.
    """
    if model.rotor.by_speed is None:
        return model
    rotor = model.rotor.at(spin)
    sag, film = at_rest_under(rotor, model.load, spin)
    return replace(model, rotor=rotor, sag=sag, film=film)


def _set_about_the_shaft(
    stators: list[StatorModel], body: Body, load: NDArray[np.float64], spin: float
) -> list[StatorModel]:
    """Stators set about the centre of the shaft where it rests under its loads at a spin, rad/s."""
    with located("[rotor] clearance_from: "):
        turning = body.at(spin)
    sag, _ = at_rest_under(turning, load, spin)
    placed = []
    for stator in stators:
        (v, w), (y, z) = turning.at_node(stator.node, sag), stator.centre
        placed.append(replace(stator, centre=(float(v + y), float(w + z))))
    return placed


def _on_carriers(rig: Rig, stators: list[StatorModel]) -> tuple[list[StatorModel], list[CarrierModel]]:
    """Put the stators that stand on carriers there; all stators, and the carriers."""
    placed, carriers = list(stators), []
    for number, carrier in enumerate(rig.carrier, 1):
        on_it = [
            (i, stator, model)
            for i, (stator, model) in enumerate(zip(rig.stator, stators, strict=True), 1)
            if stator.carrier == carrier.name
        ]
        with computable(f"[carrier.{number}]"):
            whole, moved = assemble_carrier(carrier, on_it)
        check_computable(f"[carrier.{number}]", whole.body)
        carriers.append(whole)
        for (i, _, _), model in zip(on_it, moved, strict=True):
            placed[i - 1] = model
    return placed, carriers


def _is_turned(before: AnyStator, stator: AnyStator) -> bool:
    """Whether a cantilever is the one before it turned about the shaft, as in a ring: they share a body."""
    if type(stator) is not Stator or type(before) is not Stator:
        return False
    names = (field.name for field in fields(stator) if field.name != "angle")
    return all(getattr(before, name) == getattr(stator, name) for name in names)


def _stator(rig: Rig, stator: AnyStator) -> StatorModel:
    radius = rig.contact_radius(stator)
    assert radius is not None  # a rig refuses a stator whose contact radius is unknown
    return assemble_stator(stator, radius)


class Lateral(NamedTuple):
    """Force on (v, w) of a node: `constant + spin^2 (cosine cos(spin t) + sine sin(spin t))`, N and kg m."""

    constant: tuple[float, float] = (0.0, 0.0)
    cosine: tuple[float, float] = (0.0, 0.0)
    sine: tuple[float, float] = (0.0, 0.0)


@singledispatch
def lateral_force(force: object) -> Lateral:
    """Return the force on its node; register a function for each kind of force of `rubhpc.rig.rotors`."""
    raise TypeError(f"no lateral force for {type(force).__name__}")


@lateral_force.register(Unbalance)
def _(force: Unbalance) -> Lateral:
    """`m e spin^2 (cos(spin t + phase), sin(spin t + phase))`."""
    moment = force.mass * force.radius
    along, across = moment * np.cos(force.phase), moment * np.sin(force.phase)
    return Lateral(cosine=(along, across), sine=(-across, along))


@lateral_force.register(Load)
def _(force: Load) -> Lateral:
    return Lateral(constant=(force.vertical, force.horizontal))


@lateral_force.register(Harmonic)
def _(force: Harmonic) -> Lateral:
    """Nothing: its order is its own (`harmonics_on`)."""
    return Lateral()


def harmonics_on(rotor: AnyRotor, body: Body) -> tuple[tuple[int, NDArray[np.complex128]], ...]:
    """Phasors (n_dof,), N, of the harmonics by order: `F (cos(n spin t + phase), sin(n spin t + phase))`."""
    found: dict[int, NDArray[np.complex128]] = {}
    for force in rotor.harmonic:
        phasor = found.setdefault(force.order, np.zeros(body.n_dof, dtype=np.complex128))
        for name, turn in (("v", 1.0), ("w", -1j)):
            row = body.index(rotor.node_of(force), name)
            if row >= 0:
                phasor[row] += force.force * turn * np.exp(1j * force.phase)
    return tuple(sorted(found.items()))


def forces_on(rotor: AnyRotor, body: Body) -> tuple[Floats, Floats, Floats]:
    """Forces on a rotor, (n_dof,) each: constant (N), and the factors of spin^2 cos and spin^2 sin (kg m).

    Gravity acts along -v on every mass, `-g M e` with e = 1 on every "v". A component along which a node is
    constrained has no effect.
    """
    upwards = np.array([float(name == "v") for _, name in body.degrees])
    cosine, sine = np.zeros((2, body.n_dof))
    constant: Floats = -rotor.gravity * (body.mass @ upwards)
    for _, force in rotor.node_forces():
        parts = lateral_force(force)
        for i_direction, name in enumerate(("v", "w")):
            row = body.index(rotor.node_of(force), name)
            if row >= 0:
                constant[row] += parts.constant[i_direction]
                cosine[row] += parts.cosine[i_direction]
                sine[row] += parts.sine[i_direction]
    return constant, cosine, sine
