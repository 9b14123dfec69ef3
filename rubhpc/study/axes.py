"""The axes of a study's grid: their names, values in SI units, and how each is swept."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError
from rubhpc.input.fields import check_value, quantity
from rubhpc.input.messages import brief, nearest, place
from rubhpc.study.contact_keys import Contact
from rubhpc.study.initial import Initial
from rubhpc.units import typed_quantity

if TYPE_CHECKING:
    from dataclasses import Field
    from typing import Any

    from numpy.typing import NDArray

    from rubhpc.input.quantity import Range


@dataclass(frozen=True, kw_only=True)
class OwnAxes:
    """The axes that are no keys of the rig, declared as any other field is."""

    speed_ratio: float = quantity(
        "",
        doc="Spin speed over the first lateral frequency of the rotor at standstill.",
        example="{ start = 0.9, stop = 6.1, step = 0.2 }",
    )
    speed: float = quantity("rad/s", doc="Spin speed.", example='["1800 rpm", "3600 rpm"]')
    clearance_ratio: float = quantity(
        "",
        doc="Radial clearance over the contact-free amplitude at the speed.",
        example="[0.70, 0.85]",
        above=0,
    )
    clearance: float = quantity(
        "m",
        doc="Radial clearance; below 0 an interference with stators that give.",
        example='["84 um", "100 um"]',
    )
    friction: float = quantity("", doc="Coefficient of friction.", example="[0.1, 0.3, 0.5]", at_least=0)


@dataclass(frozen=True, kw_only=True)
class RunUpAxes:
    """The axes that are keys of [run_up]."""

    time: float = quantity("s", doc="Duration of the run-up.", example='["5 s", "20 s"]', above=0)


@dataclass(frozen=True, kw_only=True)
class DriveAxes:
    """The axes that are keys of [drive]."""

    torque: float = quantity("N*m", doc="Torque of the drive.", example='["1 N m", "2 N m"]')
    start: float = quantity(
        "rad/s", doc="Spin speed at the beginning.", example='["1200 rpm", "2400 rpm"]', above=0
    )
    inertia: float = quantity(
        "kg*m^2", doc="Polar inertia of the drive.", example='["0.01 kg m^2", "0.1 kg m^2"]', above=0
    )


RUN_UP_TIME, KNOCKED = "run_up.time", "initial.impulse_node"
_NO_AXES = ("model", "from_", "select")
# Keys of tables that may be axes, as "contact.law": by the table, and by the name of the axis.
TABLES: dict[str, dict[str, Field[Any]]] = {
    table: {
        f"{table}.{declared.name}": declared
        for declared in fields(owner)
        if declared.metadata.get("kind") not in (None, "series") and declared.name not in _NO_AXES
    }
    for table, owner in (
        ("contact", Contact),
        ("initial", Initial),
        ("run_up", RunUpAxes),
        ("drive", DriveAxes),
    )
}
OF_TABLES = {name: declared for keys in TABLES.values() for name, declared in keys.items()}
OWN = {declared.name: declared for declared in fields(OwnAxes)} | TABLES["run_up"] | TABLES["drive"]
SPEED_AXES = ("speed_ratio", "speed")
CLEARANCE_AXES = ("clearance_ratio", "clearance")
SWEEPS = ("from_rest", "up", "down", "both")
FROM_REST, UP, DOWN, BOTH = SWEEPS
DIRECTION = "direction"  # the axis that a sweep in both directions adds
DIRECTIONS = (UP, DOWN)  # meanings of 0 and 1 on it
NO_NEIGHBOURS = "the cases of a sample have no neighbours to start from; remove sweep or [sample]"


@dataclass(frozen=True, kw_only=True)
class Axis:
    """One axis of the grid.

    Attributes
    ----------
    name : str
        Key in `[grid]`: "friction", "stator.youngs_modulus".
    dimension : str
        Name of the dimension of a store that it runs along: its own, as a rule.
    unit : str
        SI unit of the values, in the notation of the store ("rad s-1"; "1" without dimension).
    values : tuple of float
        In SI units, each once, in any order, but rising where the axis is swept; of drawn ones, one a case of
        the sample.
    long_name : str
        What labels and attributes say.
    drawn_from : Range or None
        Where the values are a sample's. Such axes share a dimension.
    sweep : {"from_rest", "up", "down", "both"}
        Whether each case starts at rest, or where its neighbour on this axis has ended.
    is_range : bool
        Whether the values were given as a range.
    """

    name: str
    dimension: str
    unit: str
    values: tuple[float, ...]
    long_name: str
    drawn_from: Range | None = None
    sweep: str = FROM_REST
    is_range: bool = False

    def __post_init__(self) -> None:
        if self.sweep not in SWEEPS:
            raise InputError(f"{place('', 'grid', self.name)}: sweep: {unknown_sweep(self.sweep)}")
        if self.sweep != FROM_REST and (problem := why_not_swept(self.name)):
            raise InputError(f"{place('', 'grid', self.name)}: sweep: {problem}")
        if self.sweep != FROM_REST:
            object.__setattr__(self, "values", tuple(sorted(self.values)))
        if problem := problem_of(self.name, self.values, is_drawn=self.drawn_from is not None):
            raise InputError(f"{place('', 'grid', self.name)}: {problem}")

    @property
    def coordinate(self) -> str:
        """Name of its values in a store: "stator_youngs_modulus"."""
        return coordinate_of(self.name)

    @property
    def is_rig_key(self) -> bool:
        """Whether the axis sets a key of the rig."""
        return self.name not in OWN and self.name != DIRECTION and not self.table

    @property
    def table(self) -> str:
        """Table whose key the axis sets: contact, initial, run_up or drive; or ""."""
        return axis_table(self.name)

    @property
    def key(self) -> str:
        """Name of that key."""
        return self.name.removeprefix(f"{self.table}.")

    @property
    def words(self) -> list[str]:
        """What its values stand for; [] where they are quantities."""
        return [str(stated(self.name, value)) for value in self.values] if meanings_of(self.name) else []

    @property
    def tried(self) -> tuple[float, ...]:
        """What to try out before a run: all values, or the ends of what they are drawn from."""
        return self.values if self.drawn_from is None else (self.drawn_from.start, self.drawn_from.stop)


def direction_axis() -> Axis:
    """Return the axis that separates the two directions of a sweep."""
    return Axis(
        name=DIRECTION, dimension=DIRECTION, unit="1", values=(0.0, 1.0), long_name="direction of the sweep"
    )


def axis_table(name: str) -> str:
    """Return the table whose key an axis sets: contact, initial, run_up or drive; or ""."""
    table, dot, _ = name.partition(".")
    return table if dot and table in TABLES else ""


def coordinate_of(name: str) -> str:
    """Return what an axis is called in a store."""
    return name.replace(".", "_")


def meanings_of(name: str) -> tuple[str, ...]:
    """Return what the values 0, 1, ... on an axis stand for; () where they are quantities."""
    if name == DIRECTION:
        return DIRECTIONS
    found: tuple[str, ...] = OF_TABLES[name].metadata.get("of", ()) if name in OF_TABLES else ()
    return found


def stated(name: str, value: float) -> float | str:
    """Return what a value on an axis stands for, as its key takes it: a word, a whole number, or itself."""
    if meanings := meanings_of(name):
        return meanings[int(value)]
    is_count = name in OF_TABLES and OF_TABLES[name].metadata["kind"] == "count"
    return int(value) if is_count else value


def written(name: str, value: float, unit: str) -> str:
    """Return a value on an axis for people, as in `friction=0.3` or `speed=1200 rpm`."""
    return f"{name}={stated(name, value) if meanings_of(name) else typed_quantity(value, unit)}"


def why_not_swept(name: str) -> str:
    """Return why no sweep runs along an axis; "" where one may."""
    if meanings_of(name):
        return "words have no order to sweep along; leave it out, or sweep another axis"
    if axis_table(name) == "initial":
        return "in a sweep a case starts where another has ended; sweep another axis"
    return ""


def unknown_sweep(sweep: object) -> str:
    """Return that a way to sweep is unknown, and the nearest that is known."""
    return f"{brief(sweep)} is unknown; {nearest(sweep if isinstance(sweep, str) else '', SWEEPS)}"


def problem_of(name: str, values: tuple[float, ...], *, is_drawn: bool = False) -> str:
    """Return what is wrong with the values of an axis; "" when nothing is."""
    if not values:
        return "empty; give at least one value"
    declared = OWN.get(name) or TABLES["contact"].get(name)
    if declared is not None and not meanings_of(name):
        for value in (min(values), max(values)):
            if problem := check_value(declared, value):
                return problem
    if name in SPEED_AXES and 0.0 in values:
        return "0 is not a valid speed; remove it, the rotor has to spin"
    if not is_drawn and len(set(values)) < len(values):
        ordered = sorted(values)
        twice = next(v for v, following in itertools.pairwise(ordered) if v == following)
        shown = stated(name, twice) if meanings_of(name) else f"{twice:.12g}"
        return f"{shown} is duplicated; remove one"
    return ""


# A number means a value on an axis when it is close to it, relatively, and much closer than the next one is.
_CLOSE = 5e-3
_CLOSE_IN_SPACING = 0.1


def place_of(number: float, values: NDArray[np.float64]) -> int | None:
    """Return the place of the value (n,) of an axis that a number means; None where it means none."""
    i = int(np.argmin(np.abs(values - number)))
    tolerance = _CLOSE * max(abs(number), abs(float(values[i])))
    others = np.abs(np.delete(values, i) - values[i])
    if others.size:
        tolerance = min(tolerance, _CLOSE_IN_SPACING * float(others.min()))
    return i if abs(values[i] - number) <= tolerance else None


def study_unit(unit: str) -> str:
    """Return a unit of a store, `rad s-2` as netCDF spells it, as a study may: `rad * s**-2`."""
    return "" if unit == "1" else re.sub(r"(?<=[A-Za-z])(-?\d+)", r"**\1", unit).replace(" ", " * ")
