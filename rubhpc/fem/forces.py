"""Forces at the nodes of a rotor as vectors on its degrees of freedom."""

from __future__ import annotations

from functools import singledispatch
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.rig.forces import Load, Unbalance

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Body
    from rubhpc.rig.rotors import AnyRotor

    Floats = NDArray[np.float64]


class Lateral(NamedTuple):
    """Force on (v, w) of a node: `constant + spin^2 (cosine cos(spin t) + sine sin(spin t))`, N and kg m."""

    constant: tuple[float, float] = (0.0, 0.0)
    cosine: tuple[float, float] = (0.0, 0.0)
    sine: tuple[float, float] = (0.0, 0.0)


@singledispatch
def lateral_force(force: object) -> Lateral:
    """Return the force on its node; register a function for each kind of force of `rubhpc.rig.forces`."""
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
