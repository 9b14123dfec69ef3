"""Numbers from files and callers: plain ones in SI units, or text with a unit, `"100 um"`, read with pint."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from typing import TYPE_CHECKING, Any

from rubhpc.errors import InputError
from rubhpc.input.messages import brief, nearest

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

LEAST, GREATEST = 1e-30, 1e30  # size of a quantity: beyond, sums of products of a few leave the floats
# One number, then a product of units. Nothing else reaches pint, whose grammar also takes sums and towers of
# powers.
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,4})?"
_UNIT = r"[^\W\d]\w{0,40}(?:(?:\^|\*\*)-?\d(?:\.5)?)?|%|°"
_JOIN = r"(?:\s*[*/·]\s*|\s+)"
_TEXT = re.compile(rf"\s*({_NUMBER})\s*((?:1\s*/\s*)?(?:{_UNIT})(?:{_JOIN}\(?(?:{_UNIT})\)?){{0,7}})?\s*")

# The everyday units: loading pint costs every rank 0.4 s, and most files need nothing but these.
_EVERYDAY = {
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6},
    "kg": {"kg": 1.0, "g": 1e-3},
    "Pa": {"Pa": 1.0, "MPa": 1e6, "GPa": 1e9},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
    "rad": {"rad": 1.0, "deg": math.pi / 180},
    "rad/s": {"rad/s": 1.0, "rpm": math.pi / 30},
    "Hz": {"Hz": 1.0, "rpm": 1 / 60},
    "N/m": {"N/m": 1.0},
    "": {"%": 1e-2},
}
_EXAMPLES = {
    "m": '"100 um"',
    "kg": '"8 g"',
    "Pa": '"3 GPa"',
    "s": '"0.5 us"',
    "rad": '"90 deg"',
    "rad/s": '"1800 rpm"',
    "Hz": '"31.56 Hz"',
    "N/m": '"1e6 N/m"',
    "N s/m": '"100 N s/m"',
    "N m/rad": '"5e3 N m/rad"',
    "N m s/rad": '"5 N m s/rad"',
    "kg m^2": '"0.01 kg m^2"',
    "kg*m^2": '"0.01 kg m^2"',
    "kg/m^3": "7800.0",
    "": "0.3",
}


class WithUnit(float):
    """A number read from text in one of two units that a field may have."""

    unit: str

    @classmethod
    def of(cls, number: float, unit: str) -> WithUnit:
        """Return a number in a unit."""
        made = cls(number)
        made.unit = unit
        return made


def parse_quantity(value: object, unit: str, where: str) -> float:
    """Return a number in `unit`, the SI unit of the field.

    Parameters
    ----------
    value : int, float or str
        A number counts as SI; text carries a number and a unit ("1800 rpm", "100 um", "5 %").
        A rotation speed (`unit` rad/s) names turns or an angle: "rpm", "turn/s", "rad/s", "deg/s".
    unit : str
        Unit of the result, readable by pint; "" for a number without dimension.
    where : str
        Start of error messages: "study.toml: [grid] speed".

    Raises
    ------
    InputError
        When `value` is not a finite number, or has the wrong unit, or one such as 1/min or Hz for a rotation
        speed, which may count turns or radians.
    """
    if isinstance(value, str):
        return _parse_text(value, unit, where)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{where}: {brief(value)} is not a number; {_fix(unit)}")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if problem := out_of_range(number):
        raise InputError(f"{where}: {brief(value)} {problem}")
    return number + 0.0  # no negative zero, which would be a second case


def out_of_range(number: float) -> str:
    """Return why no quantity has this value, in SI units, and how to fix it; "" where one may."""
    if not math.isfinite(number):
        return "is not finite; write a finite number"
    if number and not LEAST <= abs(number) <= GREATEST:
        return f"is out of range; its size must be 0, or from {LEAST:g} to {GREATEST:g} in SI units"
    return ""


def _parse_text(text: str, unit: str, where: str) -> float:
    match = _TEXT.fullmatch(text) if len(text) <= 200 else None
    if match is None:
        raise InputError(f"{where}: {brief(text)} is not a number with a unit; {_fix(unit)}")
    number, given = match[1], (match[2] or "").strip()
    if not given and unit:
        raise InputError(f"{where}: {brief(text)} has no unit; write {brief(f'{number} {unit}')} or a number")
    factor = 1.0 if given == unit else _EVERYDAY.get(unit, {}).get(given) or _factor(given, unit, where, text)
    # In decimals "30 um" is 3e-05, the very number that a user writes in SI; 30 * 1e-6 is not.
    result = float(Decimal(number) * Decimal(repr(factor)))
    if problem := out_of_range(result):
        raise InputError(f"{where}: {brief(text)} {problem}")
    return result + 0.0


def _factor(given: str, unit: str, where: str, text: str) -> float:
    """Factor from the unit given to the one wanted."""
    import pint

    registry = _registry()
    try:
        units, wanted = registry.parse_units(given), registry.parse_units(unit)
        factor = float(registry.convert(1.0, units, wanted))
        has_offset = registry.convert(0.0, units, wanted) != 0.0
    except pint.DimensionalityError:
        kind = f"in {unit}" if unit else "a plain number"
        raise InputError(f"{where}: {brief(text)} is not {kind}; {_fix(unit)}") from None
    except Exception:
        raise InputError(f'{where}: unknown unit "{given}"; {_fix(unit)}') from None
    if has_offset or not math.isfinite(factor) or factor <= 0:
        raise InputError(f"{where}: {brief(text)} is not a multiple of {unit or 1}; {_fix(unit)}")
    # To pint a radian is 1, and so is the turn in a hertz: count the turns that it loses.
    turns = _turns(units) - _turns(wanted)
    if _is_rotation(wanted) and _angles(units) != 1:
        raise InputError(_ambiguous(text, factor, where))
    if _angles(units) + turns == _angles(wanted):
        factor *= (2 * math.pi) ** turns
    tidy = float(f"{factor:.14g}")  # 999.9999999999999 for g/cm^3
    return tidy if abs(tidy / factor - 1) < 5e-16 else factor


@cache
def _registry() -> Any:
    import pint

    registry: Any = pint.UnitRegistry()
    registry.define("@alias revolution = rev")
    return registry


def _is_rotation(wanted: Any) -> bool:
    return _angles(wanted) == 1 and wanted.dimensionality == {"[time]": -1}


def _ambiguous(text: str, per_second: float, where: str) -> str:
    """Return the problem of a unit such as 1/min or Hz for a rotation speed, and both ways to write it."""
    number = _TEXT.fullmatch(text)[1]  # type: ignore[index]
    value = float(Decimal(number) * Decimal(f"{per_second:.14g}"))
    return (
        f"{where}: {brief(text)} is ambiguous for a rotation speed; "
        f'write "{60 * value:.12g} rpm" if it counts turns, "{value:.12g} rad/s" if it counts radians'
    )


def _turns(units: Any) -> float:
    return sum(float(p) for name, p in units._units.items() if name.endswith("hertz"))


def _angles(units: Any) -> float:
    _, root = _registry().get_root_units(units)
    return float(root._units.get("radian", 0))


def example_of(unit: str) -> str:
    """Return how a value of that unit may be written in a file."""
    return _EXAMPLES.get(unit) or f'"1.5 {unit}"'


def _fix(unit: str) -> str:
    return (
        f"write a number ({unit}) or text such as {example_of(unit)}"
        if unit
        else f"write a number such as {example_of(unit)}"
    )


MOST_VALUES = 100_000  # of one axis: a typing error must not fill the memory
RANGE_KEYS = ("start", "stop", "step", "num", "scale")
_DRAWN_KEYS = ("start", "stop", "scale")


@dataclass(frozen=True, kw_only=True)
class Range:
    """Interval that a sample is drawn from, uniformly or (`scale` "log") log-uniformly."""

    start: float
    stop: float
    scale: str = "lin"

    def at(self, share: float) -> float:
        """Return the value at a fraction of the way from start to stop."""
        if self.scale == "log":
            return float(self.start * (self.stop / self.start) ** share)
        return self.start + share * (self.stop - self.start)


def read_range(table: Mapping[str, object], unit: str, where: str) -> list[float]:
    """Return the values of `{start, stop, step}` or `{start, stop, num, scale}`, the stop included.

    Parameters
    ----------
    table : dict
        As TOML gives it.
    unit : str
        SI unit of plain numbers.
    where : str
        Start of error messages.
    """
    fix = "write { start, stop, step } or { start, stop, num }"
    start, stop = _start_and_stop(table, unit, where, RANGE_KEYS, fix)
    if ("step" in table) == ("num" in table):
        raise InputError(
            f"{where}: a range has either step or num; write one of them, or add [sample] to draw values"
        )
    if "step" in table:
        if "scale" in table:
            raise InputError(f"{where}: scale conflicts with step; use num instead of step, or remove scale")
        return _stepped(start, stop, parse_quantity(table["step"], unit, f"{where}: step"), where)
    num = table["num"]
    if isinstance(num, bool) or not isinstance(num, int) or not 2 <= num <= MOST_VALUES:
        raise InputError(
            f"{where}: num {brief(num)} is not a count; write a whole number from 2 to {MOST_VALUES}"
        )
    if _scale(table, start, stop, where) == "lin":
        return [_exact(start, stop, i, num - 1) for i in range(num)]
    inner = [start * (stop / start) ** (i / (num - 1)) for i in range(1, num - 1)]
    return [start, *inner, stop]


def read_ends(table: Mapping[str, object], unit: str, where: str) -> Range:
    """Return the range of `{start, stop}` or `{start, stop, scale}` that values are to be drawn from."""
    for key in ("step", "num"):
        if key in table:
            problem = f"{key}: a sample is drawn from start to stop"
            raise InputError(f"{where}: {problem}; remove {key} or [sample]")
    start, stop = _start_and_stop(table, unit, where, _DRAWN_KEYS, "write { start, stop }")
    if start == stop:
        raise InputError(f"{where}: start and stop are both {start:g}; write that value alone")
    return Range(start=start, stop=stop, scale=_scale(table, start, stop, where))


def _start_and_stop(
    table: Mapping[str, object], unit: str, where: str, known: Sequence[str], fix: str
) -> tuple[float, float]:
    for key in table:
        if key not in known:
            raise InputError(f"{where}: unknown key {brief(key)} in a range; {nearest(key, known)}")
    for key in ("start", "stop"):
        if key not in table:
            raise InputError(f"{where}: a range needs {key}; {fix}")
    start, stop = (parse_quantity(table[key], unit, f"{where}: {key}") for key in ("start", "stop"))
    return start, stop


def _scale(table: Mapping[str, object], start: float, stop: float, where: str) -> str:
    scale = table.get("scale", "lin")
    if scale not in ("lin", "log"):
        raise InputError(f'{where}: scale {brief(scale)} is unknown; choose one of "lin", "log"')
    if scale == "log" and start * stop <= 0:
        raise InputError(f"{where}: a logarithmic range from {start:g} to {stop:g}; both must be above 0")
    return str(scale)


def _stepped(start: float, stop: float, step: float, where: str) -> list[float]:
    if step == 0 or (stop - start) / step < 0:
        raise InputError(
            f"{where}: step {step:g} does not lead from {start:g} to {stop:g}; change its sign or size"
        )
    n_step = (stop - start) / step
    if n_step >= MOST_VALUES:
        raise InputError(
            f"{where}: {n_step:.3g} values are too many; at most {MOST_VALUES} are allowed, use a longer step"
        )
    n_step = math.floor(n_step + 1e-6)  # 6.1 is reached from 0.9 by 26 steps of 0.2, whatever their last bits
    # In decimals, so that the fourth value is the 1.5 that a user writes and a longer range meets it.
    first, stride = Decimal(repr(start)), Decimal(repr(step))
    return [float(first + i * stride) + 0.0 for i in range(n_step + 1)]


def _exact(start: float, stop: float, i: int, n: int) -> float:
    """Value i of n + 1 evenly spaced ones, rounded once."""
    first, last = Decimal(repr(start)), Decimal(repr(stop))
    return float((first * (n - i) + last * i) / n) + 0.0
