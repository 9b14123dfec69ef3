"""The types in which a figure function declares its options, besides `bool`, `int`, `float` and `str`.

`postproc.catalogue` reads the annotations of a figure function with the names of this module and no others,
so that the command line knows them without loading the figure.
"""

from __future__ import annotations

import math
from collections.abc import Mapping as Mapping
from collections.abc import Sequence as Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated
from typing import Literal as Literal

from rubhpc.errors import InputError


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
HELP = {  # of options that several figures have, unless the figure's own docstring has it
    "full": "Forward and backward whirl of the orbit instead of a signal.",
    "probes": "Names of two probes at one place, whose motion is taken in place of the disc's.",
    "node": "Node of the rotor whose motion is taken: the recorded one, or one with two probes.",
    "stator": "Number of a stator, at whose node the motion is taken.",
    "over": "Draw the cases along AXIS over one another.",
}


def above_zero(value: float | str | None, unit: str, option: str) -> float | None:
    """Return an option as a number above 0, of a number or a text with or without a unit; None of None.

    InputError where it is something else; `option` names it.
    """
    from rubhpc.input.quantity import parse_quantity

    if value is None:
        return None
    with suppress(ValueError):  # text with a unit
        value = float(value)
    size = parse_quantity(value, unit, option)
    if size <= 0:
        raise InputError(f"{option}: {f'{size:g} {unit}'.strip()} is out of range; give one above 0")
    return size
