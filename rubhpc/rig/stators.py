"""Stators: a cantilever, a mass on springs or a wall, user-supplied matrices, or a round bore."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar, TypeAlias

import numpy as np  # noqa: TC002 - annotations are read when a rig is built
from numpy.typing import NDArray  # noqa: TC002

from rubhpc.input.fields import (
    FieldError,
    choice,
    count,
    flag,
    matrix,
    quantity,
    series,
    table,
    text,
    words,
)
from rubhpc.input.reading import build
from rubhpc.models import LINEAR, SECOND_ORDER, default_of
from rubhpc.rig.matrix_body import check_body, checked_matrices
from rubhpc.rig.normal_law import NormalLaw
from rubhpc.rig.parts import MOST_ELEMENTS, UNDAMPED, Damping
from rubhpc.rig.supports import Part
from rubhpc.units import typed_quantity

MOST_STATORS = 62  # a contact mode is numbered by the bits of an integer
KINDS = {"beam": "Stator", "lumped": "LumpedStator", "matrix": "MatrixStator", "bore": "Bore"}


@dataclass(frozen=True, kw_only=True, eq=False)
class Seat(Part):
    """Position of a stator, or of a ring of `count` stators, the first one at `angle`."""

    KIND: ClassVar[str] = ""
    REFUSED: ClassVar[tuple[str, ...]] = ()  # keys of a seat that this kind has not

    kind: str | None = choice(
        doc="What the stator is; by default what its other keys say. A bore needs it.",
        example='"bore"',
        of=tuple(KINDS),
        default=None,
    )
    node: int = count(doc="Node of the rotor that the stator faces, from 1.", example="8")
    angle: float = quantity("rad", doc="Angle from straight up (+y) towards +z.", default=0.0)
    radius: float | None = quantity(
        "m",
        doc="Contact radius; by default that of the largest disc at the node.",
        example='"60 mm"',
        default=None,
        above=0,
    )
    clearance_offset: float = quantity(
        "m", doc="Added to the clearance of the case for this stator.", example='"10 um"', default=0.0
    )
    strength: float | None = quantity(
        "N",
        doc="Contact force that the stator bears, for the monitor of it; by default it is not compared.",
        example='"500 N"',
        default=None,
        above=0,
    )
    carrier: str | None = text(
        doc="Name of the carrier on which the stator stands; by default the ground.",
        example='"casing"',
        default=None,
    )
    count: int | None = count(
        doc="Number of equal stators in a ring, evenly spaced from `angle`.",
        example="12",
        default=None,
        at_most=MOST_STATORS,
        is_key=False,
    )
    friction_factor: float = quantity(
        "",
        doc="Friction of this stator over that of the case.",
        example="0.5",
        default=1.0,
        at_least=0,
        added=True,
    )
    law: NormalLaw | None = table(
        doc="Contact law of this stator; by default that of the study.", default=None, added=True
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        law: object = self.law
        if isinstance(law, dict):  # as in a file
            object.__setattr__(self, "law", build(NormalLaw, law, type(self).__name__, "law"))
        if self.kind not in (None, self.KIND):
            assert self.kind is not None
            raise FieldError("kind", f'"{self.kind}" is another stator; use rubhpc.{KINDS[self.kind]}')
        object.__setattr__(self, "kind", None)  # what its keys say

    @property
    def is_bore(self) -> bool:
        """Whether it is a hole around the rotor."""
        return self.KIND == "bore"

    @property
    def has_own_contact(self) -> bool:
        """Whether its gap, law or friction differs from that of the case's other stators."""
        return self.is_bore or self.law is not None or self.friction_factor != 1.0

    @property
    def carrier_problem(self) -> str:
        """Why the stator cannot stand on a carrier, and what to do; "" where it can."""
        return "a stator of this kind stands on the ground; remove carrier, or use a cantilever or springs"


