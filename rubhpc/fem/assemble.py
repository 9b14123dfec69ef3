"""A rig's finite element model: the rotor, its unbalance and the stators around it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rubhpc.errors import InputError
from rubhpc.fem.model import Model
from rubhpc.fem.rotor import assemble_rotor, unbalance_vectors
from rubhpc.fem.stator import assemble_stator

if TYPE_CHECKING:
    from rubhpc.rig import Rig


def assemble(rig: Rig) -> Model:
    """Assemble the finite element model of a rig.

    The recorded node is the first stator's, or else the first disc's, or else the middle of the shaft.

    Raises
    ------
    InputError
        If something sits on a node that the shaft does not have, or a stator's radius of contact
        can be read neither from its table nor from a disc.
    """
    _check_nodes(rig)
    body = assemble_rotor(rig.rotor)
    cosine, sine = unbalance_vectors(rig.rotor, body)
    seats = [stator.node for stator in rig.stator] + [disc.node for disc in rig.rotor.disc]
    return Model(
        rotor=body,
        unbalance_cosine=cosine,
        unbalance_sine=sine,
        stators=tuple(
            assemble_stator(stator, _contact_radius(rig, number))
            for number, stator in enumerate(rig.stator, start=1)
        ),
        output_node=seats[0] if seats else _n_node(rig) // 2 + 1,
    )


def _n_node(rig: Rig) -> int:
    return 1 + sum(section.elements for section in rig.rotor.shaft)


def _check_nodes(rig: Rig) -> None:
    last = _n_node(rig)
    rotor = rig.rotor
    drive = rotor.torsion.node if rotor.torsion.fixed_node is None else rotor.torsion.fixed_node
    seats = {
        "[[rotor.disc]]": [disc.node for disc in rotor.disc],
        "[[rotor.bearing]]": [bearing.node for bearing in rotor.bearing],
        "[[rotor.unbalance]]": [unbalance.node for unbalance in rotor.unbalance],
        "[rotor.torsion]": [drive],
        "[[stator]]": [stator.node for stator in rig.stator],
    }
    for table, nodes in seats.items():
        for node in nodes:
            if not 1 <= node <= last:
                raise InputError(
                    f"{rig.name}: {table} node: {node} is off the shaft; its nodes are 1 to {last}"
                )


def _contact_radius(rig: Rig, number: int) -> float:
    """Radius (m) at which stator `number`, from 1, touches: its own, or its node's largest disc's."""
    stator = rig.stator[number - 1]
    if stator.radius is not None:
        return stator.radius
    diameters = [
        disc.diameter for disc in rig.rotor.disc if disc.node == stator.node and disc.diameter is not None
    ]
    if not diameters:
        raise InputError(
            f"{rig.name}: [[stator]] {number} radius: no disc of known diameter at node {stator.node};"
            " give the stator a radius or the disc a diameter"
        )
    return max(diameters) / 2
