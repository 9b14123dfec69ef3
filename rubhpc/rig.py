"""The rig: shaft, discs, bearings, unbalance and stators, as frozen dataclasses in SI units.

Nodes count from 1. Angles count from straight up (+y) towards +z, the sense of positive spin about +x.
The unit of every field stands in its metadata; `rubhpc.reading` reads it from there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field


def quantity(unit: str, **kwargs):
    """Declare a field that holds a number in `unit` (SI)."""
    return field(metadata={"unit": unit}, **kwargs)


@dataclass(frozen=True, kw_only=True)
class Damping:
    """Rayleigh damping `alpha M + beta K`, by coefficients or by ratios at given frequencies."""

    alpha: float = quantity("1/s", default=0.0)
    beta: float = quantity("s", default=0.0)
    ratios: tuple[tuple[float, float], ...] = ()  # (frequency, Hz; fraction of critical)


@dataclass(frozen=True, kw_only=True)
class ShaftSection:
    """A cylindrical length of shaft, divided into equal Timoshenko elements."""

    length: float = quantity("m")
    outer_diameter: float = quantity("m")
    inner_diameter: float = quantity("m", default=0.0)
    elements: int
    youngs_modulus: float = quantity("Pa")
    shear_modulus: float = quantity("Pa")
    density: float = quantity("kg/m^3")
    shear: bool = True  # False: Rayleigh beam


@dataclass(frozen=True, kw_only=True)
class Disc:
    """A rigid disc: either diameter, thickness and density, or mass and inertias."""

    node: int
    diameter: float | None = quantity("m", default=None)
    thickness: float | None = quantity("m", default=None)
    density: float | None = quantity("kg/m^3", default=None)
    mass: float | None = quantity("kg", default=None)
    diametral_inertia: float | None = quantity("kg m^2", default=None)
    polar_inertia: float | None = quantity("kg m^2", default=None)

    @property
    def inertia(self) -> tuple[float, float, float]:
        """Mass (kg), diametral and polar moments of inertia (kg m^2)."""
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class Bearing:
    """A linear support: `stiffness` and `damping` in both directions, or full 2x2 matrices."""

    node: int
    stiffness: float | None = quantity("N/m", default=None)
    kyy: float | None = quantity("N/m", default=None)
    kzz: float | None = quantity("N/m", default=None)
    kyz: float = quantity("N/m", default=0.0)
    kzy: float = quantity("N/m", default=0.0)
    damping: float | None = quantity("N s/m", default=None)
    cyy: float | None = quantity("N s/m", default=None)
    czz: float | None = quantity("N s/m", default=None)
    cyz: float = quantity("N s/m", default=0.0)
    czy: float = quantity("N s/m", default=0.0)

    @property
    def stiffness_matrix(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """((kyy, kyz), (kzy, kzz)), N/m."""
        raise NotImplementedError

    @property
    def damping_matrix(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """((cyy, cyz), (czy, czz)), N s/m."""
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class Unbalance:
    """A mass at a radius; `phase` is its angle from +y towards +z at time zero."""

    node: int
    mass: float = quantity("kg")
    radius: float = quantity("m")
    phase: float = quantity("rad", default=0.0)


@dataclass(frozen=True, kw_only=True)
class Torsion:
    """Torsional boundary: one node held by the drive, or a spring (and damper) to ground."""

    fixed_node: int | None = None
    node: int = 1
    stiffness: float | None = quantity("N m/rad", default=None)
    damping: float = quantity("N m s/rad", default=0.0)


@dataclass(frozen=True, kw_only=True)
class Rotor:
    """Shaft sections from node 1 on, with what sits on them."""

    shaft: tuple[ShaftSection, ...]
    disc: tuple[Disc, ...] = ()
    bearing: tuple[Bearing, ...] = ()
    unbalance: tuple[Unbalance, ...] = ()
    torsion: Torsion = Torsion(fixed_node=1)
    damping: Damping = Damping()


@dataclass(frozen=True, kw_only=True)
class Stator:
    """A cantilever that stands radially over the rotor; its free end faces the rim."""

    node: int
    angle: float = quantity("rad", default=0.0)
    length: float = quantity("m")
    width: float = quantity("m")  # along the shaft
    height: float = quantity("m")  # along the lateral (tangential) motion
    elements: int = 6
    youngs_modulus: float = quantity("Pa")
    poissons_ratio: float = quantity("", default=0.3)
    density: float = quantity("kg/m^3")
    lateral: bool = True
    radius: float | None = quantity("m", default=None)  # of contact; None: the disc's
    clearance_offset: float = quantity("m", default=0.0)
    damping: Damping = Damping()

    @property
    def euler_load(self) -> float:
        """Buckling load of the cantilever, pi^2 E I / (4 L^2), N."""
        least = self.height * self.width * min(self.height, self.width) ** 2 / 12
        return math.pi**2 * self.youngs_modulus * least / (4 * self.length**2)


@dataclass(frozen=True, kw_only=True)
class Rig:
    """Everything that stands on the bench."""

    name: str
    rotor: Rotor
    stator: tuple[Stator, ...] = ()
