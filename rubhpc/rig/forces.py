"""Forces at the nodes of a rotor: unbalance, constant loads, weight."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, TypeAlias

from rubhpc.input.fields import FieldError, quantity, table
from rubhpc.rig.places import Placed

if TYPE_CHECKING:
    from collections.abc import Iterator


@dataclass(frozen=True, kw_only=True)
class Unbalance(Placed):
    """A mass at a radius, fixed to the rotor."""

    mass: float = quantity("kg", doc="Unbalance mass.", example='"8 g"', at_least=0)
    radius: float = quantity("m", doc="Distance of the mass from the axis.", example='"4.5 cm"', at_least=0)
    phase: float = quantity(
        "rad", doc="Angle from +y towards +z at time zero.", example='"90 deg"', default=0.0
    )


@dataclass(frozen=True, kw_only=True)
class Load(Placed):
    """A constant force, such as that of a belt."""

    vertical: float = quantity(
        "N", doc="Vertical component, positive upwards (+y).", example='"-120 N"', default=0.0
    )
    horizontal: float = quantity(
        "N", doc="Horizontal component, positive along +z.", example='"30 N"', default=0.0
    )


NodeForce: TypeAlias = Unbalance | Load


@dataclass(frozen=True, kw_only=True, eq=False)
class RotorForces:
    """Forces on a rotor other than contact."""

    unbalance: tuple[Unbalance, ...] = table(doc="Unbalance masses.", default=())
    load: tuple[Load, ...] = table(doc="Constant forces.", default=())
    gravity: float = quantity(
        "m/s^2",
        doc="Gravitational acceleration, towards -y.",
        example='"9.81 m/s^2"',
        default=0.0,
        at_least=0,
    )

    def node_forces(self) -> Iterator[tuple[str, NodeForce]]:
        """Yield every force at a node with its dotted key, "load.1"."""
        for declared in fields(RotorForces):
            value = getattr(self, declared.name)
            if isinstance(value, tuple):
                yield from ((f"{declared.name}.{i}", force) for i, force in enumerate(value, 1))

    def node_of(self, part: Placed, key: str = "") -> int:
        """Return the node of a part; a rotor whose nodes have positions finds the one at its position.

        Parameters
        ----------
        part : Placed
        key : str
            Dotted key of the part, for messages.
        """
        if part.node is None:
            raise FieldError(f"{key}.position", "this kind of rotor has no positions; give node")
        return part.node
