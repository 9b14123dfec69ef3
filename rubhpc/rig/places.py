"""The place of a part on the shaft: a node, or the distance from the left end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rubhpc.input.fields import FieldError, check_fields, count, quantity


@dataclass(frozen=True, kw_only=True)
class Placed:
    """A part at a node of the shaft, given by its number or by its position."""

    node: int | None = count(doc="Node of the rotor, from 1.", example="8", default=None)
    position: float | None = quantity(
        "m",
        doc="Distance from the left end of the shaft, in place of node; a node must be there.",
        example='"0.4 m"',
        default=None,
        at_least=0,
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if self.node is not None and self.position is not None:
            raise FieldError("position", "conflicts with node; give either node or position")
        if self.node is None and self.position is None:
            raise FieldError("node", "missing; give node, or position (m, from the left end of the shaft)")

    def displaced(self, keys: set[str]) -> dict[str, Any]:
        """Return the changes of other fields when `keys` are set."""
        return {other: None for key, other in (("node", "position"), ("position", "node")) if key in keys}
