"""The linear design of the rotor on the page: critical speeds, and the Campbell diagram."""

from __future__ import annotations

import base64
import io
import json
import math
from functools import cache
from typing import TYPE_CHECKING, Any

from postproc.figures.campbell import campbell_diagram
from postproc.figures.style import house_style, new_figure
from postproc.store.rig_of_case import rig_of
from rubhpc.errors import RubError
from rubhpc.rig.reading import rig_from_dict

if TYPE_CHECKING:
    import xarray as xr

_RPM = 30 / math.pi


def design_facts(store: xr.Dataset) -> dict[str, Any]:
    """Return what the page says of the rotor without contact, of the rig as the study states it.

    Returns
    -------
    dict
        `rows`: one for each critical speed, with `speed` (rpm), `whirl`, `damping` (%) and `excited`, as
        text; `diagram`: the Campbell diagram as an address that contains its SVG; `text`: on stability, or
        why there is no linear design.
    """
    try:
        return _facts(json.dumps(rig_of(store).as_dict(), sort_keys=True))
    except RubError as error:
        return {"rows": [], "diagram": "", "text": f"There is no linear design of this rig: {error}."}


@cache
def _facts(table: str) -> dict[str, Any]:
    """Return the facts of a rig, by its table as JSON: a served page asks again and again."""
    from rubhpc.fem.linear_design import linear_design

    design = linear_design(rig_from_dict(json.loads(table), "rig"))
    columns = (design[f"critical_{name}"].values for name in ("speed", "whirl", "damping_ratio"))
    rows = [
        {
            "speed": f"{_RPM * speed:.0f}",
            "whirl": str(whirl),
            "damping": f"{100 * damping:.3g}",
            "excited": "yes" if excited else "no",
        }
        for speed, whirl, damping, excited in zip(*columns, design["is_excited"].values, strict=True)
    ]
    top = _RPM * float(design["speed"].values[-1])
    threshold = _RPM * float(design["threshold_speed"])
    stability = (
        f"stable up to {top:.0f} rpm, as far as the diagram goes"
        if math.isnan(threshold)
        else f"unstable from {threshold:.0f} rpm on"
    )
    return {"rows": rows, "diagram": _diagram(design), "text": f"Without contact, the rotor is {stability}."}


def _diagram(design: xr.Dataset) -> str:
    speeds, modes = design["critical_speed"].values, design["critical_mode"].values
    critical = [(int(mode), float(speed)) for mode, speed in zip(modes, speeds, strict=True)]
    limit = 1.5 * float(design["speed"].values[-1]) / (2 * math.pi)
    content = io.BytesIO()
    with house_style():
        figure, (ax,) = new_figure(height=80, width=120)
        campbell_diagram(design, ax, critical, limit)
        figure.savefig(content, format="svg", metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(content.getvalue()).decode()
