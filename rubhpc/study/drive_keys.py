"""The table [drive] of a study: a torque that turns the rotor, whose speed is then free."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rubhpc.errors import InputError, located
from rubhpc.input.fields import FieldError, check_fields, count, quantity, series
from rubhpc.study.drive_law import DriveLaw
from rubhpc.study.run_up_keys import check_changing
from rubhpc.study.speed_law import MOST_REVOLUTIONS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rubhpc.study.axes import Axis
    from rubhpc.study.tables import Integrator, Recording

LOWEST_SHARE = 0.1  # of the first speed: where a record ends that names no lowest one


@dataclass(frozen=True, kw_only=True)
class DriveKeys:
    """Drive of a rotor of free speed; torque, start and inertia may be axes, as `"drive.torque"`."""

    torque: tuple[float, ...] | None = series(
        "N*m",
        doc="Torque at the driven end, negative where it brakes; one value, or one for each speed.",
        example='["4 N m", "3 N m", "0 N m"]',
        default=None,
    )
    speed: tuple[float, ...] | None = series(
        "rad/s",
        doc="Speeds of the torque, rising; it is linear between them and constant beyond.",
        example='["0 rpm", "1500 rpm", "3000 rpm"]',
        default=None,
        at_least=0,
    )
    start: float | None = quantity(
        "rad/s", doc="Spin speed at the beginning.", example='"1200 rpm"', default=None, above=0
    )
    revolutions: int = count(doc="Revolutions recorded.", example="200", at_most=MOST_REVOLUTIONS)
    inertia: float | None = quantity(
        "kg*m^2",
        doc="Polar inertia of drive and coupling; by default a thousandth of the rotor's.",
        default=None,
        above=0,
    )
    lowest: float | None = quantity(
        "rad/s",
        doc="Speed at which the record ends when the spin falls to it; by default a tenth of start.",
        example='"60 rpm"',
        default=None,
        above=0,
    )
    highest: float | None = quantity(
        "rad/s",
        doc="Speed at which the record ends when the spin rises to it; by default what the torque can reach.",
        example='"6000 rpm"',
        default=None,
        above=0,
    )

    def __post_init__(self) -> None:
        check_fields(self)
        n_speed = len(self.speed or ())
        if self.speed is not None:
            if n_speed < 2:
                raise FieldError("speed", "a table has at least two speeds; add one, or leave speed out")
            if any(a >= b for a, b in itertools.pairwise(self.speed)):
                raise FieldError("speed", "the speeds do not rise; sort the table, each speed once")
        if self.torque is not None and len(self.torque) not in (1, n_speed):
            problem = f"{len(self.torque)} values for {n_speed} speeds"
            raise FieldError("torque", f"{problem}; give one for each speed, or a single value")
        if self.start is not None:
            self._check_range(self.start)

    def law_at(self, given: Mapping[str, float]) -> DriveLaw:
        """The drive of a case with these values on the axes drive.torque, drive.start, drive.inertia."""
        torque = (given["torque"],) if "torque" in given else self.torque
        start = given.get("start", self.start)
        for name, value in (("torque", torque), ("start", start)):
            if value is None:
                raise FieldError(name, f"missing; give one, or the axis drive.{name}")
        assert torque is not None
        assert start is not None
        self._check_range(start)
        return DriveLaw(
            torque=torque,
            speed=(self.speed or ()) if len(torque) > 1 else (),
            start=start,
            n_revolution=self.revolutions,
            inertia=given.get("inertia", self.inertia),
            lowest=LOWEST_SHARE * start if self.lowest is None else self.lowest,
            highest=math.inf if self.highest is None else self.highest,
        )

    def _check_range(self, start: float) -> None:
        """Refuse a range that does not hold the first speed."""
        rpm = 30.0 / math.pi
        if self.lowest is not None and self.lowest >= start:
            problem = f"{self.lowest * rpm:.6g} rpm is not below the start at {start * rpm:.6g} rpm"
            raise FieldError("lowest", f"{problem}; the record would end immediately; lower it")
        if self.highest is not None and self.highest <= start:
            problem = f"{self.highest * rpm:.6g} rpm is not above the start at {start * rpm:.6g} rpm"
            raise FieldError("highest", f"{problem}; the record would end immediately; raise it")


def first_speed(keys: DriveKeys, axes: Sequence[Axis]) -> float:
    """The speed at which cases begin, rad/s; of several the highest."""
    starts = [value for axis in axes if axis.name == "drive.start" for value in axis.values]
    if not starts and keys.start is None:
        raise InputError("[drive] start: missing; give one, or the axis drive.start")
    return max(starts) if starts else keys.start or 0.0


def check_drive(
    keys: DriveKeys | None, axes: Sequence[Axis], integrator: Integrator, recording: Recording, others: str
) -> None:
    """Refuse what a drive cannot turn; `others` names a table that leaves no room for it, or is ""."""
    varied = {axis.key: axis for axis in axes if axis.table == "drive"}
    if keys is None:
        for key in varied:
            raise InputError(f"[grid] drive.{key}: nothing drives the rotor; add the table [drive]")
        return
    check_changing("drive", axes, integrator, recording, others)
    for key, axis in varied.items():
        if getattr(keys, key) is not None:
            raise InputError(f"[drive] {key}: is also an axis of the grid; remove one")
        if key == "torque" and keys.speed is not None:
            raise InputError("[drive] speed: goes with a table of torques, not with an axis; leave it out")
        if key == "start":
            for start in axis.tried:
                with located(f"[grid] drive.start: {start:g} rad/s: [drive] "):
                    keys.law_at({"start": start} | ({"torque": 0.0} if keys.torque is None else {}))
    with located("[drive] "):
        keys.law_at({key: axis.tried[0] for key, axis in varied.items()})