@dataclass(frozen=True, kw_only=True)
class Stator(Seat):
    """A radial cantilever whose free end faces the rotor."""

    KIND = "beam"

    length: float = quantity(
        "m", doc="Length of the cantilever, in the radial direction.", example='"40 mm"', above=0
    )
    width: float | None = quantity(
        "m", doc="Width along the shaft of a rectangular section.", example='"5 mm"', default=None, above=0
    )
    height: float | None = quantity(
        "m",
        doc="Height along the lateral (tangential) motion of a rectangular section.",
        example='"5 mm"',
        default=None,
        above=0,
    )
    diameter: float | None = quantity(
        "m",
        doc="Diameter of a round stator such as a screw, in place of width and height.",
        example='"6 mm"',
        default=None,
        above=0,
    )
    elements: int = count(
        doc="Number of equal finite elements.", example="6", default=6, at_most=MOST_ELEMENTS
    )
    youngs_modulus: float = quantity("Pa", doc="Young's modulus.", above=0)
    poissons_ratio: float = quantity("", doc="Poisson's ratio.", default=0.3, above=-1, below=0.5)
    density: float = quantity("kg/m^3", doc="Density.", example="1157.0", above=0)
    lateral: bool = flag(
        doc="Whether the stator bends in the tangential direction.", example="true", default=True
    )
    damping: Damping = table(doc="Rayleigh damping.", default=UNDAMPED)
    geometry: str | None = choice(
        doc="Whether a stator that bends keeps its length along its axis (linear), or its tip draws back and "
        f"an axial force lowers its lateral stiffness (second_order); by default {default_of('geometry')}.",
        example='"second_order"',
        of=(LINEAR, SECOND_ORDER),
        default=None,
        absent=LINEAR,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        sides = {"width": self.width, "height": self.height}
        for name, side in sides.items():
            if side is None and self.diameter is None:
                raise FieldError(name, f'missing; add {name} = "5 mm", or diameter for a round stator')
            if side is not None and self.diameter is not None:
                raise FieldError(name, "conflicts with diameter; remove one of them")

    @property
    def is_bent(self) -> bool:
        """Whether its gap knows that it bends: second order of a stator that is free to."""
        return self.lateral and self.with_geometry(default_of("geometry")).geometry == SECOND_ORDER

    def with_geometry(self, geometry: str) -> Stator:
        """Return the stator with a geometry where it gives none."""
        return self if self.geometry is not None else replace(self, geometry=geometry)

    @property
    def carrier_problem(self) -> str:
        """Why the stator cannot stand on a carrier: without lateral motion its tip cannot follow."""
        return "" if self.lateral else "lateral = false, so its tip would not follow; set lateral = true"

    @property
    def euler_load(self) -> float:
        """Buckling load of the cantilever, pi^2 E I / (4 L^2), N."""
        width, height = self.sides
        is_round = self.diameter is not None
        least = self.second_moment if is_round else height * width * min(height, width) ** 2 / 12
        return math.pi**2 * self.youngs_modulus * least / (4 * self.length**2)

    @property
    def sides(self) -> tuple[float, float]:
        """Extent of the section along the shaft and along the lateral motion, m."""
        if self.diameter is not None:
            return self.diameter, self.diameter
        assert self.width is not None
        assert self.height is not None
        return self.width, self.height

    @property
    def area(self) -> float:
        """Area of the section, m^2."""
        width, height = self.sides
        return width * height if self.diameter is None else math.pi / 4 * width * height

    @property
    def second_moment(self) -> float:
        """Second moment of area against lateral bending, m^4."""
        width, height = self.sides
        return width * height**3 / 12 if self.diameter is None else math.pi / 64 * height**4


@dataclass(frozen=True, kw_only=True)
class LumpedStator(Seat):
    """A mass on a radial and, with a lateral stiffness, a tangential spring and damper; or a rigid wall."""

    KIND = "lumped"

    mass: float | None = quantity(
        "kg", doc="Mass in the radial direction.", example='"0.5 g"', default=None, above=0
    )
    stiffness: float | None = quantity("N/m", doc="Radial stiffness.", default=None, above=0)
    damping: float = quantity("N s/m", doc="Radial damping.", default=0.0, at_least=0)
    lateral_mass: float | None = quantity(
        "kg", doc="Mass in the tangential direction; by default `mass`.", default=None, above=0
    )
    lateral_stiffness: float | None = quantity(
        "N/m", doc="Tangential stiffness; without it the stator moves only radially.", default=None, above=0
    )
    lateral_damping: float = quantity("N s/m", doc="Tangential damping.", default=0.0, at_least=0)
    rigid: bool = flag(
        doc="Whether the stator is a rigid wall, without mass and stiffness.", example="true", default=False
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        springs = ("mass", "stiffness", "lateral_mass", "lateral_stiffness")
        for key in springs:
            if self.rigid and getattr(self, key) is not None:
                raise FieldError(key, "conflicts with rigid = true, which does not move; remove one")
        for key in springs[:2]:
            if not self.rigid and getattr(self, key) is None:
                raise FieldError(key, "missing; give mass and stiffness, or rigid = true")
        if self.lateral_stiffness is None:
            for key in ("lateral_mass", "lateral_damping"):
                if getattr(self, key):
                    raise FieldError(key, "has no effect without lateral_stiffness; add lateral_stiffness")
        if self.rigid and self.damping:
            raise FieldError("damping", "conflicts with rigid = true, which does not move; remove one")

    @property
    def carrier_problem(self) -> str:
        """Why the stator cannot stand on a carrier: a wall or a laterally fixed mass cannot follow."""
        if not self.rigid and self.lateral_stiffness is not None:
            return ""
        return (
            "it is constrained laterally and would not follow; give it mass, stiffness and lateral_stiffness"
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class MatrixStator(Seat):
    """A stator given by the matrices of `M u'' + C u' + K u = f`, (n_dof, n_dof), SI units.

    M is symmetric and positive definite, and K has no negative stiffness. The degree "axial" is the
    displacement of the contact point away from the rotor (m, positive under contact), "lateral", if present,
    that along the rim under positive spin. Other degrees have any names.
    """

    KIND = "matrix"

    mass: NDArray[np.float64] = matrix(
        doc="Mass matrix, symmetric and positive definite, SI units.", example="[[5e-4, 0.0], [0.0, 5e-4]]"
    )
    damping: NDArray[np.float64] | None = matrix(
        doc="Damping matrix, SI units; by default zero.", example="[[2.0, 0.0], [0.0, 0.1]]", default=None
    )
    stiffness: NDArray[np.float64] = matrix(
        doc="Stiffness matrix, SI units.", example="[[1.9e6, 0.0], [0.0, 1e4]]"
    )
    degrees: tuple[str, ...] = words(
        doc="Name of each row: axial (away from the rotor), lateral (along the rim) or any other.",
        example='["axial", "lateral"]',
        default=("axial",),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        checked_matrices(self, ("mass", "damping", "stiffness"), [str(name) for name in self.degrees])
        check_body(self, self.degrees)
        if "axial" not in self.degrees:
            raise FieldError("degrees", 'none is "axial", on which contact acts; name that row axial')

    @property
    def carrier_problem(self) -> str:
        """Why the stator cannot stand on a carrier: matrices do not show which springs go to the ground."""
        return "matrices hold it to the ground; put it and the carrier into one model, or give it springs"


@dataclass(frozen=True, kw_only=True)
class Bore(Seat):
    """A round hole around the shaft or a disc: rigid, or a mass on springs and dampers in both directions.

    Its radial clearance is that of the case and `clearance_offset`, and it has no angle. A rigid bore on a
    carrier moves with it.
    """

    KIND = "bore"
    REFUSED = ("angle", "count")
    BOTH: ClassVar = {one: ((f"{one}_y", f"{one}_z"), ()) for one in ("stiffness", "damping")}

    mass: float | None = quantity(
        "kg", doc="Mass of the hole's body.", example='"2 kg"', default=None, above=0
    )
    stiffness: float | None = quantity(
        "N/m",
        doc="Stiffness of its support in both lateral directions, in place of stiffness_y and stiffness_z.",
        default=None,
        above=0,
    )
    stiffness_y: float | None = quantity("N/m", doc="Vertical stiffness.", default=None, above=0)
    stiffness_z: float | None = quantity("N/m", doc="Horizontal stiffness.", default=None, above=0)
    damping: float | None = quantity(
        "N s/m",
        doc="Damping of its support in both directions, in place of damping_y and damping_z.",
        default=None,
        at_least=0,
    )
    damping_y: float | None = quantity("N s/m", doc="Vertical damping.", default=None, at_least=0)
    damping_z: float | None = quantity("N s/m", doc="Horizontal damping.", default=None, at_least=0)
    rigid: bool = flag(
        doc="Whether the hole is fixed to the ground or to its carrier, without mass and stiffness.",
        example="true",
        default=False,
    )
    centre: tuple[float, ...] = series(
        "m",
        doc="Vertical and horizontal position of its centre, at rest, from that of a hole that is aligned.",
        example='["20 um", "-35 um"]',
        default=(0.0, 0.0),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "kind", self.KIND)
        for key in self.REFUSED:
            if getattr(self, key):
                raise FieldError(key, "a bore surrounds the rotor and has none; remove it")
        if len(self.centre) != 2:
            raise FieldError("centre", 'not two numbers; write ["20 um", "-35 um"], up and across')
        if self.rigid:
            for key in ("mass", *self.BOTH, *(key for keys, _ in self.BOTH.values() for key in keys)):
                if getattr(self, key) is not None:
                    raise FieldError(key, "conflicts with rigid = true, which does not move; remove one")
            return
        if self.mass is None:
            raise FieldError("mass", "missing; give mass and stiffness, or rigid = true")
        for one, (single, _) in self.BOTH.items():
            missing = [key for key in single if getattr(self, key) is None]
            if len(missing) == 1 or (one == "stiffness" and missing and self.stiffness is None):
                key = missing[0] if len(missing) == 1 else one
                raise FieldError(key, f"missing; give {one}, or {' and '.join(single)}")

    @property
    def springs(self) -> tuple[float, float]:
        """Vertical and horizontal stiffness, N/m."""
        return self.straight("stiffness")

    @property
    def dampers(self) -> tuple[float, float]:
        """Vertical and horizontal damping, N s/m."""
        return self.straight("damping")

    @property
    def carrier_problem(self) -> str:
        """Nothing: it follows a carrier in both directions."""
        return ""


AnyStator: TypeAlias = Stator | LumpedStator | MatrixStator | Bore


def geometries(stators: tuple[AnyStator, ...]) -> tuple[str, ...]:
    """Return which geometries beam stators have, each once."""
    beams = [stator for stator in stators if isinstance(stator, Stator)]
    return tuple(dict.fromkeys(SECOND_ORDER if stator.is_bent else LINEAR for stator in beams))


def gap_problem(stators: tuple[AnyStator, ...], clearance: float, *, is_ratio: bool = False) -> str:
    """Return why a clearance (m) is none of these stators, and how to fix it; "" where it is one.

    Stators that give may have an interference, but not by a share of an amplitude.
    """
    for stator in stators:
        is_wall = isinstance(stator, LumpedStator) and stator.rigid
        if clearance + stator.clearance_offset <= 0 and (is_wall or is_ratio or stator.is_bore):
            gap, shift = (typed_quantity(size, "m") for size in (clearance, stator.clearance_offset))
            problem = f"{gap} and a stator's clearance_offset of {shift} leave no gap"
            if stator.is_bore:
                return f"{problem} in a bore; use a larger one"
            if is_ratio:
                return f"{problem}; give clearance instead"
            return f"{problem} at a rigid stator; use a larger one, or give the stator mass and stiffness"
    return ""


def single_stators(stators: tuple[AnyStator, ...]) -> tuple[AnyStator, ...]:
    """Return stators with every ring replaced by its single stators."""
    if not any(stator.count for stator in stators):
        n_stator = len(stators)
        single = stators
    else:
        n_stator = sum(stator.count or 1 for stator in stators)
        single = tuple(
            replace(stator, count=None, angle=stator.angle + 2 * math.pi * i / (stator.count or 1))
            for stator in stators
            for i in range(stator.count or 1)
        )
        taken: dict[tuple[int, int], int] = {}
        for i, stator in enumerate(single, 1):
            if stator.is_bore:
                continue
            place = (stator.node, round(stator.angle / (2 * math.pi) * 1e9) % 10**9)
            if place in taken:
                angle = math.degrees(stator.angle) % 360
                problem = f"coincides with stator.{taken[place]}, at {angle:g} deg"
                raise FieldError(f"stator.{i}.angle", f"{problem}; turn the ring, or remove one")
            taken[place] = i
    if n_stator > MOST_STATORS:
        raise FieldError("stator", f"{n_stator} stators are too many; use at most {MOST_STATORS}")
    return single
