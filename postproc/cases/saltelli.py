"""Sobol indices from a sample: those of a measure over the ranges that a study has drawn its cases from.

Estimated with SALib from Saltelli's design (`rubhpc.study.sampling`): total indices after Jansen, first-order
ones after Saltelli (A. Saltelli et al., Comput. Phys. Commun. 181, 2010), intervals from base points
drawn again.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from postproc.store.attributes import table_of
from postproc.store.axes import drawn_axes, source
from postproc.store.units import displayed
from rubhpc.errors import InputError
from rubhpc.study.axes import coordinate_of
from rubhpc.study.sampling import cases_per_point
from rubhpc.study.tables import SALTELLI

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


def by_point(values: xr.DataArray, store: xr.Dataset) -> Floats:
    """Return a measure over the cases of a sample by base point, (n_point, n_range + 2).

    Raises
    ------
    InputError
        When the sample is not Saltelli's, or some of it has been left out by selection.
    """
    sample = _study(store).get("sample", {})
    if (method := sample.get("method", SALTELLI)) != SALTELLI:
        raise InputError(
            f'{source(store)}: its sample was drawn with method = "{method}", and Sobol indices need '
            'Saltelli\'s design; run the study with [sample] method = "sobol" into another output'
        )
    shape = (int(sample.get("n", 0)), cases_per_point(len(drawn_axes(store))))
    if values.size != math.prod(shape):
        raise InputError(
            f"{source(store)}: {values.size} of the {math.prod(shape)} cases of the sample are selected, and "
            "its indices need all of them; select nothing of what was drawn"
        )
    rows: Floats = values.values.reshape(shape)
    return rows


def is_log(store: xr.Dataset, name: str) -> bool:
    """Whether a quantity was drawn evenly in the logarithm."""
    found = [about for key, about in _study(store).get("grid", {}).items() if coordinate_of(key) == name]
    return bool(found) and found[0].get("scale") == "log"


def drawn_ranges(store: xr.Dataset) -> list[str]:
    """Return what each drawn axis was drawn from: "1.4 to 2.2", "1 to 30 GPa, log"."""
    found = []
    for name in drawn_axes(store):
        key = next(key for key in _study(store)["grid"] if coordinate_of(key) == name)
        about = _study(store)["grid"][key]
        ends = np.array([about["start"], about["stop"]])
        shown, label = displayed(xr.DataArray(ends, name=name, attrs={"units": about["unit"]}))
        unit = label.rpartition(" (")[2].rstrip(")") if label.endswith(")") else ""
        text = f"{shown[0]:.6g} to {shown[1]:.6g} {unit}".rstrip()
        found.append(text + (", log" if about["scale"] == "log" else ""))
    return found


def _study(store: xr.Dataset) -> dict[str, Any]:
    return table_of(store, "study")


def estimate(values: Floats, n_draw: int, confidence: float, seed: int) -> tuple[Floats, Floats]:
    """Return first-order and total indices and half the width of their intervals, (2, n_range) each.

    Parameters
    ----------
    values : (n_point, n_range + 2)
        Of whole base points.
    """
    from SALib.analyze import sobol

    n_range = values.shape[1] - 2
    problem = {"num_vars": n_range, "names": list(range(n_range)), "bounds": [[0.0, 1.0]] * n_range}
    found = sobol.analyze(
        problem,
        values.ravel(),
        calc_second_order=False,
        num_resamples=n_draw,
        conf_level=confidence,
        seed=np.random.default_rng(seed),  # a bare 0 would be no seed to SALib
    )
    return np.array([found["S1"], found["ST"]]), np.array([found["S1_conf"], found["ST_conf"]])
