"""The table [contact] of a study: laws of contact and friction, direction of the normal, published models."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypedDict

from rubhpc.input.fields import FieldError, check_fields, choice, quantity, series
from rubhpc.models import FRICTION_LAWS, MODELS, NORMAL_LAWS, chosen, default_of
from rubhpc.rig.normal_law import (
    NEEDS_LAW,
    check_keys,
    check_spring,
    damping_key,
    restitution_key,
    stiffness_key,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

# Keys that belong to some friction laws only, as those of the normal force (`rubhpc.rig.normal_law`).
_NEEDS_FRICTION_LAW = {
    "static_friction_ratio": (("coulomb", "stribeck"), "this law has no such ratio"),
    "stribeck_speed": (("stribeck",), "other laws have no such speed"),
    "slip_speed": (("table",), "other laws have no table"),
    "friction_ratio": (("table",), "other laws have no table"),
}
_NEEDED = {
    "stribeck": {"static_friction_ratio": "1.3", "stribeck_speed": '"0.1 m/s"'},
    "table": {"slip_speed": "[0, 0.1, 1.0]", "friction_ratio": "[1.3, 1.1, 1.0]"},
}
# Of each key that belongs to some laws only: the key of these laws, and the laws.
LAWS_OF: dict[str, tuple[str, tuple[str, ...]]] = {
    key: (kind, laws)
    for kind, needs in (("law", NEEDS_LAW), ("friction_law", _NEEDS_FRICTION_LAW))
    for key, (laws, _) in needs.items()
}


@dataclass(frozen=True, kw_only=True)
class ContactKeys:
    """What [contact] gives, each key for itself; axes of the grid may give the rest."""

    law: str = choice(
        doc="Contact law: multipliers that close gaps exactly, a spring and damper (penalty), or Hertz's law "
        "with Hunt and Crossley's damping.",
        example='"penalty"',
        of=NORMAL_LAWS,
        default="lagrange",
    )
    stiffness: float | None = stiffness_key()
    damping: float | None = damping_key()
    restitution: float | None = restitution_key()
    friction_law: str = choice(
        doc="Friction law: steady sliding in the sense of the spin; or, with stick, Coulomb's law, "
        "Stribeck's, whose coefficient decays with the slip speed, or a table over the slip speed; "
        f"by default {default_of('friction_law')}.",
        example='"coulomb"',
        of=FRICTION_LAWS,
        default=None,
    )
    static_friction_ratio: float | None = quantity(
        "",
        doc="Coefficient of friction at rest over that in sliding; by default 1 (Coulomb's law).",
        example="1.2",
        default=None,
        at_least=1,
    )
    stribeck_speed: float | None = quantity(
        "m/s",
        doc="Slip speed at which the excess of Stribeck's friction at rest has decayed to 1/e.",
        example='"0.1 m/s"',
        default=None,
        above=0,
    )
    slip_speed: tuple[float, ...] | None = series(
        "m/s",
        doc="Slip speeds of a friction table, rising from 0.",
        example="[0, 0.1, 1.0]",
        default=None,
        at_least=0,
    )
    friction_ratio: tuple[float, ...] | None = series(
        "",
        doc="Coefficients at these speeds over the friction of the case; linear between, constant beyond.",
        example="[1.3, 1.1, 1.0]",
        default=None,
        at_least=0,
    )
    normal: str = choice(
        doc="Contact normal: along the axis of the stator (fixed), or along the line of centres (updated); "
        f"by default {default_of('normal')}.",
        example='"updated"',
        of=("fixed", "updated"),
        default=None,
    )
    model: str | None = choice(
        doc="A published model: the fixed normal, sliding friction, and linear geometry of the stators that "
        "give none.",
        example='"mokhtar2017"',
        of=tuple(MODELS),
        default=None,
    )

    def __post_init__(self) -> None:
        check_fields(self)
        for key in ("normal", "friction_law"):
            given = getattr(self, key)
            if given is None:
                object.__setattr__(self, key, chosen(key, self.model))
            elif self.model is not None and given != (meant := chosen(key, self.model)):
                problem = f'"{given}" conflicts with model = "{self.model}", which has "{meant}"'
                raise FieldError(key, f"{problem}; remove one of them")

    @property
    def are_laws_closed(self) -> bool:
        """Whether contact has a closed form along a fixed normal: multipliers, and steady sliding."""
        return self.law == "lagrange" and self.friction_law == "sliding"


class ContactArguments(TypedDict, total=False):
    """The same keys as arguments of functions, with units in text."""

    law: str
    stiffness: float | str | None
    damping: float | str | None
    restitution: float | None
    friction_law: str | None
    static_friction_ratio: float | None
    stribeck_speed: float | str | None
    slip_speed: Sequence[float | str] | None
    friction_ratio: Sequence[float] | None
    normal: str | None
    model: str | None


@dataclass(frozen=True, kw_only=True)
class Contact(ContactKeys):
    """Laws of contact and friction, and the direction of the contact normal."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_spring(self, "law")
        check_keys(self, "friction_law", _NEEDS_FRICTION_LAW, _NEEDED)
        if self.slip_speed is not None and self.friction_ratio is not None:
            _check_table(self.slip_speed, self.friction_ratio)


def _check_table(speed: tuple[float, ...], ratio: tuple[float, ...]) -> None:
    """Refuse a friction table that is none."""
    if speed[0] != 0.0 or any(a >= b for a, b in itertools.pairwise(speed)):
        raise FieldError("slip_speed", "does not rise from 0; write [0, 0.1, 1.0]")
    if len(ratio) != len(speed):
        problem = f"{len(ratio)} values for {len(speed)} slip speeds; give one for each"
        raise FieldError("friction_ratio", problem)
