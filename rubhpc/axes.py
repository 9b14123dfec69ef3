"""The axes of a study's grid: lists, ranges and scalars of a file become values in SI units."""

from __future__ import annotations

import hashlib
import itertools
import re
import struct
from dataclasses import Field, dataclass, fields, replace
from typing import TYPE_CHECKING, Any

from rubhpc.errors import InputError
from rubhpc.input.dotted import find_key
from rubhpc.input.fields import check_value, nearest, parse_field, place, quantity
from rubhpc.input.ranges import MOST_VALUES, RANGE_KEYS, Range, read_ends, read_range

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rubhpc.rig import Rig


@dataclass(frozen=True, kw_only=True)
class _OwnAxes:
    """The axes that are no keys of the rig, declared as any other field is."""

    speed_ratio: float = quantity("")
    speed: float = quantity("rad/s")
    clearance_ratio: float = quantity("", above=0)
    clearance: float = quantity("m", above=0)
    friction: float = quantity("", at_least=0)


_OWN = {declared.name: declared for declared in fields(_OwnAxes)}
_LONG_NAMES = {
    "speed_ratio": "spin speed over the first lateral frequency of the rotor at standstill",
    "speed": "spin speed",
    "clearance_ratio": "radial clearance over the contact-free amplitude at the speed",
    "clearance": "radial clearance at rest",
    "friction": "coefficient of friction",
}
SPEED_AXES = ("speed_ratio", "speed")
CLEARANCE_AXES = ("clearance_ratio", "clearance")


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
        In SI units, each once, in any order; of drawn ones, one a case of the sample.
    long_name : str
        What labels and attributes say.
    drawn_from : Range or None
        Where the values are a sample's. Such axes share a dimension.
    """

    name: str
    dimension: str
    unit: str
    values: tuple[float, ...]
    long_name: str
    drawn_from: Range | None = None

    def __post_init__(self) -> None:
        if problem := _problem(self.name, self.values, is_drawn=self.drawn_from is not None):
            raise InputError(f"{place('', 'grid', self.name)}: {problem}")

    @property
    def coordinate(self) -> str:
        """Name of its values in a store: "stator_youngs_modulus"."""
        return coordinate_of(self.name)

    @property
    def is_rig_key(self) -> bool:
        """Whether the axis sets a key of the rig."""
        return self.name not in _OWN

    @property
    def tried(self) -> tuple[float, ...]:
        """What to try out before a run: all values, or the ends of what they are drawn from."""
        return self.values if self.drawn_from is None else (self.drawn_from.start, self.drawn_from.stop)


def make_axis(name: str, values: object, rig: Rig, file: str = "") -> Axis:
    """Return an axis from what stands for it in a file: a list, a range or a single value.

    Parameters
    ----------
    name : str
        A dotted key of the rig, or one of speed_ratio, speed, clearance_ratio, clearance, friction.
    values : list, dict or single value
        A dict is a range, stop included: `{start, stop, step}`, or `{start, stop, num}` with the `scale`
        "lin" or "log".
    rig : Rig
        Whose keys the axis may name.
    file : str
        What errors name.

    Raises
    ------
    InputError
        When the name is unknown, or a value is not what the axis holds, or stands twice.
    """
    where = place(file, "grid", name)
    declared = _declared(name, rig, where)
    return _axis(name, declared, _read(declared, values, where), where)


def make_range(name: str, table: Mapping[str, object], rig: Rig, file: str = "") -> Axis:
    """Return an axis whose values are yet to be drawn, from `{start, stop}` and the `scale` "lin" or "log".

    Until then they are the two ends (`rubhpc.sample.draw`).

    Raises
    ------
    InputError
        When the name is unknown, or nothing can be drawn from such a range.
    """
    where = place(file, "grid", name)
    declared = _declared(name, rig, where)
    if declared.metadata["kind"] != "quantity":
        raise InputError(f"{where}: none but a quantity is drawn from a range; write a list of values")
    ends = read_ends(table, declared.metadata["unit"], where)
    if name in SPEED_AXES and ends.start * ends.stop < 0:
        told = f"from {ends.start:g} to {ends.stop:g}"
        raise InputError(f"{where}: the range {told} holds 0, which is no speed; take one side of it")
    return replace(_axis(name, declared, (ends.start, ends.stop), where), drawn_from=ends)


def coordinate_of(name: str) -> str:
    """Return what an axis is called in a store."""
    return name.replace(".", "_")


def case_id(identity: str, point: Sequence[float]) -> str:
    """Return the id of a case: a hash of its study's identity and of its values on the axes.

    It outlives the growth of any axis, and the order of the values on it.
    """
    digest = hashlib.sha256(identity.encode())
    digest.update(struct.pack(f"<{len(point)}d", *point))
    return digest.hexdigest()[:32]


def _axis(name: str, declared: Field[Any], values: tuple[float, ...], where: str) -> Axis:
    if problem := _problem(name, values):
        raise InputError(f"{where}: {problem}")
    return Axis(
        name=name,
        dimension=coordinate_of(name),
        unit=_store_unit(declared.metadata.get("unit", "")),
        values=values,
        long_name=_LONG_NAMES.get(name, name.replace("_", " ").replace(".", " ")),
    )


def flatten(table: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    """Return dotted keys and values of a table in which `stator.angle = 0` may stand without quotes."""
    pairs: list[tuple[str, Any]] = []
    for key, value in table.items():
        is_table = isinstance(value, dict) and value and not set(value) & set(RANGE_KEYS)
        is_table = is_table and prefix + key not in _OWN and prefix.count(".") < 8
        pairs += flatten(value, f"{prefix}{key}.") if is_table else [(prefix + key, value)]
    return pairs


def _declared(name: str, rig: Rig, where: str) -> Field[Any]:
    if name in _OWN:
        return _OWN[name]
    try:
        return find_key(rig, name)
    except InputError as error:
        mend = nearest(name, _OWN)
        if "." not in name and "?" in mend:
            raise InputError(f"{where}: unknown axis; {mend}") from None
        if str(error).startswith("unknown key") and "?" not in str(error):
            raise InputError(
                f"{where}: unknown axis; there is {', '.join(_OWN)} and any key of the rig"
            ) from None
        raise InputError(f"{where}: {str(error).replace('unknown key', 'unknown axis')}") from None


def _read(declared: Field[Any], values: object, where: str) -> tuple[float, ...]:
    if isinstance(values, dict):
        if declared.metadata["kind"] == "flag":
            raise InputError(f"{where}: a range between true and false; write [true, false]")
        return tuple(read_range(values, declared.metadata.get("unit", ""), where))
    if not isinstance(values, list | tuple):
        values = [values]
    if len(values) > MOST_VALUES:
        raise InputError(f"{where}: {len(values)} values are too many; at most {MOST_VALUES}")
    return tuple(float(parse_field(declared, value, where)) for value in values)


def _problem(name: str, values: tuple[float, ...], *, is_drawn: bool = False) -> str:
    """What is wrong with the values of an axis; "" when nothing is."""
    if not values:
        return "empty; give at least one value"
    if name in _OWN:
        for value in (min(values), max(values)):
            if problem := check_value(_OWN[name], value):
                return problem
    if name in SPEED_AXES and 0.0 in values:
        return "0 is no speed; leave it out, the rotor has to spin"
    if not is_drawn and len(set(values)) < len(values):
        ordered = sorted(values)
        twice = next(v for v, following in itertools.pairwise(ordered) if v == following)
        return f"{twice:.12g} stands twice; leave one out"
    return ""


def _store_unit(unit: str) -> str:
    """Return a pint-readable unit in the notation of the store: "kg/m^3" becomes "kg m-3"."""
    over, _, under = unit.partition("/")
    factors = [f for f in over.replace("^", "").split() if f != "1"]
    for factor in under.split():
        symbol, power = re.fullmatch(r"(\D+?)\^?(\d*)", factor).groups()  # type: ignore[union-attr]
        factors.append(f"{symbol}-{power or 1}")
    return " ".join(factors) or "1"
