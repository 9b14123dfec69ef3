"""Colours, names and shares of the motions that starts reach."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from postproc.cases.basin_shares import name_of
from postproc.figures.palette import MOTION_COLORS, REGIME_COLORS
from postproc.store.units import plain_number
from rubhpc.schema import REGIME
from rubhpc.units import scale_for

if TYPE_CHECKING:
    import xarray as xr


def colors_of(data: xr.Dataset) -> dict[int, str]:
    """Colour of each motion that occurs, by its number."""
    numbers = [int(n) for n in data["attractor"].values if int(data["count"].sel(attractor=n).max()) > 0]
    shades = iter(MOTION_COLORS * (len(numbers) // len(MOTION_COLORS) + 1))
    return {n: REGIME_COLORS[0] if _is_free(data, n) else next(shades) for n in numbers}


def _of(data: xr.Dataset, name: str, number: int) -> int:
    """A property of a motion where it occurs; the most common value of several settings."""
    values = data[name].sel(attractor=number).values
    values = values[data["count"].sel(attractor=number).values > 0]
    found, n = np.unique(values, return_counts=True)
    return int(found[n.argmax()])


def _is_free(data: xr.Dataset, number: int) -> bool:
    return REGIME[_of(data, "motion_regime", number)] == "no_contact"


def motion_name(data: xr.Dataset, number: int) -> str:
    """Name of a motion by regime and period."""
    return name_of(_of(data, "motion_regime", number), _of(data, "motion_period", number))


def motion_label(data: xr.Dataset, number: int) -> str:
    """Number, name and share of a motion; the share is of one setting."""
    text = f"{number}: {motion_name(data, number)}"
    motion = data.sel(attractor=number)
    if motion["fraction"].size > 1:
        return text
    low, high = (100 * float(motion[f"fraction_{end}"].squeeze()) for end in ("low", "high"))
    return f"{text}, {100 * float(motion['fraction'].squeeze()):.3g} % ({low:.3g} to {high:.3g})"


def described(data: xr.Dataset) -> list[str]:
    """Lines of text, one for each motion of one setting."""
    lines = []
    for number in colors_of(data):
        motion = data.sel(attractor=number)
        means = []
        for name in (str(n) for n in data.data_vars if str(n).startswith("mean_")):
            value, about = float(motion[name]), data[name].attrs
            scale = scale_for(str(about.get("units", "1")), abs(value))
            means.append(f"{about.get('long_name', name)} {plain_number(value * scale.factor)} {scale.unit}")
        count = f"{int(motion['count'])} of {int(motion['n_start'])} starts"
        lines.append("; ".join([f"motion {motion_label(data, number)}", count, *means]))
    if left := int(data["n_without_motion"]):
        lines.append(f"without a motion: {left} starts, not done or not settled")
    return lines
