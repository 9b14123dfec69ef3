"""Units in which SI quantities are written for people: with the prefix that suits the size, speeds in rpm."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
# Units as a store spells them, as an axis does, and the prefixes that engineers put before them.
_WRITTEN = {
    "m": ("m", "mµn"),
    "rad": ("rad", "mµn"),
    "N": ("N", "kM"),
    "N s": ("N s", "mµ"),
    "J": ("J", "kmµ"),
    "s": ("s", "mµ"),
    "Pa": ("Pa", "GMk"),
    "Hz": ("Hz", "kM"),
    "kg": ("kg", ""),
    "kg m-3": ("kg m⁻³", ""),
    "kg/m^3": ("kg m⁻³", ""),
    "m s-1": ("m s⁻¹", "mµ"),
    "rad s-1": ("rad s⁻¹", ""),
    "rad/s": ("rad s⁻¹", ""),
    "rad s-2": ("rad s⁻²", ""),
    "m s-2": ("m s⁻²", ""),
    "N m-1": ("N m⁻¹", "MGk"),
    "N/m": ("N m⁻¹", "MGk"),
}
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_LOWERED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
_POWER = re.compile(r"([^\W\d]+)([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)")
_MICRO_UP_TO = 2e-3  # orbits stay in µm, and twists in µrad, a little beyond a thousand of them


@dataclass(frozen=True)
class Scale:
    """How a unit is displayed: multiply by `factor`, write `unit`."""

    factor: float
    unit: str

    def label(self, text: str) -> str:
        """Return `text` with the unit in brackets; without a unit, `text`."""
        return f"{text} ({self.unit})" if self.unit else text


RPM = Scale(60 / (2 * math.pi), "rpm")  # as speeds are read on a test bench
_DEGREES = Scale(180 / math.pi, "deg")


def scale_for(unit: str, size: float) -> Scale:
    """Return the scale in which a quantity of magnitude `size` (SI) reads between 1 and 1000."""
    if unit in ("", "1", "dimensionless"):
        return Scale(1.0, "")
    written, prefixes = _WRITTEN.get(unit, (typeset(unit), ""))
    if not math.isfinite(size) or size <= 0:
        return Scale(1.0, written)
    if "µ" in prefixes and 1e-6 <= size <= _MICRO_UP_TO and unit in ("m", "rad"):
        return Scale(1e6, f"µ{written}")
    # The largest prefix that leaves at least one whole unit; below the smallest prefix, the smallest.
    offered = [(value, sign) for value, sign in _PREFIXES if sign == "" or sign in prefixes]
    value, sign = next(
        ((value, sign) for value, sign in offered if size >= value * (1 - 1e-9)),
        offered[-1],
    )
    return Scale(1 / value, f"{sign}{written}")


def typeset(unit: str) -> str:
    """Return a unit with raised powers: `N m s⁻¹` for `N m s-1`."""
    return re.sub(r"(?<=[A-Za-z])-?\d+", lambda power: power.group().translate(_RAISED), unit)


def typed(unit: str) -> str:
    """Return a displayed unit as a study file or `--select` reads it: `kg/m^3` for `kg m⁻³`."""
    over: list[str] = []
    under: list[str] = []
    for factor in unit.replace("µ", "u").split():
        found = _POWER.fullmatch(factor)
        power = int(found[2].translate(_LOWERED)) if found else 1
        symbol = found[1] if found else factor
        (over if power > 0 else under).append(symbol if abs(power) == 1 else f"{symbol}^{abs(power)}")
    return "/".join(["*".join(over) or "1", *under]) if unit else ""


def typed_quantity(value: float, unit: str) -> str:
    """Return a setting as a study file may state it: `84 um`, `1200 rpm`, `-45 deg`; `unit` as in a store."""
    scales = {"rad s-1": RPM, "rad": _DEGREES}
    scale = scales.get(unit) or scale_for(unit, abs(value))
    return f"{value * scale.factor:.6g} {typed(scale.unit)}".rstrip()
