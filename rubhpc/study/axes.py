"""The axes of a study's grid: lists, ranges and single values of a file become values in SI units."""

from __future__ import annotations

import itertools
import re
from dataclasses import Field, dataclass, fields, replace
from typing import TYPE_CHECKING, Any

from rubhpc.errors import InputError
from rubhpc.input.dotted import find_key
from rubhpc.input.fields import check_value, parse_field, quantity
from rubhpc.input.messages import brief, nearest, place
from rubhpc.input.ranges import MOST_VALUES, RANGE_KEYS, Range, read_ends, read_range
from rubhpc.study import contact_axes, initial
from rubhpc.study.contact_axes import choices_of, contact_field
from rubhpc.study.initial import initial_field

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rubhpc.rig.rig import Rig


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
    clearance: float = quantity("m", doc="Radial clearance at rest.", example='["84 um", "100 um"]', above=0)
    friction: float = quantity("", doc="Coefficient of friction.", example="[0.1, 0.3, 0.5]", at_least=0)


@dataclass(frozen=True, kw_only=True)
class RunUpAxes:
    """The axes that are keys of [run_up]."""

    time: float = quantity("s", doc="Duration of the run-up.", example='["5 s", "20 s"]', above=0)


RUN_UP_PREFIX, RUN_UP_TIME = "run_up.", "run_up.time"
_OWN = {declared.name: declared for declared in fields(OwnAxes)} | {
    RUN_UP_PREFIX + declared.name: declared for declared in fields(RunUpAxes)
}
SPEED_AXES = ("speed_ratio", "speed")
CLEARANCE_AXES = ("clearance_ratio", "clearance")
_TABLE_KEYS = ("values", *RANGE_KEYS, "sweep")
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
            raise InputError(f"{place('', 'grid', self.name)}: sweep: {_unknown_sweep(self.sweep)}")
        if self.sweep != FROM_REST and (problem := _why_not_swept(self.name)):
            raise InputError(f"{place('', 'grid', self.name)}: sweep: {problem}")
        if self.sweep != FROM_REST:
            object.__setattr__(self, "values", tuple(sorted(self.values)))
        if problem := _problem(self.name, self.values, is_drawn=self.drawn_from is not None):
            raise InputError(f"{place('', 'grid', self.name)}: {problem}")

    @property
    def coordinate(self) -> str:
        """Name of its values in a store: "stator_youngs_modulus"."""
        return coordinate_of(self.name)

    @property
    def is_rig_key(self) -> bool:
        """Whether the axis sets a key of the rig."""
        return self.name not in _OWN and self.name != DIRECTION and not is_of_table(self.name)

    @property
    def is_contact_key(self) -> bool:
        """Whether the axis sets a key of [contact]."""
        return self.name.startswith(contact_axes.PREFIX)

    @property
    def is_initial_key(self) -> bool:
        """Whether the axis sets a key of [initial]."""
        return self.name.startswith(initial.PREFIX)

    @property
    def words(self) -> list[str]:
        """What its values stand for; [] where they are quantities."""
        meanings = meanings_of(self.name)
        return [meanings[int(value)] for value in self.values] if meanings else []

    @property
    def tried(self) -> tuple[float, ...]:
        """What to try out before a run: all values, or the ends of what they are drawn from."""
        return self.values if self.drawn_from is None else (self.drawn_from.start, self.drawn_from.stop)


def make_axis(name: str, values: object, rig: Rig, file: str = "") -> Axis:
    """Return an axis from its entry in a file: a list, a range or a single value.

    Parameters
    ----------
    name : str
        A dotted key of the rig, "contact." and a key of [contact], "initial." and one of [initial],
        "run_up.time", or one of speed_ratio, speed, clearance_ratio, clearance, friction.
    values : list, dict or single value
        A dict is a range, stop included: `{start, stop, step}`, or `{start, stop, num}` with the `scale`
        "lin" or "log"; or it holds `values`. Either may say how the axis is swept: `{values, sweep}`.
    rig : Rig
        Whose keys the axis may name.
    file : str
        What errors name.

    Raises
    ------
    InputError
        When the name is unknown, or a value is invalid or duplicated.
    """
    where = place(file, "grid", name)
    declared = _declared(name, rig, where)
    sweep, is_range = FROM_REST, False
    if isinstance(values, dict):
        values, sweep = _read_table(values, where)
        is_range = isinstance(values, dict)
    if sweep != FROM_REST and (problem := _why_not_swept(name)):
        raise InputError(f"{where}: sweep: {problem}")
    return replace(
        _axis(name, declared, _read(declared, values, where), where), sweep=sweep, is_range=is_range
    )


