"""The types in which a figure function declares its options, besides `bool`, `int`, `float` and `str`.

`postproc.catalogue` reads the annotations of a figure function with the names of this module and no others,
so that the command line knows them without loading the figure.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Literal

from rubhpc.errors import InputError

__all__ = [
    "Annotated",
    "Axis",
    "Bounds",
    "Count",
    "File",
    "Hertz",
    "Literal",
    "Mapping",
    "Metavar",
    "Positive",
    "Seed",
    "Sequence",
    "Share",
    "Speed",
    "end_of_abscissa",
    "hertz",
    "spin_speed",
]


@dataclass(frozen=True)
class Bounds:
    """Range of a number; `is_open` leaves the bounds themselves out."""

    least: int | float | None = None
    most: float | None = None
    is_open: bool = False

    def __contains__(self, value: float) -> bool:
        low = -math.inf if self.least is None else self.least
        high = math.inf if self.most is None else self.most
        return low < value < high if self.is_open else low <= value <= high

    def __str__(self) -> str:
        least, most = ("above", "below") if self.is_open else ("at least", "at most")
        ends = ((least, self.least), (most, self.most))
        return " and ".join(f"{word} {end:g}" for word, end in ends if end is not None)


@dataclass(frozen=True)
class Metavar:
    """Name of a value in the help of the command line."""

    name: str


Axis = Annotated[str, Metavar("AXIS")]
File = Annotated[str, Metavar("FILE")]
Hertz = Annotated[float | str, Metavar("HZ")]  # a number, or text with a unit
Speed = Annotated[float | str, Metavar("SPEED")]  # a number (rad/s), or text with a unit
Count = Annotated[int, Bounds(least=1)]
Seed = Annotated[int, Bounds(least=0)]
Positive = Annotated[float, Bounds(least=0.0, is_open=True)]
Share = Annotated[float, Bounds(least=0.0, most=1.0, is_open=True)]


def hertz(value: float | str, option: str) -> float:
    """Return a frequency above 0, Hz, of a number or a text with or without a unit.

    Raises
    ------
    InputError
        The text is not a frequency, or not above 0; `option` names it.
    """
    return _above_zero(value, "Hz", option)


def end_of_abscissa(value: float | str | None, orders: bool) -> float | None:
    """Return the end of an abscissa, Hz or `orders` of the spin speed; None of none.

    Raises
    ------
    InputError
        It is not a frequency, or no number of orders, or not above 0.
    """
    return None if value is None else _above_zero(value, "" if orders else "Hz", "--max")


def spin_speed(value: float | str, option: str) -> float:
    """Return a spin speed above 0, rad/s, likewise."""
    return _above_zero(value, "rad/s", option)


def _above_zero(value: float | str, unit: str, option: str) -> float:
    from rubhpc.input.quantity import parse_quantity

    with suppress(ValueError):  # text with a unit
        value = float(value)
    size = parse_quantity(value, unit, option)
    if size <= 0:
        raise InputError(f"{option}: {f'{size:g} {unit}'.strip()} is out of range; give one above 0")
    return size
