"""Where cases start: the table [initial]."""

from __future__ import annotations

from dataclasses import dataclass, field

from rubhpc.input.fields import FieldError, check_fields, count, quantity, selection, text
from rubhpc.study.stored_state import StoredState  # noqa: TC001 - annotations are read when a table is built

REST, CONTACT_FREE = "rest", "contact_free"


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