def unit_of(name: str, rig: Rig) -> str:
    """Return the unit of an axis as quantities are written: "kg/m^3"; "" without dimension.

    Raises
    ------
    InputError
        When the name is unknown, or its values are no quantities.
    """
    declared = _declared(name, rig, name)
    if declared.metadata["kind"] != "quantity":
        raise InputError(f"{name}: is no quantity; take one, such as friction")
    return str(declared.metadata["unit"])


def direction_axis() -> Axis:
    """Return the axis that separates the two directions of a sweep."""
    return Axis(
        name=DIRECTION, dimension=DIRECTION, unit="1", values=(0.0, 1.0), long_name="direction of the sweep"
    )


def make_range(name: str, table: Mapping[str, object], rig: Rig, file: str = "") -> Axis:
    """Return an axis whose values are yet to be drawn, from `{start, stop}` and the `scale` "lin" or "log".

    Until then they are the two ends (`rubhpc.study.sampling.draw`).

    Raises
    ------
    InputError
        When the name is unknown, or nothing can be drawn from such a range.
    """
    where = place(file, "grid", name)
    if "sweep" in table:
        raise InputError(f"{where}: sweep: {NO_NEIGHBOURS}")
    declared = _declared(name, rig, where)
    if declared.metadata["kind"] != "quantity":
        raise InputError(f"{where}: none but a quantity is drawn from a range; write a list of values")
    ends = read_ends(table, declared.metadata["unit"], where)
    if name in SPEED_AXES and ends.start * ends.stop < 0:
        span = f"from {ends.start:g} to {ends.stop:g}"
        raise InputError(
            f"{where}: the range {span} contains 0, which is not a valid speed; use one sign only"
        )
    return replace(_axis(name, declared, (ends.start, ends.stop), where), drawn_from=ends)


def is_of_table(name: str) -> bool:
    """Whether an axis sets a key of [contact], [initial] or [run_up]."""
    return name.startswith((contact_axes.PREFIX, initial.PREFIX, RUN_UP_PREFIX))


def coordinate_of(name: str) -> str:
    """Return what an axis is called in a store."""
    return name.replace(".", "_")


def meanings_of(name: str) -> tuple[str, ...]:
    """Return what the values 0, 1, ... on an axis stand for; () where they are quantities."""
    return DIRECTIONS if name == DIRECTION else choices_of(name)


def written(name: str, value: float, unit: str) -> str:
    """Return a value on an axis for people, as in `friction=0.3`."""
    if meanings := meanings_of(name):
        return f"{name}={meanings[int(value)]}"
    return f"{name}={value:.6g}" + (f" {unit}" if unit not in ("", "1") else "")


def _axis(name: str, declared: Field[Any], values: tuple[float, ...], where: str) -> Axis:
    if problem := _problem(name, values):
        raise InputError(f"{where}: {problem}")
    return Axis(
        name=name,
        dimension=coordinate_of(name),
        unit=_store_unit(declared.metadata.get("unit", "")),
        values=values,
        long_name=_long_name(name),
    )


def _long_name(name: str) -> str:
    if name not in _OWN:
        return name.replace("_", " ").replace(".", " ")
    doc: str = _OWN[name].metadata["doc"].rstrip(".")
    return doc[0].lower() + doc[1:]


