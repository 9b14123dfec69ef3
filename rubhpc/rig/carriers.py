"""Carriers: bodies on springs on which several stators stand, such as the casing of a ring."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np  # noqa: TC002 - annotations are read when a rig is built
from numpy.typing import NDArray  # noqa: TC002

from rubhpc.input.fields import FieldError, check_fields, matrix, quantity, text, words
from rubhpc.rig.matrix_body import check_body, checked_matrices

MOTIONS = ("v", "w", "thx")  # of a carrier that its stators follow


@dataclass(frozen=True, kw_only=True, eq=False)
class Carrier:
    """A rigid body on springs: it moves laterally and, with an inertia, turns about the shaft's axis."""

    name: str = text(doc="Name, to which the stators on it refer.", example='"casing"')
    mass: float = quantity("kg", doc="Mass without the stators.", example='"12 kg"', above=0)
    stiffness: float = quantity(
        "N/m", doc="Stiffness of its support in both lateral directions.", example='"2e7 N/m"', above=0
    )
    horizontal_stiffness: float | None = quantity(
        "N/m", doc="Horizontal stiffness of its support; by default `stiffness`.", default=None, above=0
    )
    damping: float = quantity(
        "N s/m", doc="Damping of its support in both lateral directions.", default=0.0, at_least=0
    )
    inertia: float | None = quantity(
        "kg m^2",
        doc="Moment of inertia about the shaft, without the stators; by default the carrier does not turn.",
        default=None,
        above=0,
    )
    torsional_stiffness: float | None = quantity(
        "N m/rad", doc="Torsional stiffness of its support; needs an inertia.", default=None, above=0
    )
    torsional_damping: float = quantity(
        "N m s/rad", doc="Torsional damping of its support; needs an inertia.", default=0.0, at_least=0
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if (self.inertia is None) != (self.torsional_stiffness is None):
            key, other = "torsional_stiffness", "inertia"
            if self.inertia is None:
                key, other = other, key
            raise FieldError(key, f"missing; a carrier that turns needs it too, or remove {other}")
        if self.inertia is None and self.torsional_damping:
            raise FieldError("torsional_damping", "has no effect without an inertia; add inertia")


@dataclass(frozen=True, kw_only=True, eq=False)
class MatrixCarrier:
    """A carrier given by the matrices of `M u'' + C u' + K u = f`, (n_dof, n_dof), SI units.

    M is symmetric and positive definite, and K has no negative stiffness. The stators follow "v" (up), "w"
    (horizontal) and "thx" (about the shaft's axis); those that are absent are held. Other degrees have any
    names.
    """

    name: str = text(doc="Name, to which the stators on it refer.", example='"casing"')
    mass: NDArray[np.float64] = matrix(
        doc="Mass matrix, symmetric and positive definite, SI units.", example="[[12.0, 0.0], [0.0, 12.0]]"
    )
    damping: NDArray[np.float64] | None = matrix(
        doc="Damping matrix, SI units; by default zero.", example="[[400.0, 0.0], [0.0, 400.0]]", default=None
    )
    stiffness: NDArray[np.float64] = matrix(
        doc="Stiffness matrix, SI units.", example="[[2e7, 0.0], [0.0, 2e7]]"
    )
    degrees: tuple[str, ...] = words(
        doc="Name of each row: v, w, thx, which the stators follow, or any other.",
        example='["v", "w"]',
        default=(),
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if not set(self.degrees) & set(MOTIONS):
            problem = 'none is "v", "w" or "thx", which the stators follow'
            raise FieldError("degrees", f"{problem}; name every row")
        checked_matrices(self, ("mass", "damping", "stiffness"), [str(name) for name in self.degrees])
        check_body(self, self.degrees)


AnyCarrier: TypeAlias = Carrier | MatrixCarrier
