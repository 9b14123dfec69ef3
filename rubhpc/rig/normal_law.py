"""The contact law that a single stator may have in place of that of the study."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rubhpc.input.fields import FieldError, check_fields, choice, quantity
from rubhpc.input.quantity import WithUnit
from rubhpc.models import NORMAL_LAWS

UNITS = {"stiffness": ("N/m", "N/m^1.5"), "damping": ("N*s/m", "s/m")}  # of a penalty, of Hertz's law
_EXAMPLES = {"penalty": "1e8", "hertz": '"1e10 N/m^1.5"'}


def take_units(owner: Any, law: str, key_of_law: str) -> None:
    """Turn stiffness and damping of a frozen dataclass, given with units, into numbers.

    Raises
    ------
    FieldError
        When the unit belongs to another law.
    """
    for key, units in UNITS.items():
        given, unit = getattr(owner, key), units[law == "hertz"]
        if isinstance(given, WithUnit):
            if given.unit != unit:
                problem = f'{given:g} {given.unit}: {key_of_law} = "{law}" needs one in {unit}'
                raise FieldError(key, problem)
            object.__setattr__(owner, key, float(given))


def stiffness_key() -> Any:
    """Declare the key `stiffness` of a table with such a law."""
    return quantity(
        "N/m",
        doc="Stiffness of the penalty; of Hertz's law in N/m^1.5.",
        example='"1e8 N/m"',
        default=None,
        above=0,
        or_unit="N/m^1.5",
    )


def damping_key() -> Any:
    """Declare the key `damping` of a table with such a law."""
    return quantity(
        "N*s/m",
        doc="Damping of the penalty; of Hertz's law in s/m: force times rate of penetration.",
        example='"100 N*s/m"',
        default=None,
        at_least=0,
        or_unit="s/m",
    )


def restitution_key() -> Any:
    """Declare the key `restitution` of a table with such a law."""
    return quantity(
        "",
        doc="Normal velocity after an impact over that before it, 0 to 1; by default none.",
        example="0.7",
        default=None,
        at_least=0,
    )


@dataclass(frozen=True, kw_only=True)
class NormalLaw:
    """Contact law of a stator."""

    kind: str = choice(
        doc="Contact law, as `law` of the study: multipliers, a spring and damper, or Hertz's law.",
        example='"penalty"',
        of=NORMAL_LAWS,
        default="lagrange",
    )
    stiffness: float | None = stiffness_key()
    damping: float | None = damping_key()
    restitution: float | None = restitution_key()

    def __post_init__(self) -> None:
        check_fields(self)
        if self.kind == "lagrange":
            for key in UNITS:
                if getattr(self, key) is not None:
                    raise FieldError(key, 'a multiplier has none; set kind = "penalty", or leave it out')
        elif self.restitution is not None:
            problem = "a penalty's rebound comes from its spring and damper"
            raise FieldError("restitution", f'{problem}; set kind = "lagrange", or leave it out')
        elif self.stiffness is None:
            fix = f"such as stiffness = {_EXAMPLES[self.kind]}"
            raise FieldError("stiffness", f'missing; kind = "{self.kind}" needs one, {fix}')
        if self.restitution is not None and self.restitution > 1:
            raise FieldError("restitution", f"{self.restitution:g} is out of range; it must be at most 1")
        take_units(self, self.kind, "kind")
