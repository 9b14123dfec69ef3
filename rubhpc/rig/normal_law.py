"""The contact law that a single stator may have in place of that of the study."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rubhpc.input.fields import FieldError, check_fields, choice, quantity
from rubhpc.input.quantity import WithUnit
from rubhpc.models import NORMAL_LAWS

if TYPE_CHECKING:
    from collections.abc import Mapping

UNITS = {"stiffness": ("N/m", "N/m^1.5"), "damping": ("N*s/m", "s/m")}  # of a penalty, of Hertz's law
# By key: the laws that have it, and why others do not.
NEEDS_LAW = {
    "stiffness": (("penalty", "hertz"), "a multiplier has none"),
    "damping": (("penalty", "hertz"), "a multiplier has none"),
    "restitution": (("lagrange",), "the rebound of a spring law comes from its spring and damper"),
}
NEEDED = {"penalty": {"stiffness": "1e8"}, "hertz": {"stiffness": '"1e10 N/m^1.5"'}}  # with examples


def check_keys(
    owner: Any,
    kind: str,
    needs: Mapping[str, tuple[tuple[str, ...], str]],
    needed: Mapping[str, Mapping[str, str]],
) -> None:
    """Refuse keys that are not those of a law, which the key `kind` names, and its absence of others."""
    law = getattr(owner, kind)
    for key, (laws, reason) in needs.items():
        if getattr(owner, key) is not None and law not in laws:
            raise FieldError(key, f'{reason}; set {kind} = "{laws[0]}", or leave it out')
    for key, example in needed.get(law, {}).items():
        if getattr(owner, key) is None:
            raise FieldError(key, f'missing; {kind} = "{law}" needs one, such as {key} = {example}')


def check_spring(owner: Any, kind: str) -> None:
    """Refuse what is no law of the normal force, which the key `kind` names; turn its units into numbers."""
    check_keys(owner, kind, NEEDS_LAW, NEEDED)
    take_units(owner, getattr(owner, kind), kind)
    if owner.restitution is not None and owner.restitution > 1:
        raise FieldError("restitution", f"{owner.restitution:g} is out of range; it must be at most 1")


def take_units(owner: Any, law: str, key_of_law: str) -> None:
    """Turn stiffness and damping of a frozen dataclass, given with units of its law, into numbers."""
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
        check_spring(self, "kind")
