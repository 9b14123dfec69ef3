"""A rig's finite element model: the rotor, its unbalance and the stators around it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rubhpc.fem.model import Model
from rubhpc.fem.rotor import assemble_rotor, unbalance_vectors
from rubhpc.fem.stator import assemble_stator

if TYPE_CHECKING:
    from rubhpc.fem.model import StatorModel
    from rubhpc.rig import Rig, Stator


def assemble(rig: Rig) -> Model:
    """Assemble the finite element model of a rig.

    The recorded node is the first stator's, or else the first disc's, or else the middle of the shaft.
    """
    body = assemble_rotor(rig.rotor)
    cosine, sine = unbalance_vectors(rig.rotor, body)
    seats = [stator.node for stator in rig.stator] + [disc.node for disc in rig.rotor.disc]
    return Model(
        rotor=body,
        unbalance_cosine=cosine,
        unbalance_sine=sine,
        stators=tuple(_stator(rig, stator) for stator in rig.stator),
        output_node=seats[0] if seats else (rig.rotor.n_node + 1) // 2,
    )


def _stator(rig: Rig, stator: Stator) -> StatorModel:
    radius = rig.contact_radius(stator)
    assert radius is not None  # a rig refuses a stator over a rim of unknown radius
    return assemble_stator(stator, radius)
