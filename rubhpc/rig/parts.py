"""The parts of a rotor: shaft sections, discs, bearings, the torsional drive, damping.

A part that can give one thing in two ways has a method `displaced`, which returns the changes of other fields
when some are set.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from rubhpc.input.fields import FieldError, check_fields, count, flag, pairs, quantity

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
        ("Hz", ""),
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
class ShaftSection:
    """A cylindrical length of shaft, divided into equal Timoshenko elements."""

    length: float = quantity("m", doc="Length of the section.", example='"0.8 m"', above=0)
    outer_diameter: float = quantity("m", doc="Outer diameter.", example='"20 mm"', above=0)
    inner_diameter: float = quantity(
        "m", doc="Diameter of the bore.", example='"8 mm"', default=0.0, at_least=0
    )
    elements: int = count(doc="Number of equal finite elements.", example="14", at_most=MOST_ELEMENTS)
    youngs_modulus: float = quantity("Pa", doc="Young's modulus.", example='"210 GPa"', above=0)
    shear_modulus: float = quantity("Pa", doc="Shear modulus.", example='"79.6 GPa"', above=0)
    density: float = quantity("kg/m^3", doc="Density.", example="7800.0", above=0)
    shear: bool = flag(
        doc="Whether the section deforms in shear (Timoshenko beam); false for a Rayleigh beam.",
        example="true",
        default=True,
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if self.inner_diameter >= self.outer_diameter:
            limit = f"{self.outer_diameter:g} m"
            raise FieldError(
                "inner_diameter", f"{self.inner_diameter:g} m must be below outer_diameter, {limit}"
            )


@dataclass(frozen=True, kw_only=True)
class Disc:
    """A rigid disc: either diameter, thickness and density, or mass and inertias.

    With a mass, the diameter is that of the rim that a stator may touch.
    """

    node: int = count(doc="Node of the shaft, from 1.", example="8")
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
    density: float | None = quantity("kg/m^3", doc="Density.", example="7800.0", default=None, above=0)
    mass: float | None = quantity(
        "kg",
        doc="Mass, given with both inertias in place of thickness and density.",
        example='"2.65 kg"',
        default=None,
        at_least=0,
    )
    diametral_inertia: float | None = quantity(
        "kg m^2", doc="Moment of inertia about a diameter.", example="2.58e-3", default=None, at_least=0
    )
    polar_inertia: float | None = quantity(
        "kg m^2", doc="Moment of inertia about the shaft axis.", example="4.76e-3", default=None, at_least=0
    )

    def __post_init__(self) -> None:
        check_fields(self)
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
        if self.mass is None and keys & {"mass", "diametral_inertia", "polar_inertia"}:
            lumped = dict(zip(("mass", "diametral_inertia", "polar_inertia"), self.inertia, strict=True))
            return {"thickness": None, "density": None} | lumped
        return {}


@dataclass(frozen=True, kw_only=True)
class Bearing:
    """A linear support: `stiffness` and `damping` in both directions, or full 2x2 matrices."""

    node: int = count(doc="Node of the shaft, from 1.", example="1")
    stiffness: float | None = quantity(
        "N/m",
        doc="Stiffness in both lateral directions, in place of kyy, kzz, kyz and kzy.",
        example='"1e6 N/m"',
        default=None,
        at_least=0,
    )
    kyy: float | None = quantity(
        "N/m", doc="Vertical stiffness.", example='"1e6 N/m"', default=None, at_least=0
    )
    kzz: float | None = quantity(
        "N/m", doc="Horizontal stiffness.", example='"1e6 N/m"', default=None, at_least=0
    )
    kyz: float = quantity(
        "N/m", doc="Vertical force per horizontal displacement.", example='"2e5 N/m"', default=0.0
    )
    kzy: float = quantity(
        "N/m", doc="Horizontal force per vertical displacement.", example='"-2e5 N/m"', default=0.0
    )
    damping: float | None = quantity(
        "N s/m",
        doc="Damping in both lateral directions, in place of cyy, czz, cyz and czy.",
        example='"100 N s/m"',
        default=None,
        at_least=0,
    )
    cyy: float | None = quantity(
        "N s/m", doc="Vertical damping.", example='"100 N s/m"', default=None, at_least=0
    )
    czz: float | None = quantity(
        "N s/m", doc="Horizontal damping.", example='"100 N s/m"', default=None, at_least=0
    )
    cyz: float = quantity(
        "N s/m", doc="Vertical force per horizontal velocity.", example='"20 N s/m"', default=0.0
    )
    czy: float = quantity(
        "N s/m", doc="Horizontal force per vertical velocity.", example='"20 N s/m"', default=0.0
    )

    def __post_init__(self) -> None:
        check_fields(self)
        for one, letter in (("stiffness", "k"), ("damping", "c")):
            for key in (f"{letter}yy", f"{letter}zz", f"{letter}yz", f"{letter}zy"):
                if getattr(self, one) is not None and getattr(self, key) not in (None, 0.0):
                    ways = f"{one} or {letter}yy, {letter}zz, {letter}yz, {letter}zy"
                    raise FieldError(key, f"conflicts with {one}; give either {ways}")
        if self.stiffness is None and (self.kyy is None or self.kzz is None):
            key = "kyy" if self.kyy is None else "kzz"
            raise FieldError(key, "missing; give either stiffness, or kyy and kzz")

    @property
    def stiffness_matrix(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """((kyy, kyz), (kzy, kzz)), N/m."""
        kyy, kzz = (v if v is not None else self.stiffness or 0.0 for v in (self.kyy, self.kzz))
        return (kyy, self.kyz), (self.kzy, kzz)

    @property
    def damping_matrix(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """((cyy, cyz), (czy, czz)), N s/m."""
        cyy, czz = (v if v is not None else self.damping or 0.0 for v in (self.cyy, self.czz))
        return (cyy, self.cyz), (self.czy, czz)

    def displaced(self, keys: set[str]) -> dict[str, Any]:
        """Return the changes of other fields when `keys` are set."""
        changes: dict[str, Any] = {}
        for one, letter in (("stiffness", "k"), ("damping", "c")):
            common = getattr(self, one)
            straight, crossed = (f"{letter}yy", f"{letter}zz"), (f"{letter}yz", f"{letter}zy")
            if one in keys and not keys & {*straight, *crossed}:
                changes |= dict.fromkeys(straight) | dict.fromkeys(crossed, 0.0)
            elif common is not None and keys & {*straight, *crossed}:
                changes |= dict.fromkeys(straight, common) | {one: None}
        return changes


@dataclass(frozen=True, kw_only=True)
class Torsion:
    """Torsional boundary condition: a node fixed by the drive, a spring (and damper) to ground, or none."""

    fixed_node: int | None = count(doc="Node whose torsion the drive constrains.", example="1", default=None)
    node: int = count(doc="Node of the spring to ground.", example="1", default=1)
    stiffness: float | None = quantity(
        "N m/rad",
        doc="Torsional spring to ground, in place of fixed_node.",
        example="5e3",
        default=None,
        above=0,
    )
    damping: float = quantity(
        "N m s/rad", doc="Torsional damper parallel to the spring.", example="0.1", default=0.0, at_least=0
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
