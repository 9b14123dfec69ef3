"""Values of a stored axis: which of them a number means, and their unit as a study states it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

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
