"""A rotor by its matrices, from whatever program: which row is which degree, and what turns with it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray  # noqa: TC002 - read when a rig is built

from rubhpc.input.fields import FieldError, check_fields, count, degrees, matrix, nearest, quantity, table
from rubhpc.input.matrix import is_symmetric
from rubhpc.rig.degrees import check_body, checked_matrices
from rubhpc.rig.parts import Load, Unbalance  # noqa: TC001 - likewise

NAMES = ("u", "v", "w", "thx", "thy", "thz")


@dataclass(frozen=True, kw_only=True, eq=False)
class MatrixRotor:
    """A linear body, `M u'' + (C + spin G) u' + K u = f`, in the place of a shaft.

    Attributes
    ----------
    mass, damping, stiffness, gyroscopic : (n_dof, n_dof)
        M, C, K and G in SI units, what is held left out of them. M is symmetric and positive definite, G skew
        and to be multiplied by the spin (rad/s). C may be any and K unsymmetric, as bearings make them, but K
        has no negative stiffness. No damping or no gyroscopic matrix: zeros.
    degrees : tuple of (node, name)
        Which degree each row is. "u" (along the shaft), "v" (up), "w" (across), "thx" (torsion), "thy", "thz"
        in m and rad as in the rig file, x, y, z right-handed and positive spin from y to z; or any name that
        begins with "q" for coordinates of other kinds. Nodes are whole numbers from 1, in no order.
    unbalance : tuple of Unbalance
        At nodes that move sideways.
    load : tuple of Load
        Constant forces, at such nodes too.
    gravity : float, m/s2
        Pulls against "v" at every mass.
    output_node : int, optional
        Whose motion is recorded; the first stator's by default.
    displacement_limit : float
        Beyond which a case has diverged, m.
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
    unbalance: tuple[Unbalance, ...] = table(doc="Unbalance masses.", default=())
    load: tuple[Load, ...] = table(doc="Constant forces.", default=())
    gravity: float = quantity(
        "m/s^2",
        doc="Gravitational acceleration, towards -y.",
        example='"9.81 m/s^2"',
        default=0.0,
        at_least=0,
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
                mend = nearest(name, NAMES)
                raise FieldError("degrees", f'unknown degree "{name}"; {mend}, or a name that begins with q')
        check_body(self, self.degrees)
        assert self.gyroscopic is not None
        if not is_symmetric(self.gyroscopic, -1.0):
            raise FieldError("gyroscopic", "is not skew (G^T = -G); what damps belongs into the damping")
        if self.output_node is not None:
            self.check_node("output_node", self.output_node)
        for key in ("unbalance", "load"):
            for i, part in enumerate(getattr(self, key), 1):
                self.check_node(f"{key}.{i}.node", part.node)
        if self.gravity and any(name.startswith("q") for _, name in self.degrees):
            problem = "how it acts on the coordinates q... is not known"
            raise FieldError("gravity", f"{problem}; give its forces as load, or other degrees")

    def check_node(self, key: str, node: int) -> None:
        """Refuse a node that does not move sideways."""
        nodes = sorted({n for n, name in self.degrees if name in ("v", "w")})
        if node not in nodes:
            among = ", ".join(map(str, nodes[:12])) + (", ..." if len(nodes) > 12 else "")
            raise FieldError(key, f'{node} has neither "v" nor "w" among degrees; nodes {among} have')

    def moves_along(self, node: int, angle: float) -> bool:
        """Whether a node can move along a line at an angle from "v" towards "w", rad."""
        reach = [abs(f(angle)) for f, name in ((np.cos, "v"), (np.sin, "w")) if (node, name) in self.degrees]
        return max(reach, default=0.0) > 1e-9
