"""Facts with pictures on the page: linear design, dry whirl, branches, run-ups and driven rotors."""

from __future__ import annotations

import base64
import io
import json
import math
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.figures.bifurcation import bifurcation
from postproc.figures.bode import bode
from postproc.figures.drawing import Drawing, house_style, new_figure
from postproc.figures.linear_design import campbell_diagram
from postproc.figures.multipliers import multipliers
from postproc.figures.run_up_marks import RPM
from postproc.figures.speed import speed
from postproc.figures.waterfall import waterfall
from postproc.figures.whirl_chart import draw_whirl
from postproc.store.attributes import table_of
from postproc.store.axes import axes_of
from postproc.store.branch_points import followed, is_of_points, other_axes
from postproc.store.rig_of_case import rig_of
from postproc.store.run_ups import is_run_up
from postproc.store.units import displayed, written_value
from rubhpc.errors import RubError
from rubhpc.fem.dry_whirl import MOST_SETTINGS, MOST_SPEEDS, dry_whirl, in_words, thinned
from rubhpc.rig.normal_law import NormalLaw
from rubhpc.rig.reading import rig_from_dict
from rubhpc.schema import AMPLITUDE, DONE, PROBE

if TYPE_CHECKING:
    import xarray as xr

MOST_DRAWN = 6  # cases: a picture takes 50 kB
_FEWEST, _WINDOW = 4, 32  # revolutions: of a Bode plot, of a spectrum


def picture(drawing: Drawing, kind: str = "png", *, is_shared: bool = False) -> str:
    """Return a figure as an address that contains it; `is_shared`: its panels have one abscissa."""
    n_row, n_column = drawing.panels or (1, 1)
    content = io.BytesIO()
    with house_style():
        figure, axes = new_figure(n_row, drawing.height, drawing.width, n_column, is_shared=is_shared)
        drawing.draw(axes)
        figure.savefig(content, format=kind, dpi=110, metadata={"Date": None} if kind == "svg" else None)
    kind = kind.replace("svg", "svg+xml")
    return f"data:image/{kind};base64,{base64.b64encode(content.getvalue()).decode()}"


def branch_facts(store: xr.Dataset) -> dict[str, Any]:
    """Return what the page shows of branches.

    That is `text`: how many points and branches there are, "" where the store has none; `cases`: of the first
    `label`, the values of their axes, and `diagram` and `multipliers`, addresses that contain pictures.
    """
    if not is_of_points(store) or not store.sizes["point"]:
        return {"text": "", "cases": []}
    varied = [name for name in other_axes(store) if np.unique(store[name].values).size > 1]
    settings = np.unique(np.array([store[name].values for name in varied]).T, axis=0) if varied else [()]
    cases = []
    for setting in settings[:MOST_DRAWN]:
        is_one = np.ones(store.sizes["point"], dtype=bool)
        for name, value in zip(varied, setting, strict=True):
            is_one &= store[name].values == value
        points = store.isel(point=np.flatnonzero(is_one))
        shown = [displayed(points[name].isel(point=0)) for name in varied]
        cases.append(
            {
                "label": ", ".join(f"{label.replace('$', '')} {float(value):.6g}" for value, label in shown),
                "diagram": picture(bifurcation(points)),
                "multipliers": picture(multipliers(points)),
            }
        )
    number = len(settings)
    left = f"; the first {MOST_DRAWN} of {number} cases are drawn" if number > MOST_DRAWN else ""
    text = f"{store.sizes['point']} periodic motions along {followed(store)}{left}."
    return {"text": text, "cases": cases}


def run_up_facts(store: xr.Dataset) -> dict[str, Any]:
    """Return what the page shows of cases whose speed changes.

    That is `text`: of which signal how many are drawn, "" where the store has none; `cases`: of the first
    that are done `label`, the values of their axes, and `pictures`: names and addresses that contain them.
    """
    if not is_run_up(store) or "status" not in store:
        return {"text": "", "cases": []}
    done = np.argwhere(store["status"].values == DONE)
    if not len(done):
        return {"text": "", "cases": []}
    signal = _signal(store)
    axes = axes_of(store)
    cases = []
    for place in done[:MOST_DRAWN].tolist():
        case = store.isel(dict(zip(axes, place, strict=True)))
        varied = [name for name in axes if store.sizes[name] > 1 and name in case.coords]
        n = int(np.isfinite(case["speed"].values).sum())
        pictures = [("Speed", picture(speed(case), is_shared=True))]
        if n >= _FEWEST:
            pictures.append(("Bode plot", picture(bode(case, signal), is_shared=True)))
        if n > _WINDOW and signal in case:
            pictures.append(("Waterfall", picture(waterfall(case, signal=signal))))
        cases.append(
            {
                "label": ", ".join(written_value(case[name]).replace("$", "") for name in varied),
                "pictures": [{"name": name, "address": address} for name, address in pictures],
            }
        )
    left = f"; the first {MOST_DRAWN} of {len(done)} cases are drawn" if len(done) > MOST_DRAWN else ""
    named = signal.removeprefix(PROBE).replace("_", " ")
    named = f"the probe {named}" if signal.startswith(PROBE) else f"the {named} motion"
    return {"text": f"Speed, and Bode plot and waterfall of {named}{left}.", "cases": cases}


