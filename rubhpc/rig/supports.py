"""What bearings, seals, pedestals and bores share: a mass, springs and dampers in two lateral directions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from rubhpc.input.fields import FieldError, check_fields, count, quantity, table


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """A part that can give one thing in two ways.

    Attributes
    ----------
    EITHER : tuple of (key, key)
        Of which one is given.
    BOTH : dict
        Keys for both lateral directions; in place of each, those of single ones: straight, then crossed.
    """

    EITHER: ClassVar[tuple[tuple[str, str], ...]] = ()
    BOTH: ClassVar[dict[str, tuple[tuple[str, str], tuple[str, ...]]]] = {}

    def __post_init__(self) -> None:
        check_fields(self)
        for one, (straight, crossed) in self.BOTH.items():
            single = (*straight, *crossed)
            for key in single:
                if getattr(self, one) is not None and getattr(self, key) not in (None, 0.0):
                    listed = f"{', '.join(single[:-1])} and {single[-1]}"
                    raise FieldError(key, f"conflicts with {one}; give either {one} or {listed}")

    def straight(self, one: str) -> tuple[float, float]:
        """Return the vertical and the horizontal value of a key for both directions."""
        common, (y, z) = getattr(self, one) or 0.0, (getattr(self, key) for key in self.BOTH[one][0])
        return (common if y is None else y, common if z is None else z)

    def displaced(self, keys: set[str]) -> dict[str, Any]:
        """Return the changes of other fields when `keys` are set."""
        changes: dict[str, Any] = {
            other: None for a, b in self.EITHER for key, other in ((a, b), (b, a)) if key in keys
        }
        for one, (straight, crossed) in self.BOTH.items():
            if one in keys and not keys & {*straight, *crossed}:
                changes |= dict.fromkeys(straight) | dict.fromkeys(crossed, 0.0)
            elif getattr(self, one) is not None and keys & {*straight, *crossed}:
                changes |= dict.fromkeys(straight, getattr(self, one)) | {one: None}
        return changes


@dataclass(frozen=True, kw_only=True)
class Placed(Part):
    """A part at a node of the shaft, given by its number or by its position."""

    EITHER: ClassVar[tuple[tuple[str, str], ...]] = (("node", "position"),)

    node: int | None = count(doc="Node of the rotor, from 1.", example="8", default=None)
    position: float | None = quantity(
        "m",
        doc="Distance from the left end of the shaft, in place of node; a node must be there.",
        example='"0.4 m"',
        default=None,
        at_least=0,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.node is not None and self.position is not None:
            raise FieldError("position", "conflicts with node; give either node or position")
        if self.node is None and self.position is None:
            raise FieldError("node", "missing; give node, or position (m, from the left end of the shaft)")


@dataclass(frozen=True, kw_only=True)
class Masses(Part):
    """A mass in both lateral directions, or one for each."""

    BOTH: ClassVar = {"mass": (("myy", "mzz"), ())}

    mass: float | None = quantity(
        "kg",
        doc="Mass in both lateral directions, in place of myy and mzz.",
        example='"2 kg"',
        default=None,
        at_least=0,
    )
    myy: float | None = quantity("kg", doc="Mass in vertical motion.", default=None, at_least=0)
    mzz: float | None = quantity("kg", doc="Mass in horizontal motion.", default=None, at_least=0)

    @property
    def mass_matrix(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """((myy, 0), (0, mzz)), kg."""
        myy, mzz = self.straight("mass")
        return (myy, 0.0), (0.0, mzz)


COEFFICIENTS = {
    "stiffness": (("kyy", "kzz"), ("kyz", "kzy")),
    "damping": (("cyy", "czz"), ("cyz", "czy")),
}


@dataclass(frozen=True, kw_only=True)
class Springs(Masses):
    """A linear support: `stiffness` and `damping` in both directions, or full 2x2 matrices."""

    BOTH = Masses.BOTH | COEFFICIENTS

    stiffness: float | None = quantity(
        "N/m",
        doc="Stiffness in both lateral directions, in place of kyy, kzz, kyz and kzy.",
        default=None,
        at_least=0,
    )
    kyy: float | None = quantity("N/m", doc="Vertical stiffness.", default=None, at_least=0)
    kzz: float | None = quantity("N/m", doc="Horizontal stiffness.", default=None, at_least=0)
    kyz: float = quantity("N/m", doc="Vertical force per horizontal displacement.", default=0.0)
    kzy: float = quantity("N/m", doc="Horizontal force per vertical displacement.", default=0.0)
    damping: float | None = quantity(
        "N s/m",
        doc="Damping in both lateral directions, in place of cyy, czz, cyz and czy.",
        default=None,
        at_least=0,
    )
    cyy: float | None = quantity("N s/m", doc="Vertical damping.", default=None, at_least=0)
    czz: float | None = quantity("N s/m", doc="Horizontal damping.", default=None, at_least=0)
    cyz: float = quantity("N s/m", doc="Vertical force per horizontal velocity.", default=0.0)
    czy: float = quantity("N s/m", doc="Horizontal force per vertical velocity.", default=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.stiffness is None and (self.kyy is None or self.kzz is None):
            key = "kyy" if self.kyy is None else "kzz"
            raise FieldError(key, "missing; give either stiffness, or kyy and kzz")

    @property
    def stiffness_matrix(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """((kyy, kyz), (kzy, kzz)), N/m."""
        kyy, kzz = self.straight("stiffness")
        return (kyy, self.kyz), (self.kzy, kzz)

    @property
    def damping_matrix(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """((cyy, cyz), (czy, czz)), N s/m."""
        cyy, czz = self.straight("damping")
        return (cyy, self.cyz), (self.czy, czz)


@dataclass(frozen=True, kw_only=True)
class Pedestal(Springs):
    """A mass on springs on which a bearing stands, on the ground or on another one, such as a foundation."""

    pedestal: Pedestal | None = table(
        doc="What the pedestal stands on, in series; by default the ground.", default=None
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for i, key in enumerate(("myy", "mzz")):
            if not self.mass_matrix[i][i]:
                key = key if self.mass is None else "mass"
                raise FieldError(
                    key, "missing or 0; a pedestal has a mass, or join its springs to the bearing"
                )


@dataclass(frozen=True, kw_only=True)
class Support(Masses, Placed):
    """A bearing or seal at a node, on the ground or on a pedestal."""

    clearance: float | None = quantity(
        "m",
        doc="Radial clearance, for the monitor of displacements in it; by default they are not compared.",
        example='"60 um"',
        default=None,
        above=0,
    )
    pedestal: Pedestal | None = table(
        doc="What the bearing stands on, in series; by default the ground.", default=None
    )
    until: float | None = quantity(
        "rev",
        doc="When it lets go of the shaft, after the record begins: revolutions or a time, up to the next "
        "whole revolution; by default never. Needs a bore that catches the rotor.",
        example='"1 revolution"',
        default=None,
        at_least=0,
        or_unit="s",
    )


def is_time(until: float) -> bool:
    """Whether a value of `until` is a time, s, not a number of revolutions."""
    return getattr(until, "unit", "") == "s"
