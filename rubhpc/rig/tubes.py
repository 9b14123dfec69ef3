"""Round bodies with a bore: the geometry and the material of shaft sections and sleeves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rubhpc.input.fields import FieldError, check_fields, flag, quantity


@dataclass(frozen=True, kw_only=True)
class Tube:
    """A cylinder or a cone with a bore, of Timoshenko elements.

    It is tapered where a diameter at its right end is given: diameters change linearly along it.
    """

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
        example="0.3",
        default=None,
        above=-1,
        below=0.5,
    )
    density: float = quantity("kg/m^3", doc="Density.", example="7800.0", above=0)
    shear: bool = flag(
        doc="Whether it deforms in shear (Timoshenko beam); false for a Rayleigh beam.",
        example="true",
        default=True,
    )

    def __post_init__(self) -> None:
        check_fields(self)
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

    def displaced(self, keys: set[str]) -> dict[str, Any]:
        """Return the changes of other fields when `keys` are set."""
        both = ("shear_modulus", "poissons_ratio")
        return {other: None for key, other in (both, both[::-1]) if key in keys}