def flatten(table: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    """Return dotted keys and values of a table in which `stator.angle = 0` may be written without quotes."""
    pairs: list[tuple[str, Any]] = []
    for key, value in table.items():
        is_table = isinstance(value, dict) and value and not set(value) & set(_TABLE_KEYS)
        is_table = is_table and prefix + key not in _OWN and prefix.count(".") < 8
        pairs += flatten(value, f"{prefix}{key}.") if is_table else [(prefix + key, value)]
    return pairs


def _declared(name: str, rig: Rig, where: str) -> Field[Any]:
    if name in _OWN:
        return _OWN[name]
    if is_of_table(name):
        try:
            return contact_field(name) if name.startswith(contact_axes.PREFIX) else initial_field(name)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
    try:
        declared = find_key(rig, name)
    except InputError as error:
        hint = nearest(name, _OWN)
        if "." not in name and "?" in hint:
            raise InputError(f"{where}: unknown axis; {hint}") from None
        if str(error).startswith("unknown key") and "?" not in str(error):
            raise InputError(
                f"{where}: unknown axis; there is {', '.join(_OWN)} and any key of the rig"
            ) from None
        raise InputError(f"{where}: {str(error).replace('unknown key', 'unknown axis')}") from None
    if declared.metadata["kind"] == "choice":
        raise InputError(f"{where}: a word of the rig is no axis; set it in [override], one study for each")
    return declared


def _read_table(table: Mapping[str, object], where: str) -> tuple[object, str]:
    """The values in `{values, sweep}` or a range with a sweep, and how they are swept."""
    for key in table:
        if key not in _TABLE_KEYS:
            raise InputError(f"{where}: unknown key {brief(key)} in a range; {nearest(key, _TABLE_KEYS)}")
    sweep = table.get("sweep", FROM_REST)
    if sweep not in SWEEPS:
        raise InputError(f"{where}: sweep: {_unknown_sweep(sweep)}")
    rest = {key: value for key, value in table.items() if key != "sweep"}
    if "values" not in rest:
        return rest, str(sweep)
    if len(rest) > 1:
        other = next(key for key in rest if key != "values")
        raise InputError(f"{where}: {other} conflicts with values; give either a range or values")
    if isinstance(rest["values"], dict):
        raise InputError(f"{where}: values: {brief(rest['values'])} is no list; write values = [...]")
    return rest["values"], str(sweep)


def _why_not_swept(name: str) -> str:
    """Why no sweep runs along an axis; "" where one may."""
    if choices_of(name):
        return "words have no order to sweep along; leave it out, or sweep another axis"
    if name.startswith(initial.PREFIX):
        return "in a sweep a case starts where another has ended; sweep another axis"
    return ""


def _unknown_sweep(sweep: object) -> str:
    return f"{brief(sweep)} is unknown; {nearest(sweep if isinstance(sweep, str) else '', SWEEPS)}"


def _read(declared: Field[Any], values: object, where: str) -> tuple[float, ...]:
    if isinstance(values, dict):
        if declared.metadata["kind"] == "flag":
            raise InputError(f"{where}: a range between true and false; write [true, false]")
        if words := declared.metadata.get("of"):
            listed = ", ".join(f'"{word}"' for word in words)
            raise InputError(f"{where}: a range of words; write a list of them, such as [{listed}]")
        return tuple(read_range(values, declared.metadata.get("unit", ""), where))
    if not isinstance(values, list | tuple):
        values = [values]
    if len(values) > MOST_VALUES:
        raise InputError(f"{where}: {len(values)} values are too many; at most {MOST_VALUES}")
    return tuple(_number(declared, value, where) for value in values)


def _number(declared: Field[Any], value: object, where: str) -> float:
    """A value of a file as an axis holds it: of a word its place among the choices."""
    parsed = parse_field(declared, value, where)
    if declared.metadata["kind"] != "choice":
        return float(parsed)
    if problem := check_value(declared, parsed):
        raise InputError(f"{where}: {problem}")
    return float(declared.metadata["of"].index(parsed))


def _problem(name: str, values: tuple[float, ...], *, is_drawn: bool = False) -> str:
    """What is wrong with the values of an axis; "" when nothing is."""
    if not values:
        return "empty; give at least one value"
    if name in _OWN or (name.startswith(contact_axes.PREFIX) and not choices_of(name)):
        declared = _OWN[name] if name in _OWN else contact_field(name)
        for value in (min(values), max(values)):
            if problem := check_value(declared, value):
                return problem
    if name in SPEED_AXES and 0.0 in values:
        return "0 is no speed; leave it out, the rotor has to spin"
    if not is_drawn and len(set(values)) < len(values):
        ordered = sorted(values)
        twice = next(v for v, following in itertools.pairwise(ordered) if v == following)
        meanings = meanings_of(name)
        return f"{meanings[int(twice)] if meanings else f'{twice:.12g}'} is duplicated; remove one"
    return ""


def _store_unit(unit: str) -> str:
    """Return a pint-readable unit in the notation of the store: "kg/m^3" becomes "kg m-3"."""
    over, _, under = unit.partition("/")
    factors = [f for f in over.replace("^", "").replace("*", " ").split() if f != "1"]
    for factor in under.split():
        symbol, power = re.fullmatch(r"(\D+?)\^?(\d*)", factor).groups()  # type: ignore[union-attr]
        factors.append(f"{symbol}-{power or 1}")
    return " ".join(factors) or "1"
