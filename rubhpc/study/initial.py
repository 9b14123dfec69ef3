"""Where cases start: the table [initial], and its keys as axes of a grid."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

from rubhpc.errors import InputError, located
from rubhpc.input.fields import FieldError, check_fields, count, quantity, selection, text
from rubhpc.input.messages import nearest
from rubhpc.study.stored_state import StoredState  # noqa: TC001 - annotations are read when a table is built

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from dataclasses import Field

    from rubhpc.study.contact_axes import Tried

PREFIX = "initial."
REST, CONTACT_FREE = "rest", "contact_free"
KNOCKED = PREFIX + "impulse_node"


@dataclass(frozen=True, kw_only=True)
class Initial:
    """Where a case starts: at rest, contact-free or at the end of another case; other keys disturb it.

    Displacement and velocity are those of the output node relative to that motion, at the shaft's angle 0;
    the rotor follows by the static shape under a force there. What they overlap is pushed apart, by static
    shapes too. The impulse is a knock at that instant. In a sweep they hold for its first case.
    """

    from_: str = text(
        doc='Motion that the case starts from: "rest", "contact_free" (the steady unbalance response), or '
        "the final state of a stored case: the path of its store.",
        example='"sweep.zarr"',
        default=REST,
    )
    select: tuple[tuple[str, str | float], ...] = selection(
        doc="Case of that store: a value on each axis that has several.",
        example='{ speed_ratio = 1.5, direction = "down" }',
    )
    vertical: float = quantity(
        "m", doc="Vertical displacement of the output node.", example='"50 um"', default=0.0
    )
    horizontal: float = quantity(
        "m", doc="Horizontal displacement of the output node.", example='"-20 um"', default=0.0
    )
    vertical_velocity: float = quantity(
        "m/s", doc="Vertical velocity of the output node.", example='"10 mm/s"', default=0.0
    )
    horizontal_velocity: float = quantity(
        "m/s", doc="Horizontal velocity of the output node.", example='"10 mm/s"', default=0.0
    )
    impulse: float = quantity("N*s", doc="Impulse of a knock on the rotor.", example='"0.2 N*s"', default=0.0)
    impulse_angle: float = quantity(
        "rad", doc="Direction of the impulse, from straight up in the sense of positive spin.", default=0.0
    )
    impulse_node: int | None = count(
        doc="Node of the rotor that the impulse acts on; by default the output node.",
        example="5",
        default=None,
    )
    state: StoredState | None = field(default=None, metadata={"derived": True})

    def __post_init__(self) -> None:
        check_fields(self)
        if self.select and not self.is_from_store:
            raise FieldError("select", 'it belongs to a store; write from = "STORE.zarr", or leave it out')

    @property
    def is_from_store(self) -> bool:
        """Whether the case starts where one of a store has ended: in `state`, once that has been read."""
        return self.from_ not in (REST, CONTACT_FREE)

    @property
    def is_disturbed(self) -> bool:
        """Whether the case leaves the motion that it starts from."""
        return any(getattr(self, name) != 0.0 for name in DISTURBANCES)


DISTURBANCES = ("vertical", "horizontal", "vertical_velocity", "horizontal_velocity", "impulse")
_NO_AXES = ("from_", "select", "state")
_AXES = {PREFIX + declared.name: declared for declared in fields(Initial) if declared.name not in _NO_AXES}


def initial_field(name: str) -> Field[Any]:
    """Return the declaration of a key such as "initial.vertical".

    Raises
    ------
    InputError
        There is no such axis.
    """
    if name not in _AXES:
        raise InputError(f"unknown axis; {nearest(name, _AXES)}")
    return _AXES[name]


def initial_at(stated: Initial, values: Mapping[str, float]) -> Initial:
    """Return where the cases start that have these values on the initial axes.

    Parameters
    ----------
    stated : Initial
        What [initial] gives for all cases.
    values : mapping of axis name to value
    """
    if not values:
        return stated
    set_here: dict[str, Any] = {
        name.removeprefix(PREFIX): int(value) if initial_field(name).metadata["kind"] == "count" else value
        for name, value in values.items()
    }
    return replace(stated, **set_here)


def check_initials(stated: Initial, axes: Sequence[Tried]) -> None:
    """Refuse values on initial axes that cannot be, and keys of [initial] that change nothing.

    Raises
    ------
    InputError
        Names the values on the axes, or the key.
    """
    names = {axis.name.removeprefix(PREFIX) for axis in axes}
    if stated.impulse == 0.0 and "impulse" not in names:
        for key in ("impulse_angle", "impulse_node"):
            if key in names or getattr(stated, key):
                where = f"[grid] {PREFIX}{key}" if key in names else f"[initial] {key}"
                raise InputError(f'{where}: there is no impulse; give one, such as impulse = "0.1 N*s"')
    ends = [(min(axis.tried), max(axis.tried)) for axis in axes]
    for values in itertools.product(*ends):
        at = {axis.name: value for axis, value in zip(axes, values, strict=True)}
        where = ", ".join(f"{name} = {value:g}" for name, value in at.items())
        with located(f"[grid] {where}: "):
            initial_at(stated, at)
