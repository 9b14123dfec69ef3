"""The table [branch] of a study: along which axis periodic motions are followed, and how far."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from rubhpc.errors import InputError
from rubhpc.input.fields import FieldError, check_fields, count, quantity, series, text
from rubhpc.input.messages import place
from rubhpc.study.axes import FROM_REST, Axis, axis_table
from rubhpc.study.axis_reading import make_range

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.rig.rig import Rig
    from rubhpc.study.tables import Integrator, Recording

LONGEST_PERIOD = 64  # revolutions


@dataclass(frozen=True, kw_only=True)
class BranchKeys:
    """How periodic motions are followed along an axis of the grid, which is given as `{ start, stop }`."""

    along: str = text(doc="Axis of the grid that varies along the branches.", example='"speed_ratio"')
    periods: tuple[float, ...] = series(
        "",
        doc="Revolutions of the motions with which branches begin.",
        example="[1, 2, 3]",
        default=(1.0, 2.0, 3.0),
        at_least=1,
    )
    step: float | None = quantity(
        "",
        doc="Largest change along the axis from one point to the next, in its unit (SI); "
        "by default a fiftieth of the range.",
        example="0.02",
        default=None,
        above=0,
    )
    sweeps: int = count(
        doc="Values along the axis from which branches are sought, by simulations up, down and from a random "
        "disturbance.",
        example="8",
        default=8,
        at_least=1,
        at_most=1000,
    )
    doublings: int = count(
        doc="How many times in a row a doubled period is followed.",
        example="2",
        default=1,
        at_least=0,
        at_most=6,
    )
    points: int = count(
        doc="Largest number of stored points of a case.",
        example="4000",
        default=2000,
        at_least=10,
        at_most=1_000_000,
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if not self.periods:
            raise FieldError("periods", "empty; give at least one, such as [1, 2]")
        for period in self.periods:
            if period != int(period) or period > LONGEST_PERIOD:
                problem = f"{period:g} is not a number of revolutions from 1 to {LONGEST_PERIOD}"
                raise FieldError("periods", f"{problem}; write whole numbers")

    @property
    def longest(self) -> int:
        """Revolutions of the longest period that is followed."""
        return int(max(self.periods)) << self.doublings


def branch_axis(name: str, values: object, rig: Rig, file: str) -> Axis:
    """Return the axis along which branches run: one case, and the range that it is followed through."""
    where = place(file, "grid", name)
    if not isinstance(values, dict) or set(values) != {"start", "stop"}:
        raise InputError(f"{where}: [branch] follows it; write it as {{ start = ..., stop = ... }}")
    found = make_range(name, values, rig, file)
    return replace(found, values=found.values[:1])


def check_followed(along: str, where: str) -> None:
    """Refuse an axis along which branches do not run."""
    if axis_table(along):
        raise InputError(
            f"{where}: {along} cannot be followed; use a speed, a clearance, friction or a key of the rig"
        )


def check_branch(
    keys: BranchKeys,
    axes: Sequence[Axis],
    integrator: Integrator,
    recording: Recording,
    others: Sequence[str],
) -> None:
    """Refuse what cannot be followed; `others` are tables that leave no room for branches."""
    for other in others:
        raise InputError(f"[branch] along: a study with [{other}] has no axis to follow; remove one of them")
    check_followed(keys.along, "[branch] along")
    if all(axis.name != keys.along for axis in axes):
        raise InputError(
            f"[branch] along: {keys.along} is not an axis of the grid; add it as {{ start, stop }}"
        )
    if any(axis.sweep != FROM_REST for axis in axes):
        raise InputError("[branch] along: branches need no sweep; remove sweep from the axes")
    if integrator.method != "modal":
        raise InputError('[branch] along: branches need [integrator] method = "modal"')
    if recording.probe:
        raise InputError("[branch] along: branches have no probes; remove [[record.probe]]")
    if recording.lyapunov:
        raise InputError("[record] lyapunov: branches have multipliers in its place; remove it or [branch]")
