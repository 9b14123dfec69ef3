"""The motions that starts reach: their colours and names, and their orbits or section points."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.cases.basin_shares import name_of
from postproc.figures.orbit import draw_stators
from postproc.figures.palette import MOTION_COLORS, REGIME_COLORS
from postproc.store.units import displayed, plain_number
from rubhpc.schema import REGIME
from rubhpc.units import scale_for

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr
    from matplotlib.axes import Axes

_ROOM = 1.15  # of the largest displacement, around it
_FAR = 3.0  # times that: stators beyond are not drawn


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


def draw_motions(data: xr.Dataset, case: xr.Dataset, colors: Mapping[int, str], ax: Axes) -> Axes:
    """Draw the orbit of each motion in its colour, or its section points alone, with clearance and stators.

    `data` is that of `postproc.cases.basin_shares.examples`, of one setting, and `case` one of that setting,
    with its clearance and rig.
    """
    kind = "orbit" if "orbit_vertical" in data else "motion_section"
    vertical, horizontal = data[f"{kind}_vertical"], data[f"{kind}_horizontal"]
    size = float(np.nanmax(np.abs([vertical.values, horizontal.values])))
    scale = scale_for("m", size)
    reach = _ROOM * size * scale.factor
    is_known = "clearance" in case.variables and case["clearance"].size == 1
    if is_known and 0.0 < float(case["clearance"].item()) * scale.factor < _FAR * reach:
        draw_stators(case.squeeze(), ax, scale.factor, reach)
    for number, color in colors.items():
        if number not in data["attractor"].values:  # inferred alone
            continue
        motion = data.sel(attractor=number)
        if kind == "orbit":
            y, z = (motion[f"orbit_{n}"].values * scale.factor for n in ("vertical", "horizontal"))
            ax.plot(z, y, color=color, linewidth=0.5, zorder=3)
        y, z = (motion[f"motion_section_{n}"].values * scale.factor for n in ("vertical", "horizontal"))
        mark: dict[str, Any] = {"markersize": 3.5, "markeredgecolor": "white", "markeredgewidth": 0.3}
        ax.plot(z, y, "o", color=color, zorder=4, **mark)
    ax.set_aspect("equal", adjustable="datalim")
    ax.locator_params(nbins=5)
    ax.set(xlabel=scale.label("Horizontal displacement"), ylabel=scale.label("Vertical displacement"))
    return ax


def draw_sections(data: xr.Dataset, axis: str, colors: Mapping[int, str], ax: Axes) -> Axes:
    """Draw the section points of each motion over an axis, in its colour."""
    x, x_label = displayed(data[axis])
    points = data["motion_section_vertical"].transpose(axis, "attractor", "section")
    scale = scale_for("m", float(np.nanmax(np.abs(points.values))))
    for number, color in colors.items():
        if number not in data["attractor"].values:
            continue
        of_motion = points.sel(attractor=number).values * scale.factor
        ax.plot(x, of_motion, ".", color=color, markersize=1.8)
    ax.set(xlabel=x_label, ylabel=scale.label("Vertical displacement\nonce a revolution"))
    return ax
