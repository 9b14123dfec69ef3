"""The axes of a study's grid: lists, ranges and scalars of a file become values in SI units."""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import Field, dataclass, fields
from decimal import Decimal
from typing import TYPE_CHECKING, Any

from rubhpc.errors import InputError
from rubhpc.input.dotted import find_key
from rubhpc.input.fields import check_value, nearest, parse_field, place, quantity
from rubhpc.input.quantity import brief, parse_quantity

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rubhpc.rig import Rig

MOST_VALUES = 10_000_000  # of one axis: beyond, a slip of the pen fills the memory


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
_RANGE_KEYS = ("start", "stop", "step", "num", "scale")
_TABLE_KEYS = ("values", *_RANGE_KEYS, "sweep")
SWEEPS = ("from_rest", "up", "down", "both")
FROM_REST, UP, DOWN, BOTH = SWEEPS
DIRECTION = "direction"  # the axis that a sweep both ways adds
DIRECTIONS = (UP, DOWN)  # meanings of 0 and 1 on it


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
        In SI units, each once; in any order, but rising where the axis is swept.
    long_name : str
        What labels and attributes say.
    sweep : {"from_rest", "up", "down", "both"}
        Whether each case starts at rest, or where its neighbour on this axis has ended.
    """

    name: str
    dimension: str
    unit: str
    values: tuple[float, ...]
    long_name: str
    sweep: str = FROM_REST

    def __post_init__(self) -> None:
        if self.sweep not in SWEEPS:
            raise InputError(f"{place('', 'grid', self.name)}: sweep: {_unknown_sweep(self.sweep)}")
        if self.sweep != FROM_REST:
            object.__setattr__(self, "values", tuple(sorted(self.values)))
        if problem := _problem(self.name, self.values):
            raise InputError(f"{place('', 'grid', self.name)}: {problem}")

    @property
    def coordinate(self) -> str:
        """Name of its values in a store: "stator_youngs_modulus"."""
        return coordinate_of(self.name)

    @property
    def is_rig_key(self) -> bool:
        """Whether the axis sets a key of the rig."""
        return self.name not in _OWN and self.name != DIRECTION


def make_axis(name: str, values: object, rig: Rig, file: str = "") -> Axis:
    """Return an axis from what stands for it in a file: a list, a range or a single value.

    Parameters
    ----------
    name : str
        A dotted key of the rig, or one of speed_ratio, speed, clearance_ratio, clearance, friction.
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
        When the name is unknown, or a value is not what the axis holds, or stands twice.
    """
    where = place(file, "grid", name)
    declared = _declared(name, rig, where)
    sweep = FROM_REST
    if isinstance(values, dict):
        values, sweep = _read_table(values, where)
    numbers = _read(declared, values, where)
    if problem := _problem(name, numbers):
        raise InputError(f"{where}: {problem}")
    return Axis(
        name=name,
        dimension=coordinate_of(name),
        unit=_store_unit(declared.metadata.get("unit", "")),
        values=numbers,
        long_name=_LONG_NAMES.get(name, name.replace("_", " ").replace(".", " ")),
        sweep=sweep,
    )


def direction_axis() -> Axis:
    """Return the axis that tells the two runs of a sweep both ways apart."""
    return Axis(
        name=DIRECTION, dimension=DIRECTION, unit="1", values=(0.0, 1.0), long_name="direction of the sweep"
    )


def written(name: str, value: float, unit: str) -> str:
    """Return a value on an axis for people, as in `friction=0.3`."""
    if name == DIRECTION:
        return f"{name}={DIRECTIONS[int(value)]}"
    return f"{name}={value:.6g}" + (f" {unit}" if unit not in ("", "1") else "")


def coordinate_of(name: str) -> str:
    """Return what an axis is called in a store."""
    return name.replace(".", "_")


def flatten(table: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    """Return dotted keys and values of a table in which `stator.angle = 0` may stand without quotes."""
    pairs: list[tuple[str, Any]] = []
    for key, value in table.items():
        is_table = isinstance(value, dict) and value and not set(value) & set(_TABLE_KEYS)
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


def _read_table(table: Mapping[str, object], where: str) -> tuple[object, str]:
    """What stands for the values in `{values, sweep}` or a range with a sweep, and how they are swept."""
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
        raise InputError(f"{where}: {other} stands beside values; give a range or values, one of the two")
    if isinstance(rest["values"], dict):
        raise InputError(f"{where}: values: {brief(rest['values'])} is no list; write values = [...]")
    return rest["values"], str(sweep)


def _unknown_sweep(sweep: object) -> str:
    return f"{brief(sweep)} is unknown; {nearest(sweep if isinstance(sweep, str) else '', SWEEPS)}"


def _read(declared: Field[Any], values: object, where: str) -> tuple[float, ...]:
    if isinstance(values, dict):
        if declared.metadata["kind"] == "flag":
            raise InputError(f"{where}: a range between true and false; write [true, false]")
        return tuple(_read_range(values, declared.metadata.get("unit", ""), where))
    if not isinstance(values, list | tuple):
        values = [values]
    if len(values) > MOST_VALUES:
        raise InputError(f"{where}: {len(values)} values are too many; at most {MOST_VALUES}")
    return tuple(float(parse_field(declared, value, where)) for value in values)


def _read_range(table: Mapping[str, object], unit: str, where: str) -> list[float]:
    """Values of `{start, stop, step}` or `{start, stop, num, scale}`."""
    for key in ("start", "stop"):
        if key not in table:
            raise InputError(
                f"{where}: a range without {key}; write {{ start, stop, step }} or {{ start, stop, num }}"
            )
    if ("step" in table) == ("num" in table):
        raise InputError(f"{where}: a range has either step or num; write one of them")
    start, stop = (parse_quantity(table[key], unit, f"{where}: {key}") for key in ("start", "stop"))
    if "step" in table:
        if "scale" in table:
            raise InputError(f"{where}: scale goes with num; write num instead of step, or leave scale out")
        return _stepped(start, stop, parse_quantity(table["step"], unit, f"{where}: step"), where)
    num, scale = table["num"], table.get("scale", "lin")
    if isinstance(num, bool) or not isinstance(num, int) or not 2 <= num <= MOST_VALUES:
        raise InputError(
            f"{where}: num {brief(num)} is no count; write a whole number from 2 to {MOST_VALUES}"
        )
    if scale == "lin":
        return [_exact(start, stop, i, num - 1) for i in range(num)]
    if scale != "log":
        raise InputError(f'{where}: scale {brief(scale)} is unknown; there is "lin", "log"')
    if start * stop <= 0:
        raise InputError(f"{where}: a logarithmic range from {start:g} to {stop:g}; both must be above 0")
    inner = [start * (stop / start) ** (i / (num - 1)) for i in range(1, num - 1)]
    return [start, *inner, stop]


def _stepped(start: float, stop: float, step: float, where: str) -> list[float]:
    if step == 0 or (stop - start) / step < 0:
        raise InputError(
            f"{where}: step {step:g} does not lead from {start:g} to {stop:g}; turn its sign or size"
        )
    n_step = (stop - start) / step
    if n_step >= MOST_VALUES:
        raise InputError(
            f"{where}: {n_step:.3g} values are too many; at most {MOST_VALUES}, take a longer step"
        )
    n_step = math.floor(n_step + 1e-6)  # 6.1 is reached from 0.9 by 26 steps of 0.2, whatever their last bits
    # In decimals, so that the fourth value is the 1.5 that a user writes and a longer range meets it.
    first, stride = Decimal(repr(start)), Decimal(repr(step))
    return [float(first + i * stride) + 0.0 for i in range(n_step + 1)]


def _exact(start: float, stop: float, i: int, n: int) -> float:
    """Value i of n + 1 evenly spaced ones, rounded once."""
    first, last = Decimal(repr(start)), Decimal(repr(stop))
    return float((first * (n - i) + last * i) / n) + 0.0


def _problem(name: str, values: tuple[float, ...]) -> str:
    """What is wrong with the values of an axis; "" when nothing is."""
    if not values:
        return "empty; give at least one value"
    if name in _OWN:
        for value in (min(values), max(values)):
            if problem := check_value(_OWN[name], value):
                return problem
    if name in SPEED_AXES and 0.0 in values:
        return "0 is no speed; leave it out, the rotor has to spin"
    if len(set(values)) < len(values):
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
