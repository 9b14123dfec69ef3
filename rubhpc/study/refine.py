"""Maps that are computed only where they change: the table [refine]."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rubhpc.errors import InputError
from rubhpc.input.fields import FieldError, check_fields, count, criteria, words
from rubhpc.input.messages import nearest
from rubhpc.schema import VARIABLES
from rubhpc.study.axes import FROM_REST, coordinate_of
from rubhpc.study.levels import Levels

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.study.axes import Axis
    from rubhpc.study.points import Points

_FLAGS = ("regime", "period", "settled")
_MEASURES = tuple(
    name
    for name, variable in VARIABLES.items()
    if variable.role == "measure" and not variable.flags and name not in (*_FLAGS, "wall_time")
)


@dataclass(frozen=True, kw_only=True)
class Refine:
    """A map of which only the necessary cases are computed; the others are inferred from them.

    Every `coarse`-th value of the refined axes is computed first. Then one axis after another is halved until
    it has all its values, where neighbours differ.
    """

    by: tuple[tuple[str, float], ...] = criteria(
        doc="What has to agree on both sides of a case that is inferred: flags, or measures with the "
        "relative difference that counts as equal.",
        example='["regime", { peak_contact_force = 0.1 }]',
        flags=_FLAGS,
        measures=_MEASURES,
        default=(("regime", 0.0), ("period", 0.0)),
    )
    coarse: int = count(
        doc="Step between the values that are computed first, a power of two.",
        example="8",
        default=8,
        at_least=2,
        at_most=4096,
    )
    axes: tuple[str, ...] = words(
        doc="Axes that are refined, in this order, each given as { start, stop, num }; by default all such.",
        example='["speed_ratio", "clearance_ratio"]',
        default=(),
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if self.coarse & (self.coarse - 1):
            near = 2 ** self.coarse.bit_length()
            problem = f"{self.coarse} is not a power of two; write {near // 2} or {near}"
            raise FieldError("coarse", problem)

    def refined(self, axes: Sequence[Axis]) -> list[str]:
        """Return the names of the axes of a grid that are refined."""
        if any(axis.drawn_from is not None for axis in axes):
            raise InputError(
                "[refine]: the cases of a sample have no neighbours; remove [refine] or [sample]"
            )
        swept = [axis.name for axis in axes if axis.sweep != FROM_REST]
        if swept:
            why = f"in the sweep of {swept[0]} a case starts where its neighbour ended"
            raise InputError(f"[refine]: {why}; remove sweep or [refine]")
        ranges = [axis.name for axis in axes if axis.is_range]
        if not ranges:
            problem = "no axis of [grid] is a range to be refined"
            raise InputError(f"[refine]: {problem}; write one as {{ start, stop, num }}, or remove [refine]")
        for name in self.axes:
            if name not in {axis.name for axis in axes}:
                raise InputError(f"[refine] axes: {name} is not an axis of [grid]; {nearest(name, ranges)}")
            if name not in ranges:
                problem = f"{name} is a list, whose values have no even steps"
                raise InputError(
                    f"[refine] axes: {problem}; write it as {{ start, stop, num }}, or leave it out"
                )
            if self.axes.count(name) > 1:
                raise InputError(f"[refine] axes: {name} is duplicated; remove one")
        return list(self.axes) or ranges


def levels_of(table: dict[str, Any], points: Points) -> Levels:
    """Return the levels of a grid from the table as a manifest keeps it: names of dimensions, step."""
    return Levels(points.shape, [points.dims.index(dim) for dim in table["dimensions"]], table["coarse"])


def table_of(refine: Refine, axes: Sequence[Axis]) -> dict[str, Any]:
    """Return what a manifest keeps of [refine], for JSON."""
    return {
        "by": [[name, share] for name, share in refine.by],
        "coarse": refine.coarse,
        "dimensions": [coordinate_of(name) for name in refine.refined(axes)],
    }