def _signal(store: xr.Dataset) -> str:
    """The signal that is drawn: of the first probe, if possible of a displacement, or the vertical motion."""
    prefix = AMPLITUDE + PROBE
    probes = [str(name).removeprefix(AMPLITUDE) for name in store.data_vars if str(name).startswith(prefix)]
    displaced = [name for name in probes if store[AMPLITUDE + name].attrs.get("units") == "m"]
    return (displaced or probes or ["vertical"])[0]


def design_facts(store: xr.Dataset) -> dict[str, Any]:
    """Return what the page says of the rotor without contact, of the rig as the study states it.

    That is `rows`: one for each critical speed, with `speed` (rpm), `whirl`, `damping` (%) and `excited`, as
    text; `diagram`: the Campbell diagram, an address that contains it; `text`: on stability, or why there is
    none.
    """
    try:
        return _facts(json.dumps(rig_of(store).as_dict(), sort_keys=True))
    except RubError as error:
        return {"rows": [], "diagram": "", "text": f"There is no linear design of this rig: {error}."}


def whirl_facts(store: xr.Dataset) -> dict[str, Any]:
    """Return what the page says of dry whirl in the bores of the rig as the study states it.

    That is `sentences`, one for each bore, and `chart`: an address that contains it.
    """
    try:
        rig = rig_of(store)
        if not any(stator.is_bore for stator in rig.stator):
            return {"sentences": [], "chart": ""}
        contact = table_of(store, "study").get("contact", {})
        return _whirls(
            json.dumps(rig.as_dict(), sort_keys=True),
            NormalLaw(
                kind=contact.get("law", "lagrange"), **{k: contact.get(k) for k in ("stiffness", "damping")}
            ),
            None if is_run_up(store) else tuple(thinned(store["spin_speed"], MOST_SPEEDS)),
            *(tuple(thinned(store[name], MOST_SETTINGS)) for name in ("clearance", "friction")),
        )
    except RubError as error:
        return {"sentences": [f"There is no chart of dry whirl: {error}."], "chart": ""}


@cache
def _whirls(
    table: str,
    law: NormalLaw,
    speeds: tuple[float, ...] | None,
    clearances: tuple[float, ...],
    frictions: tuple[float, ...],
) -> dict[str, Any]:
    found = dry_whirl(rig_from_dict(json.loads(table), "rig"), speeds, clearances, frictions, law=law)
    drawing = draw_whirl(found)
    return {"sentences": in_words(found), "chart": picture(drawing, is_shared=drawing.is_shared)}


@cache
def _facts(table: str) -> dict[str, Any]:
    """Return the facts of a rig, by its table as JSON: a served page asks again and again."""
    from rubhpc.fem.linear_design import linear_design

    design = linear_design(rig_from_dict(json.loads(table), "rig"))
    columns = (design[f"critical_{name}"].values for name in ("speed", "whirl", "damping_ratio"))
    rows = [
        {
            "speed": f"{RPM * speed:.0f}",
            "whirl": str(whirl),
            "damping": f"{100 * damping:.3g}",
            "excited": "yes" if excited else "no",
        }
        for speed, whirl, damping, excited in zip(*columns, design["is_excited"].values, strict=True)
    ]
    top = RPM * float(design["speed"].values[-1])
    threshold = RPM * float(design["threshold_speed"])
    stability = (
        f"stable up to {top:.0f} rpm, as far as the diagram goes"
        if math.isnan(threshold)
        else f"unstable from {threshold:.0f} rpm on"
    )
    critical, limit = design["critical_speed"].values.tolist(), 1.5 * top / 60.0
    diagram = Drawing(
        shown=design,
        draw=lambda axes: campbell_diagram(design, axes[0], critical, limit),
        height=80,
        width=120,
    )
    text = f"Without contact, the rotor is {stability}."
    return {"rows": rows, "diagram": picture(diagram, "svg"), "text": text}
