"""Branches of periodic motions on the page: a diagram and the multipliers for each case of a branch study."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.figures.bifurcation import bifurcation
from postproc.figures.multipliers import multipliers
from postproc.report.pictures import MOST_DRAWN, picture
from postproc.store.branch_points import followed, is_of_points, other_axes
from postproc.store.units import displayed

if TYPE_CHECKING:
    import xarray as xr


def branch_facts(store: xr.Dataset) -> dict[str, Any]:
    """Return what the page shows of branches.

    Returns
    -------
    dict
        `text`: how many points and branches there are, "" where the store has none; `cases`: of the first
        cases `label`, the values of their axes, and `diagram` and `multipliers`, addresses that contain
        pictures.
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
