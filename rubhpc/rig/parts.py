"""The parts of a rotor: shaft sections, sleeves, discs, bearings, the torsional drive, damping."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, ClassVar

from rubhpc.input.fields import FieldError, check_fields, count, flag, pairs, quantity
from rubhpc.rig.supports import Part, Placed, Springs, Support


@dataclass(frozen=True, kw_only=True)
class Tube(Part):
    """A cylinder or a cone with a bore, of Timoshenko elements.

    It is tapered where a diameter at its right end is given: diameters change linearly along it.
    """

    EITHER: ClassVar[tuple[tuple[str, str], ...]] = (("shear_modulus", "poissons_ratio"),)

    length: float = quantity("m", doc="Length.", example='"0.8 m"', above=0)
    outer_diameter: float = quantity(
        "m", doc="Outer diameter; of a tapered part at its left end.", example='"20 mm"', above=0
    )
    outer_diameter_right: float | None = quantity(
        "m",
        doc="Outer diameter at the right end; by default outer_diameter.",
        example='"30 mm"',
        default=None,
        above=0,
    )
    inner_diameter: float = quantity(
        "m",
        doc="Diameter of the bore; of a tapered part at its left end.",
        example='"8 mm"',
        default=0.0,
        at_least=0,
    )
    inner_diameter_right: float | None = quantity(
        "m",
        doc="Diameter of the bore at the right end; by default inner_diameter.",
        example='"8 mm"',
        default=None,
        at_least=0,
    )
    youngs_modulus: float = quantity("Pa", doc="Young's modulus.", example='"210 GPa"', above=0)
    shear_modulus: float | None = quantity(
        "Pa", doc="Shear modulus, or give poissons_ratio.", example='"79.6 GPa"', default=None, above=0
    )
    poissons_ratio: float | None = quantity(
        "",
        doc="Poisson's ratio, in place of the shear modulus E / (2 (1 + nu)).",
        default=None,
        above=-1,
        below=0.5,
    )
    density: float = quantity("kg/m^3", doc="Density.", above=0)
    shear: bool = flag(
        doc="Whether it deforms in shear (Timoshenko beam); false for a Rayleigh beam.",
        example="true",
        default=True,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.shear_modulus is not None and self.poissons_ratio is not None:
            problem = "conflicts with shear_modulus, which is E / (2 (1 + nu))"
            raise FieldError("poissons_ratio", f"{problem}; give one of the two")
        if self.shear_modulus is None and self.poissons_ratio is None:
            raise FieldError("shear_modulus", "missing; give shear_modulus or poissons_ratio")
        for end, outer, inner in zip(("", "_right"), *self.diameters, strict=True):
            if inner >= outer:
                is_own = not end or self.inner_diameter_right is not None
                problem = f"{inner:g} m must be below outer_diameter{end}, {outer:g} m"
                raise FieldError(f"inner_diameter{end}" if is_own else "inner_diameter", problem)

    @property
    def diameters(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Outer diameters at the left and the right end, then inner ones, m."""
        outer, inner = self.outer_diameter_right, self.inner_diameter_right
        return (
            (self.outer_diameter, self.outer_diameter if outer is None else outer),
            (self.inner_diameter, self.inner_diameter if inner is None else inner),
        )

    @property
    def modulus_in_shear(self) -> float:
        """Shear modulus as given, or by Poisson's ratio, Pa."""
        if self.shear_modulus is not None:
            return self.shear_modulus
        assert self.poissons_ratio is not None
        return self.youngs_modulus / (2 * (1 + self.poissons_ratio))


MOST_ELEMENTS = 200  # of a shaft or a stator: matrices are dense, and time grows with the third power


