"""Rotors: a shaft with discs and bearings, or user-supplied matrices.

Every kind of rotor has the forces of `RotorForces`, a `displacement_limit` and the methods `check_node`,
`can_move`, `rim_radius` and `recorded_node`; one with bearings also `stands_on`.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray  # noqa: TC002 - annotations are read when a rig is built

from rubhpc.input.fields import FieldError, check_fields, count, degrees, matrix, quantity, table
from rubhpc.input.matrix import is_symmetric
from rubhpc.input.messages import nearest
from rubhpc.rig.bearing_table import AnyBearing, BearingTable
from rubhpc.rig.matrix_body import check_body, checked_matrices
from rubhpc.rig.parts import (
    FIXED_AT_NODE_1,
    MOST_ELEMENTS,
    UNDAMPED,
    Damping,
    Disc,
    ShaftSection,
    Sleeve,
    Torsion,
    let_go,
)
from rubhpc.rig.supports import Placed

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from rubhpc.rig.supports import Pedestal


@dataclass(frozen=True, kw_only=True)
class Unbalance(Placed):
    """A mass at a radius, fixed to the rotor."""

    mass: float = quantity("kg", doc="Unbalance mass.", at_least=0)
    radius: float = quantity("m", doc="Distance of the mass from the axis.", example='"4.5 cm"', at_least=0)
    phase: float = quantity("rad", doc="Angle from +y towards +z at time zero.", default=0.0)


@dataclass(frozen=True, kw_only=True)
class Load(Placed):
    """A constant force, such as that of a belt."""

    vertical: float = quantity(
        "N", doc="Vertical component, positive upwards (+y).", example='"-120 N"', default=0.0
    )
    horizontal: float = quantity(
        "N", doc="Horizontal component, positive along +z.", example='"30 N"', default=0.0
    )


@dataclass(frozen=True, kw_only=True)
class Harmonic(Placed):
    """A force that rotates at a multiple of the spin speed, such as that of a misaligned coupling at 2X."""

    order: int = count(at_least=1, doc="Multiple of the spin speed.", example="2")
    force: float = quantity("N", doc="Size of the force.", example='"50 N"', at_least=0)
    phase: float = quantity("rad", doc="Angle from +y towards +z at time zero.", default=0.0)


UNLOADED, STANDSTILL = "unloaded", "standstill"
NodeForce: TypeAlias = Unbalance | Load | Harmonic


@dataclass(frozen=True, kw_only=True, eq=False)
class RotorForces:
    """Forces on a rotor other than contact."""

    unbalance: tuple[Unbalance, ...] = table(doc="Unbalance masses.", default=())
    load: tuple[Load, ...] = table(doc="Constant forces.", default=())
    harmonic: tuple[Harmonic, ...] = table(
        doc="Forces at multiples of the spin speed.", default=(), added=True
    )
    gravity: float = quantity(
        "m/s^2",
        doc="Gravitational acceleration, towards -y.",
        example='"9.81 m/s^2"',
        default=0.0,
        at_least=0,
    )
    clearance_from: float | str = quantity(
        "rad/s",
        doc="About which position of the shaft stators are set: without loads, or where the loads hold it at "
        "standstill or at a speed.",
        example='"standstill"',
        default=UNLOADED,
        at_least=0,
        or_words=(UNLOADED, STANDSTILL),
        added=True,
    )

    @property
    def aligned_at(self) -> float | None:
        """Speed, rad/s, of the shaft about which stators are set; None where it bears no loads."""
        if isinstance(self.clearance_from, str):
            return None if self.clearance_from == UNLOADED else 0.0
        return self.clearance_from

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


DIVERGED_SHARE = 0.1  # of the shaft length: lateral motion that no rotor survives
AT_A_NODE = 1e-6  # of the shaft length: a position that far from a node counts as at it
NAMES = ("u", "v", "w", "thx", "thy", "thz")


@dataclass(frozen=True, kw_only=True)
class Rotor(RotorForces):
    """A shaft with discs and bearings."""

    shaft: tuple[ShaftSection, ...] = table(doc="Shaft sections, from node 1.")
    sleeve: tuple[Sleeve, ...] = table(doc="Sleeves on the shaft.", default=(), added=True)
    disc: tuple[Disc, ...] = table(doc="Rigid discs.", default=())
    bearing: tuple[AnyBearing, ...] = table(doc="Linear bearings and seals.", default=())
    torsion: Torsion = table(doc="Torsional boundary condition at the drive.", default=FIXED_AT_NODE_1)
    damping: Damping = table(doc="Rayleigh damping.", default=UNDAMPED)

    def __post_init__(self) -> None:
        check_fields(self)
        if not self.shaft:
            raise FieldError("shaft", "missing; a rotor has at least one [[rotor.shaft]]")
        if not self.bearing:
            problem = "missing, so that the rotor floats freely"
            raise FieldError("bearing", f"{problem}; add at least one [[rotor.bearing]]")
        if self.n_node - 1 > MOST_ELEMENTS:
            problem = f"{self.n_node - 1} elements are too many; use at most {MOST_ELEMENTS} in all sections"
            raise FieldError("shaft", problem)
        for key in ("disc", "bearing", "sleeve"):
            for i, item in enumerate(getattr(self, key), 1):
                self._check_on_shaft(f"{key}.{i}.node", self.node_of(item, f"{key}.{i}"))
        for i, bearing in enumerate(self.bearing, 1):
            if isinstance(bearing, BearingTable) and bearing.link is not None:
                problem = "is only for rotors given by matrices"
                raise FieldError(f"bearing.{i}.link", f"{problem}; add [rotor.bearing.pedestal] instead")
        for i, sleeve in enumerate(self.sleeve, 1):
            self._check_sleeve(f"sleeve.{i}", sleeve)
        for key, force in self.node_forces():
            self.check_node(f"{key}.node", self.node_of(force, key))
        for key in ("fixed_node", "node"):
            self._check_on_shaft(f"torsion.{key}", getattr(self.torsion, key) or 1)

    @property
    def n_node(self) -> int:
        """Number of nodes along the shaft."""
        return 1 + sum(s.elements for s in self.shaft)

    @cached_property
    def shaft_positions(self) -> NDArray[np.float64]:
        """Distance of every node of the shaft from its left end, (n_node,), m."""
        return np.cumsum([0.0, *(s.length / s.elements for s in self.shaft for _ in range(s.elements))])

    @property
    def positions(self) -> NDArray[np.float64]:
        """Distance of every node from the left end, those of pedestals after those of the shaft, m."""
        under = [self.node_of(self.bearing[n - 1]) - 1 for n, stand in self.stands.items() for _ in stand]
        return np.append(self.shaft_positions, self.shaft_positions[under])

    @cached_property
    def stands(self) -> dict[int, list[tuple[int, Pedestal]]]:
        """Pedestals under each bearing, by its number, with their nodes, which follow those of the shaft."""
        found: dict[int, list[tuple[int, Pedestal]]] = {}
        node = self.n_node
        for number, bearing in enumerate(self.bearing, 1):
            found[number] = []
            pedestal = bearing.pedestal
            while pedestal is not None:
                node += 1
                found[number].append((node, pedestal))
                pedestal = pedestal.pedestal
        return found

    @property
    def until(self) -> float | None:
        """Revolutions or time, s, after which the first bearings let go; None: none does."""
        return min((b.until for b in self.bearing if b.until is not None), default=None)

    def let_go(self) -> Rotor:
        """Return the rotor without the bearings that let go first."""
        first = self.until
        bearing = tuple(b if b.until is None or b.until != first else let_go(b) for b in self.bearing)
        return replace(self, bearing=bearing)

    @property
    def displacement_limit(self) -> float:
        """Displacement beyond which a case has diverged, m."""
        return DIVERGED_SHARE * sum(section.length for section in self.shaft)

    def stands_on(self, number: int) -> int | None:
        """Return the node of the pedestal of a bearing, by its number; None where it stands on the ground."""
        return next((node for node, _ in self.stands[number]), None)

    def node_of(self, part: Placed, key: str = "") -> int:
        """Return the node of a part, found by its position where that is given."""
        if part.position is None:
            return super().node_of(part, key)
        return self._node_at(part.position, f"{key}.position")

    def _node_at(self, position: float, key: str) -> int:
        """Node of the shaft at a distance from its left end, m."""
        places = self.shaft_positions
        nearest = int(np.abs(places - position).argmin())
        if abs(places[nearest] - position) > AT_A_NODE * places[-1]:
            problem = (
                f"no node is at {position:g} m; the nearest is node {nearest + 1}, at {places[nearest]:g} m"
            )
            raise FieldError(key, f"{problem}; change position, or length and elements of the shaft sections")
        return nearest + 1

    def _check_on_shaft(self, key: str, node: int) -> None:
        """Refuse a node that the shaft does not have."""
        if node > self.n_node:
            raise FieldError(key, f"{node} is not on the shaft; its nodes run from 1 to {self.n_node}")

    def check_node(self, key: str, node: int) -> None:
        """Refuse a node that neither the shaft nor a pedestal has."""
        if node > self.n_node + sum(map(len, self.stands.values())):
            self._check_on_shaft(key, node)

    def sleeve_nodes(self, sleeve: Sleeve, key: str = "") -> tuple[int, int]:
        """Return the nodes of the left and the right end of a sleeve."""
        first = self.node_of(sleeve, key)
        return first, self._node_at(float(self.shaft_positions[first - 1]) + sleeve.length, f"{key}.length")

    def _check_sleeve(self, key: str, sleeve: Sleeve) -> None:
        """Refuse a sleeve that ends beside a node, or into which the shaft reaches."""
        first, last = self.sleeve_nodes(sleeve, key)
        if first == last:
            raise FieldError(f"{key}.length", f"{sleeve.length:g} m reaches no other node; give a longer one")
        start, reach = self.shaft_positions[first - 1], sleeve.length
        at = 0.0
        for section in self.shaft:
            ends = [min(max(x, start), start + reach) for x in (at, at + section.length)]
            if ends[1] - ends[0] > AT_A_NODE * self.shaft_positions[-1]:
                (outer, _), (_, bore) = section.diameters, sleeve.diameters
                shaft = [outer[0] + (outer[1] - outer[0]) * (x - at) / section.length for x in ends]
                inner = [bore[0] + (bore[1] - bore[0]) * (x - start) / reach for x in ends]
                if any(a > b * (1 + AT_A_NODE) for a, b in zip(shaft, inner, strict=True)):
                    problem = (
                        f"{min(inner):g} m is below the outer diameter of the shaft there, {max(shaft):g} m"
                    )
                    raise FieldError(f"{key}.inner_diameter", f"{problem}; widen the bore")
            at += section.length

    def can_move(self, node: int, angle: float) -> bool:
        """Whether a node can move in a lateral direction."""
        return True

    def rim_radius(self, node: int) -> float | None:
        """Radius of the largest disc at a node, m; None without a disc that has a diameter."""
        rims = [d.diameter / 2 for d in self.disc if self.node_of(d) == node and d.diameter]
        return max(rims, default=None)

    def recorded_node(self, stator_nodes: Sequence[int]) -> int:
        """Node whose motion is recorded: of the first stator, else of the first disc, else the middle."""
        discs = [self.node_of(disc) for disc in self.disc]
        return next(iter([*stator_nodes, *discs]), (self.n_node + 1) // 2)


@dataclass(frozen=True, kw_only=True, eq=False)
class MatrixRotor(RotorForces):
    """A rotor given by the matrices of `M u'' + (C + spin G) u' + K u = f`.

    The matrices are (n_dof, n_dof) in SI units, without constrained degrees of freedom. M is symmetric and
    positive definite, G skew-symmetric; K may be unsymmetric, but has no negative stiffness.

    A degree is named "u" (along the shaft), "v" (up), "w" (horizontal), in m, or "thx" (torsion), "thy",
    "thz", in rad, with x, y, z right-handed and positive spin from y to z; coordinates of other kinds have
    names that begin with "q". Nodes are whole numbers from 1, in any order.
    """

    mass: NDArray[np.float64] = matrix(
        doc="Mass matrix, symmetric and positive definite, SI units.", example="[[2.65, 0.0], [0.0, 2.65]]"
    )
    damping: NDArray[np.float64] | None = matrix(
        doc="Damping matrix, SI units; by default zero.", example="[[84.0, 0.0], [0.0, 84.0]]", default=None
    )
    stiffness: NDArray[np.float64] = matrix(
        doc="Stiffness matrix, SI units; may be unsymmetric.", example="[[1.43e5, 0.0], [0.0, 1.43e5]]"
    )
    gyroscopic: NDArray[np.float64] | None = matrix(
        doc="Gyroscopic matrix for a spin of 1 rad/s, skew-symmetric; by default zero.",
        example="[[0.0, 0.1], [-0.1, 0.0]]",
        default=None,
    )
    degrees: tuple[tuple[int, str], ...] = degrees(
        doc="Node and name of each row: u, v, w, thx, thy, thz, or q... for other coordinates.",
        example='[[1, "v"], [1, "w"]]',
    )
    bearing: tuple[BearingTable, ...] = table(
        doc="Speed-dependent bearings and seals; the matrices include all others.",
        default=(),
        added=True,
    )
    output_node: int | None = count(
        doc="Node whose motion is recorded; by default that of the first stator.",
        example="1",
        default=None,
        is_key=False,
    )
    displacement_limit: float = quantity(
        "m", doc="Displacement beyond which a case has diverged.", example='"1 m"', default=100.0, above=0
    )

    def __post_init__(self) -> None:
        check_fields(self)
        named = [f"{node}.{name}" for node, name in self.degrees]
        checked_matrices(self, ("mass", "damping", "stiffness", "gyroscopic"), named)
        for _, name in self.degrees:
            if name not in NAMES and not name.startswith("q"):
                fix = nearest(name, NAMES)
                raise FieldError(
                    "degrees", f'unknown degree "{name}"; {fix}, or use a name that begins with q'
                )
        check_body(self, self.degrees)
        assert self.gyroscopic is not None
        if not is_symmetric(self.gyroscopic, -1.0):
            raise FieldError(
                "gyroscopic", "is not skew-symmetric (G^T = -G); move its symmetric part to damping"
            )
        if self.output_node is not None:
            self.check_node("output_node", self.output_node)
        for i, bearing in enumerate(self.bearing, 1):
            key = f"bearing.{i}"
            self.check_node(f"{key}.node", self.node_of(bearing, key))
            if bearing.link is not None:
                self.check_node(f"{key}.link", bearing.link)
            for name in ("mass", "myy", "mzz", "pedestal"):
                if getattr(bearing, name) is not None:
                    problem = "cannot be given to a rotor of matrices"
                    raise FieldError(f"{key}.{name}", f"{problem}; include it in them")
        for key, force in self.node_forces():
            self.check_node(f"{key}.node", self.node_of(force, key))
        if self.gravity and any(name.startswith("q") for _, name in self.degrees):
            problem = "cannot be applied to the coordinates q..."
            raise FieldError("gravity", f"{problem}; give the forces as load, or use other degrees")

    def stands_on(self, number: int) -> int | None:
        """Return the other node of a bearing between two nodes, by its number; else None."""
        return self.bearing[number - 1].link

    def check_node(self, key: str, node: int) -> None:
        """Refuse a node without a lateral degree of freedom."""
        nodes = sorted({n for n, name in self.degrees if name in ("v", "w")})
        if node not in nodes:
            among = ", ".join(map(str, nodes[:12])) + (", ..." if len(nodes) > 12 else "")
            raise FieldError(key, f'{node} has neither "v" nor "w" in degrees; choose one of {among}')

    def can_move(self, node: int, angle: float) -> bool:
        """Whether a node can move in the lateral direction at an angle from "v" towards "w", rad."""
        reach = [abs(f(angle)) for f, name in ((np.cos, "v"), (np.sin, "w")) if (node, name) in self.degrees]
        return max(reach, default=0.0) > 1e-9

    def rim_radius(self, node: int) -> float | None:
        """None: matrices have no disc."""
        return None

    def recorded_node(self, stator_nodes: Sequence[int]) -> int:
        """Node whose motion is recorded: `output_node`, else of the first stator, else the first lateral."""
        lateral = [node for node, name in self.degrees if name in ("v", "w")]
        return self.output_node or next(iter([*stator_nodes, *lateral]), 1)


AnyRotor: TypeAlias = Rotor | MatrixRotor
