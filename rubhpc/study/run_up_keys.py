"""The table [run_up] of a study: a spin speed that changes, in place of an axis of speeds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rubhpc.errors import InputError
from rubhpc.input.fields import FieldError, check_fields, pairs, quantity
from rubhpc.schema import STATE
from rubhpc.study.axes import FROM_REST, RUN_UP_TIME, SPEED_AXES, Axis
from rubhpc.study.speed_law import SpeedLaw

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.rig.rig import Rig
    from rubhpc.study.tables import Integrator, Recording


def speed_axis(speed: float, long_name: str) -> Axis:
    """The axis that a study needs, of one speed (rad/s)."""
    return Axis(name="speed", dimension="speed", unit="rad s-1", values=(speed,), long_name=long_name)


def refuse_speeds(table: str, names: Sequence[str]) -> None:
    """Refuse an axis of speeds, whose place a table takes that changes the speed."""
    for name in names:
        if name in SPEED_AXES:
            raise InputError(f"[grid] {name}: conflicts with [{table}], which changes the speed; remove one")


def check_changing(
    table: str, axes: Sequence[Axis], integrator: Integrator, recording: Recording, others: str
) -> None:
    """Refuse what has no meaning under a changing speed; `others` names a table that excludes it, or ""."""
    if others:
        raise InputError(f"[{table}]: run-ups are not combined with [{others}]; remove one of them")
    if integrator.method != "modal":
        problem = f"{integrator.method} keeps the speed constant"
        raise InputError(f'[integrator] method: {problem}; set method = "modal", or remove [{table}]')
    for axis in axes:
        if axis.sweep != FROM_REST:
            raise InputError(f"[grid] {axis.name}: sweep: a run-up begins at its first speed; remove sweep")
    if "clearance_ratio" in [axis.name for axis in axes]:
        raise InputError("[grid] clearance_ratio: the speed changes; give clearance instead")
    if STATE in recording.keep:
        raise InputError(f'[record] keep: the state of a run-up is not stored; remove "{STATE}"')


def check_forces(rig: Rig) -> None:
    """Refuse forces on a rotor that need a constant speed."""
    if rig.rotor.harmonic:
        problem = "the speed changes, and harmonics need a constant one"
        raise InputError(f"rig {rig.name}: [[rotor.harmonic]]: {problem}; remove them from the rig")


@dataclass(frozen=True, kw_only=True)
class RunUpKeys:
    """How the spin speed changes: from start to stop, or by a law; `"run_up.time"` may be an axis."""

    start: float | None = quantity(
        "rad/s", doc="Spin speed at the beginning.", example='"300 rpm"', default=None, above=0
    )
    stop: float | None = quantity(
        "rad/s",
        doc="Spin speed at the end; below start it is a coast-down.",
        example='"6000 rpm"',
        default=None,
        above=0,
    )
    time: float | None = quantity(
        "s",
        doc="Duration, at constant angular acceleration; it may be an axis of the grid instead.",
        example='"20 s"',
        default=None,
        above=0,
    )
    law: tuple[tuple[float, float], ...] = pairs(
        units=("s", "rad/s"),
        doc="In place of start, stop and time: speeds at some times, linear between them.",
        example='[["0 s", "300 rpm"], ["10 s", "3000 rpm"]]',
    )

    def __post_init__(self) -> None:
        check_fields(self)
        for name in ("start", "stop", "time"):
            if self.law and getattr(self, name) is not None:
                raise FieldError(name, "conflicts with law; give start, stop and time, or law")
            if not self.law and getattr(self, name) is None and name != "time":
                raise FieldError(name, "missing; give start, stop and time, or law")
        if self.law:
            self.law_at(None)
        elif self.time is not None:
            try:
                self.law_at(None)
            except FieldError as error:
                raise FieldError("time", error.problem) from None

    @property
    def highest(self) -> float:
        """Highest speed, rad/s."""
        return max(speed for _, speed in self.law) if self.law else max(self.start or 0.0, self.stop or 0.0)

    def law_at(self, time: float | None) -> SpeedLaw:
        """The speed over the time of a case, `time` (s) being its value on the axis run_up.time."""
        if self.law:
            times, speeds = zip(*self.law, strict=True)
            return SpeedLaw(time=times, speed=speeds)
        lasts = self.time if time is None else time
        return SpeedLaw(
            time=(0.0, math.nan if lasts is None else lasts), speed=(self.start or 0.0, self.stop or 0.0)
        )


def check_run_up(
    keys: RunUpKeys | None, axes: Sequence[Axis], integrator: Integrator, recording: Recording, others: str
) -> None:
    """Refuse what cannot run up; `others` names a table that leaves no room for it, or is ""."""
    names = [axis.name for axis in axes]
    if keys is None:
        if RUN_UP_TIME in names:
            raise InputError(f"[grid] {RUN_UP_TIME}: no speed changes; add the table [run_up]")
        return
    check_changing("run_up", axes, integrator, recording, others)
    if RUN_UP_TIME not in names:
        if not keys.law and keys.time is None:
            raise InputError(f"[run_up] time: missing; give one, or the axis {RUN_UP_TIME}")
        return
    if keys.law or keys.time is not None:
        key = "law" if keys.law else "time"
        raise InputError(f"[run_up] {key}: {RUN_UP_TIME} is also an axis of the grid; remove one")
    for time in next(axis for axis in axes if axis.name == RUN_UP_TIME).tried:
        try:
            keys.law_at(time)
        except FieldError as error:
            raise InputError(f"[grid] {RUN_UP_TIME}: {time:g} s: {error.problem}") from None
