"""The motions that starts reach, drawn next to their basins: orbits, or section points along an axis."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.figures.orbit import draw_stators
from postproc.store.units import displayed
from rubhpc.units import scale_for

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr
    from matplotlib.axes import Axes

_ROOM = 1.15  # of the largest displacement, around it
_FAR = 3.0  # times that: stators beyond are not drawn


def draw_motions(data: xr.Dataset, case: xr.Dataset, colors: Mapping[int, str], ax: Axes) -> Axes:
    """Draw the orbit of each motion in its colour, or its section points alone, with clearance and stators.

    Parameters
    ----------
    data : Dataset
        From `postproc.cases.motion_examples.examples`, of one setting.
    case : Dataset
        Of that setting: `clearance`, and the rig among its attributes.
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