@dataclass(frozen=True, kw_only=True)
class Damping:
    """Rayleigh damping `alpha M + beta K`, by coefficients or by ratios at given frequencies."""

    alpha: float = quantity(
        "1/s", doc="Mass-proportional coefficient.", example="31.7", default=0.0, at_least=0
    )
    beta: float = quantity(
        "s", doc="Stiffness-proportional coefficient.", example='"20 us"', default=0.0, at_least=0
    )
    ratios: tuple[tuple[float, float], ...] = pairs(
        units=("Hz", ""),
        doc="Damping ratios at given frequencies (Hz = fraction of critical), in place of alpha and beta.",
        example="{ 31.56 = 0.09, 128.05 = 0.022 }",
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if self.ratios and (self.alpha or self.beta):
            raise FieldError("ratios", "conflicts with alpha and beta; give either ratios or alpha and beta")
        frequencies = [f for f, _ in self.ratios]
        for frequency, ratio in self.ratios:
            if not 0 < frequency < math.inf:
                raise FieldError("ratios", f"frequency {frequency:g} Hz is out of range; it must be above 0")
            if not 0 <= ratio < 1:
                problem = f"{ratio:g} at {frequency:g} Hz is out of range; it must be from 0 to below 1"
                raise FieldError("ratios", problem)
            if frequencies.count(frequency) > 1:
                raise FieldError("ratios", f"{frequency:g} Hz is duplicated; remove one")


UNDAMPED = Damping()


@dataclass(frozen=True, kw_only=True)
class ShaftSection(Tube):
    """A length of shaft, divided into equal Timoshenko elements.

    It is tapered where a diameter at its right end is given: diameters change linearly along it.
    """

    elements: int = count(doc="Number of equal finite elements.", example="14", at_most=MOST_ELEMENTS)


@dataclass(frozen=True, kw_only=True)
class Sleeve(Tube, Placed):
    """A tube on the shaft, bonded to it from one node to another: it adds mass and stiffness.

    Its node or position is that of its left end; its right end is at a node too.
    """

    EITHER: ClassVar = (*Tube.EITHER, *Placed.EITHER)

    inner_diameter: float = quantity(
        "m",
        doc="Diameter of the bore, at least that of the shaft; of a tapered sleeve at its left end.",
        example='"20 mm"',
        above=0,
    )


@dataclass(frozen=True, kw_only=True)
class Disc(Placed):
    """A rigid disc: either diameter, thickness and density, or mass and inertias.

    With a mass, the diameter is that of the rim that a stator may touch.
    """

    diameter: float | None = quantity(
        "m",
        doc="Diameter, also of the rim that a stator may touch.",
        example='"0.12 m"',
        default=None,
        above=0,
    )
    thickness: float | None = quantity(
        "m", doc="Thickness along the shaft.", example='"0.03 m"', default=None, above=0
    )
    density: float | None = quantity("kg/m^3", doc="Density.", default=None, above=0)
    mass: float | None = quantity(
        "kg",
        doc="Mass, given with both inertias in place of thickness and density.",
        example='"2.65 kg"',
        default=None,
        at_least=0,
    )
    diametral_inertia: float | None = quantity(
        "kg m^2", doc="Moment of inertia about a diameter.", default=None, at_least=0
    )
    polar_inertia: float | None = quantity(
        "kg m^2", doc="Moment of inertia about the shaft axis.", default=None, at_least=0
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        body = ("thickness", "density")
        lumped = ("mass", "diametral_inertia", "polar_inertia")
        if any(getattr(self, k) is not None for k in lumped):
            for key in body:
                if getattr(self, key) is not None:
                    raise FieldError(
                        key, f"conflicts with {', '.join(lumped)}; give either these or the dimensions"
                    )
            wanted = lumped
        else:
            wanted = ("diameter", *body)
        for key in wanted:
            if getattr(self, key) is None:
                ways = "diameter, thickness and density, or mass, diametral_inertia and polar_inertia"
                raise FieldError(key, f"missing; give either {ways}")

    @property
    def inertia(self) -> tuple[float, float, float]:
        """Mass (kg), diametral and polar moments of inertia (kg m^2); solid, over the shaft."""
        if self.mass is not None and self.diametral_inertia is not None and self.polar_inertia is not None:
            return self.mass, self.diametral_inertia, self.polar_inertia
        assert self.diameter is not None
        assert self.thickness is not None
        assert self.density is not None
        radius = self.diameter / 2
        mass = self.density * math.pi * radius**2 * self.thickness
        return mass, mass * (3 * radius**2 + self.thickness**2) / 12, mass * radius**2 / 2

    def displaced(self, keys: set[str]) -> dict[str, Any]:
        """Return the changes of other fields when `keys` are set."""
        changes = super().displaced(keys)
        if self.mass is None and keys & {"mass", "diametral_inertia", "polar_inertia"}:
            lumped = dict(zip(("mass", "diametral_inertia", "polar_inertia"), self.inertia, strict=True))
            changes |= {"thickness": None, "density": None} | lumped
        return changes


@dataclass(frozen=True, kw_only=True)
class Bearing(Springs, Support):
    """A linear support: `stiffness` and `damping` in both directions, or full 2x2 matrices.

    Its mass, like its springs and dampers, acts on the motion of the shaft relative to what it stands on.
    """


def let_go(support: Support) -> Bearing:
    """Return what is left of a bearing that lets go of the shaft: its place and its masses."""
    kept = {f.name: getattr(support, f.name) for f in fields(Support) if f.name != "until"}
    return Bearing(stiffness=0.0, damping=0.0, **kept)


@dataclass(frozen=True, kw_only=True)
class Torsion:
    """Torsional boundary condition: a node fixed by the drive, a spring (and damper) to ground, or none."""

    fixed_node: int | None = count(doc="Node whose torsion the drive constrains.", example="1", default=None)
    node: int = count(doc="Node of the spring to ground.", example="1", default=1)
    stiffness: float | None = quantity(
        "N m/rad", doc="Torsional spring to ground, in place of fixed_node.", default=None, above=0
    )
    damping: float = quantity(
        "N m s/rad", doc="Torsional damper parallel to the spring.", default=0.0, at_least=0
    )
    free: bool = flag(doc="Whether the shaft is unconstrained in torsion.", example="true", default=False)

    def __post_init__(self) -> None:
        check_fields(self)
        ways = "give one of fixed_node, stiffness, free = true"
        given = [key for key in ("fixed_node", "stiffness", "free") if getattr(self, key)]
        if len(given) > 1:
            raise FieldError(given[1], f"conflicts with {given[0]}; {ways}")
        if not given:
            raise FieldError("fixed_node", f"missing; {ways}")
        if self.damping and self.fixed_node is not None:
            raise FieldError(
                "damping", "conflicts with fixed_node, which cannot turn; give a stiffness instead"
            )

    def displaced(self, keys: set[str]) -> dict[str, Any]:
        """Return the changes of other fields when `keys` are set."""
        if keys & {"stiffness"}:
            return {"fixed_node": None, "free": False, "node": self.fixed_node or self.node}
        if keys & {"fixed_node", "free"}:
            return {"fixed_node": None, "stiffness": None, "damping": 0.0, "free": False}
        return {}


FIXED_AT_NODE_1 = Torsion(fixed_node=1)
