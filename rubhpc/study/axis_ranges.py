"""The ranges of a study's axes as text, speeds in rpm and clearances as lengths."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rubhpc.study.axes import CLEARANCE_AXES, SPEED_AXES
from rubhpc.units import typed_quantity

if TYPE_CHECKING:
    from rubhpc.study.axes import Axis
    from rubhpc.study.cases import CaseGrid


def axis_ranges(grid: CaseGrid) -> tuple[str, ...]:
    """Range of each axis, as in `speed_ratio 0.9 to 6.1: 1704 to 11550 rpm`; a text each."""
    ratios = {name for name in (*SPEED_AXES, *CLEARANCE_AXES) if name.endswith("_ratio")}
    has_ratio = any(axis.name in ratios for axis in grid.study.axes)
    points = grid.operating_points() if has_ratio else {}  # those of many speeds take long
    texts = []
    for axis in grid.study.axes:
        text = f"{axis.name} {_values(axis)}"
        for names, variable, unit in (
            (SPEED_AXES, "spin_speed", "rad s-1"),
            (CLEARANCE_AXES, "clearance", "m"),
        ):
            if axis.name in ratios.intersection(names):
                values = points[variable][1]
                text += f": {_range(float(values.min()), float(values.max()), unit)}"
        texts.append(text)
    return tuple(texts)


def _values(axis: Axis) -> str:
    if words := axis.words:
        return ", ".join(words)
    return _range(min(axis.values), max(axis.values), axis.unit)


def _range(least: float, most: float, unit: str) -> str:
    low, high = typed_quantity(least, unit), typed_quantity(most, unit)
    if low == high:
        return low
    (low_number, _, low_unit), (_, _, high_unit) = low.partition(" "), high.partition(" ")
    return f"{low_number if low_unit == high_unit else low} to {high}"
