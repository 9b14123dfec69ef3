"""Rotors: a shaft with discs and bearings, or user-supplied matrices.

Every kind of rotor has the forces of `RotorForces`, a `displacement_limit` and the methods `check_node`,
`can_move`, `rim_radius` and `recorded_node`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray  # noqa: TC002 - annotations are read when a rig is built

from rubhpc.input.fields import FieldError, check_fields, count, degrees, matrix, quantity, table
from rubhpc.input.matrix import is_symmetric
from rubhpc.input.messages import nearest
from rubhpc.rig.bearing_table import AnyBearing, BearingTable  # noqa: TC001 - likewise
from rubhpc.rig.forces import RotorForces
from rubhpc.rig.matrix_body import check_body, checked_matrices
from rubhpc.rig.parts import (
    FIXED_AT_NODE_1,
    MOST_ELEMENTS,
    UNDAMPED,
    Damping,
    Disc,
    ShaftSection,
    Torsion,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

DIVERGED_SHARE = 0.1  # of the shaft length: lateral motion that no rotor survives
NAMES = ("u", "v", "w", "thx", "thy", "thz")


@dataclass(frozen=True, kw_only=True)
class Rotor(RotorForces):
    """A shaft with discs and bearings."""

    shaft: tuple[ShaftSection, ...] = table(doc="Shaft sections, from node 1.")
    disc: tuple[Disc, ...] = table(doc="Rigid discs.", default=())
    bearing: tuple[AnyBearing, ...] = table(doc="Linear bearings and seals.", default=())
    torsion: Torsion = table(doc="Torsional boundary condition at the drive.", default=FIXED_AT_NODE_1)
    damping: Damping = table(doc="Rayleigh damping.", default=UNDAMPED)

    def __post_init__(self) -> None:
        check_fields(self)
        for key in ("shaft", "bearing"):
            if not getattr(self, key):
                raise FieldError(key, f"missing; a rotor has at least one [[rotor.{key}]]")
        if self.n_node - 1 > MOST_ELEMENTS:
            problem = f"{self.n_node - 1} elements are too many; use at most {MOST_ELEMENTS} in all sections"
            raise FieldError("shaft", problem)
        for key in ("disc", "bearing"):
            for i, item in enumerate(getattr(self, key), 1):
                self.check_node(f"{key}.{i}.node", item.node)
        for key, force in self.node_forces():
            self.check_node(f"{key}.node", force.node)
        for key in ("fixed_node", "node"):
            self.check_node(f"torsion.{key}", getattr(self.torsion, key) or 1)

    @property
    def n_node(self) -> int:
        """Number of nodes along the shaft."""
        return 1 + sum(s.elements for s in self.shaft)

    @property
    def displacement_limit(self) -> float:
        """Displacement beyond which a case has diverged, m."""
        return DIVERGED_SHARE * sum(section.length for section in self.shaft)

    def check_node(self, key: str, node: int) -> None:
        """Refuse a node that the shaft does not have."""
        if node > self.n_node:
            raise FieldError(key, f"{node} is not on the shaft; its nodes run from 1 to {self.n_node}")

    def can_move(self, node: int, angle: float) -> bool:
        """Whether a node can move in a lateral direction."""
        return True

    def rim_radius(self, node: int) -> float | None:
        """Radius of the largest disc at a node, m; None without a disc that has a diameter."""
        rims = [d.diameter / 2 for d in self.disc if d.node == node and d.diameter is not None]
        return max(rims, default=None)

    def recorded_node(self, stator_nodes: Sequence[int]) -> int:
        """Node whose motion is recorded: of the first stator, else of the first disc, else the middle."""
        return next(iter([*stator_nodes, *(disc.node for disc in self.disc)]), (self.n_node + 1) // 2)


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
            self.check_node(f"bearing.{i}.node", bearing.node)
        for key, force in self.node_forces():
            self.check_node(f"{key}.node", force.node)
        if self.gravity and any(name.startswith("q") for _, name in self.degrees):
            problem = "cannot be applied to the coordinates q..."
            raise FieldError("gravity", f"{problem}; give the forces as load, or use other degrees")

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
