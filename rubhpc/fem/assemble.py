"""A rig's finite element model: the rotor, its unbalance and the stators around it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rubhpc.fem.matrices import lumped_stator, matrix_rotor, matrix_stator
from rubhpc.fem.model import Model
from rubhpc.fem.rotor import assemble_rotor, unbalance_vectors
from rubhpc.fem.statics import constant_load, sag_under
from rubhpc.fem.stator import assemble_stator
from rubhpc.rig.matrices import MatrixRotor
from rubhpc.rig.stators import LumpedStator, MatrixStator

if TYPE_CHECKING:
    from rubhpc.fem.model import StatorModel
    from rubhpc.rig.rig import Rig
    from rubhpc.rig.stators import AnyStator


def assemble(rig: Rig) -> Model:
    """Assemble the finite element model of a rig.

    The recorded node is the first stator's, or else the first disc's, or else the middle of the shaft; a
    rotor of matrices may name another.
    """
    rotor = rig.rotor
    seats = [stator.node for stator in rig.stator]
    if isinstance(rotor, MatrixRotor):
        body = matrix_rotor(rotor)
        middle = next((node for node, name in rotor.degrees if name in ("v", "w")), 1)
        seats = [rotor.output_node] if rotor.output_node is not None else seats
    else:
        body = assemble_rotor(rotor)
        middle = (rotor.n_node + 1) // 2
        seats += [disc.node for disc in rotor.disc]
    cosine, sine = unbalance_vectors(rotor.unbalance, body)
    return Model(
        rotor=body,
        unbalance_cosine=cosine,
        unbalance_sine=sine,
        stators=tuple(_stator(rig, stator) for stator in rig.stator),
        output_node=seats[0] if seats else middle,
        sag=sag_under(body, constant_load(rotor, body)),
    )


def _stator(rig: Rig, stator: AnyStator) -> StatorModel:
    radius = rig.contact_radius(stator)
    assert radius is not None  # a rig refuses a stator over a rim of unknown radius
    if isinstance(stator, MatrixStator):
        return matrix_stator(stator, radius)
    if isinstance(stator, LumpedStator):
        return lumped_stator(stator, radius)
    return assemble_stator(stator, radius)
