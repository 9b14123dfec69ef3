"""Ranges in a file: values from start to stop, or the two ends between which a sample is drawn."""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal
from typing import TYPE_CHECKING

from rubhpc.errors import InputError
from rubhpc.input.messages import brief, nearest
from rubhpc.input.quantity import parse_quantity

if TYPE_CHECKING:
    from collections.abc import Mapping

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

    Raises
    ------
    InputError
        When the table is not a range, or has too many values.
    """
    for key in table:
        if key not in RANGE_KEYS:
            raise InputError(f"{where}: unknown key {brief(key)} in a range; {nearest(key, RANGE_KEYS)}")
    for key in ("start", "stop"):
        if key not in table:
            raise InputError(
                f"{where}: a range needs {key}; write {{ start, stop, step }} or {{ start, stop, num }}"
            )
    if ("step" in table) == ("num" in table):
        raise InputError(
            f"{where}: a range has either step or num; write one of them, or add [sample] to draw values"
        )
    start, stop = (parse_quantity(table[key], unit, f"{where}: {key}") for key in ("start", "stop"))
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
    """Return the range of `{start, stop}` or `{start, stop, scale}` that values are to be drawn from.

    Raises
    ------
    InputError
        When it is not such a range.
    """
    for key in ("step", "num"):
        if key in table:
            problem = f"{key}: a sample is drawn from start to stop"
            raise InputError(f"{where}: {problem}; remove {key} or [sample]")
    for key in table:
        if key not in _DRAWN_KEYS:
            raise InputError(f"{where}: unknown key {brief(key)} in a range; {nearest(key, _DRAWN_KEYS)}")
    for key in ("start", "stop"):
        if key not in table:
            raise InputError(f"{where}: a range needs {key}; write {{ start, stop }}")
    start, stop = (parse_quantity(table[key], unit, f"{where}: {key}") for key in ("start", "stop"))
    if start == stop:
        raise InputError(f"{where}: start and stop are both {start:g}; write that value alone")
    return Range(start=start, stop=stop, scale=_scale(table, start, stop, where))


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
