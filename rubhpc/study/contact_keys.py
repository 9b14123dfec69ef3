"""The table [contact] of a study: laws of contact and friction, direction of the normal, published models."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypedDict

from rubhpc.input.fields import FieldError, check_fields, choice, quantity, series
from rubhpc.models import FRICTION_LAWS, MODELS, NORMAL_LAWS, chosen, default_of
from rubhpc.rig.normal_law import damping_key, restitution_key, stiffness_key, take_units

if TYPE_CHECKING:
    from collections.abc import Sequence

# By key of [contact]: the key that chooses its law, the laws that have it, and why others do not.
NEEDS_LAW: dict[str, tuple[str, tuple[str, ...], str]] = {
    "stiffness": ("law", ("penalty", "hertz"), "a multiplier has none"),
    "damping": ("law", ("penalty", "hertz"), "a multiplier has none"),
    "restitution": ("law", ("lagrange",), "a penalty's rebound comes from its spring and damper"),
    "static_friction_ratio": ("friction_law", ("coulomb", "stribeck"), "this law has no such ratio"),
    "stribeck_speed": ("friction_law", ("stribeck",), "other laws have no such speed"),
    "slip_speed": ("friction_law", ("table",), "other laws have no table"),
    "friction_ratio": ("friction_law", ("table",), "other laws have no table"),
}
_EXAMPLES = {
    ("law", "penalty"): {"stiffness": "1e8"},
    ("law", "hertz"): {"stiffness": '"1e10 N/m^1.5"'},
    ("friction_law", "stribeck"): {"static_friction_ratio": "1.3", "stribeck_speed": '"0.1 m/s"'},
    ("friction_law", "table"): {"slip_speed": "[0, 0.1, 1.0]", "friction_ratio": "[1.3, 1.1, 1.0]"},
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
        for key, (kind, laws, reason) in NEEDS_LAW.items():
            if getattr(self, key) is not None and getattr(self, kind) not in laws:
                raise FieldError(key, f'{reason}; set {kind} = "{laws[0]}", or leave it out')
        for (kind, law), needed in _EXAMPLES.items():
            for key, example in needed.items():
                if getattr(self, kind) == law and getattr(self, key) is None:
                    raise FieldError(key, f'missing; {kind} = "{law}" needs one, such as {key} = {example}')
        take_units(self, self.law, "law")
        if self.restitution is not None and self.restitution > 1:
            raise FieldError("restitution", f"{self.restitution:g} is out of range; it must be at most 1")
        if self.slip_speed is not None and self.friction_ratio is not None:
            _check_table(self.slip_speed, self.friction_ratio)


def _check_table(speed: tuple[float, ...], ratio: tuple[float, ...]) -> None:
    """Refuse a friction table that is none."""
    if speed[0] != 0.0 or any(a >= b for a, b in itertools.pairwise(speed)):
        raise FieldError("slip_speed", "does not rise from 0; write [0, 0.1, 1.0]")
    if len(ratio) != len(speed):
        problem = f"{len(ratio)} values for {len(speed)} slip speeds; give one for each"
        raise FieldError("friction_ratio", problem)
