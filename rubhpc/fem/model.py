"""What the finite element model hands on: linear bodies and the places where they touch."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

NOTHING = 1e-14  # of a matrix's greatest entry: a coupling that is rounding


@dataclass(frozen=True, kw_only=True, eq=False)
class Body:
    """A linear body, `M u'' + (D + spin G) u' + K u = f`, reduced to its free degrees of freedom.

    Attributes
    ----------
    mass, damping, gyroscopic, stiffness : (n_dof, n_dof)
        M, D (bearings included), G (to be multiplied by the spin, rad/s) and K in SI units.
    degrees : tuple of (node, name)
        Which degree each row is. Rotor: "u", "v", "w", "thx", "thy", "thz"; stator: "axial"
        (positive outward, compressed), "lateral" (positive with the rim under positive spin), "rotation".
        A foreign body may have others.
    """

    mass: NDArray[np.float64]
    damping: NDArray[np.float64]
    gyroscopic: NDArray[np.float64]
    stiffness: NDArray[np.float64]
    degrees: tuple[tuple[int, str], ...]

    @property
    def n_dof(self) -> int:
        """Number of free degrees of freedom."""
        return len(self.degrees)

    @cached_property
    def part(self) -> NDArray[np.int64]:
        """Number of the part that each row belongs to, (n_dof,); no matrix couples one part to another."""
        couples = np.zeros((self.n_dof, self.n_dof), dtype=bool)
        for matrix in (self.mass, self.damping, self.gyroscopic, self.stiffness):
            size = np.abs(matrix)
            couples |= size > NOTHING * size.max(initial=0.0)
        part: NDArray[np.int64] = connected_components(csr_array(couples), directed=False)[1]
        return part

    def rows(self, names: Sequence[str]) -> list[int]:
        """Rows of the degrees with these names, and of all that is coupled to them."""
        part = self.part.tolist()
        wanted = {part[row] for row, (_, name) in enumerate(self.degrees) if name in names}
        return [row for row, number in enumerate(part) if number in wanted]

    def index(self, node: int, name: str) -> int:
        """Row of a degree of freedom; -1 where it is held or absent."""
        try:
            return self.degrees.index((node, name))
        except ValueError:
            return -1


@dataclass(frozen=True, kw_only=True, eq=False)
class StatorModel:
    """A stator and where it faces the rotor."""

    body: Body
    node: int  # of the rotor
    angle: float  # rad, from +y towards +z
    radius: float  # of contact, m
    clearance_offset: float  # m
    length: float  # m
    euler_load: float  # N
    axial: int  # row of the tip's axial displacement in the body
    lateral: int  # row of the tip's lateral displacement; -1 without lateral freedom


@dataclass(frozen=True, kw_only=True, eq=False)
class Model:
    """Rotor and stators, assembled.

    The unbalance force on the rotor is `spin^2 (unbalance_cosine cos(spin t) + unbalance_sine sin(spin t))`.
    """

    rotor: Body
    unbalance_cosine: NDArray[np.float64]  # (n_dof,), kg m
    unbalance_sine: NDArray[np.float64]  # (n_dof,), kg m
    stators: tuple[StatorModel, ...]
    output_node: int  # whose motion is recorded: the first stator's, or else the first disc's
    sag: NDArray[np.float64]  # (n_dof,), of the rotor under its constant loads, no stator touching, m or rad


def state_size(model: Model) -> int:
    """Numbers in a state of motion: displacement and velocity of each degree; two of each contact."""
    bodies = (model.rotor, *(stator.body for stator in model.stators))
    return 2 * sum(body.n_dof for body in bodies) + 2 * len(model.stators)
