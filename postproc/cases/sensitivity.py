"""Sobol indices of a measure over the axes of a study: which of them it depends on, and which act together.

A grid is a full factorial, so nothing is estimated where all cases are done (`postproc.cases.sobol`):
with every level of an axis weighing the same and axes independent, the decomposition of the variance (I. M.
Sobol', Math. Modelling Comput. Exp. 1, 1993) is a matter of means along axes, exact on the levels that were
computed. The intervals show the spread that other levels of the same range would give. The indices of a
sampled study are estimates (`postproc.cases.sobol`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from postproc.cases.sobol import by_point, drawn_ranges, estimate, filled_in, grid_indices, half_widths
from postproc.store.axes import axes_of, drawn_axes, refusal
from postproc.store.select import narrow, worst_of_stators, written_values
from postproc.store.variables import require_measure
from rubhpc.schema import DIVERGED, DONE, FAILED, MISSING
from rubhpc.study.sampling import CASE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

MOST_FILLED = 0.1  # of the cases: a tenth, filled, moves an index of the Ishigami function by up to 0.04
MOST_DROPPED = 0.5  # of the base points of a sample: one goes with each of its cases that has no value
_CLOSE = 1e-10  # of the largest value: less is no spread


def sensitivity(
    store: xr.Dataset, measure: str, *, n_draw: int = 500, confidence: float = 0.95, seed: int = 1
) -> xr.Dataset:
    """Return first-order and total Sobol indices of a measure over the axes of a grid or of a sample.

    Of a grid, levels without any usable case are left out; other cases without a value (missing, failed,
    diverged, or done with a value that is not finite) are filled with the sum of main effects that fits the
    rest best. Of a sample, a base point is left out with all its cases where one of them has no value. All of
    this is reported in `notes`.

    Half the width of an interval is the normal quantile times the deviation over `n_draw` draws, as in SALib.
    A draw takes as many levels of every axis again, with replacement and at least two different ones, and
    adds a residual of the fit to each filled case; or it takes as many base points of a sample again.

    Parameters
    ----------
    store : Dataset
        Of a sampled study, all but one value of each other axis must have been left out by selection; axes of
        one value are dropped.
    measure : str
        A measure or setting of a case; of several stators, that of the worst one.
    confidence : float
        Of the intervals, 0 to 1.

    Returns
    -------
    Dataset over `axis`, the largest total index first
        `first_order`, `total`: shares of the variance; `first_order_low`, `_high`, `total_low`, `_high`: ends
        of the intervals, within 0 to 1 on a grid, while estimates may lie beyond; `levels`: how many were
        used, or `drawn_from`: which range. Attributes `measure`, `mean`, `standard_deviation`, `interactions`
        (share of the variance that no axis has for itself), `cases` and how many of them were `filled` or
        `dropped`, `notes` (text, one a line).

    Raises
    ------
    InputError
        No such measure, fewer than one axis of two levels, too many cases without a value, or no variance.
    """
    require_measure(store, measure)
    store = worst_of_stators(store, [measure])
    if drawn_axes(store):
        found = _sampled(store, measure, n_draw, confidence, seed)
    else:
        found = _gridded(store, measure, n_draw, confidence, seed)
    return found.isel(axis=np.argsort(-found["total"].values, kind="stable"))


def _gridded(store: xr.Dataset, measure: str, n_draw: int, confidence: float, seed: int) -> xr.Dataset:
    values, notes = _levels(store, measure)
    usable = np.isfinite(values.values)
    n_fill = usable.size - int(usable.sum())
    _refuse_gaps(store, measure, usable, notes, "filled")
    filled, residuals = filled_in(values.values, usable)
    if n_fill:
        notes.append(f"{n_fill} of {usable.size} cases filled with the main effects of the others")
    _need_variance(store, measure, filled)
    half = half_widths(filled, ~usable, residuals, n_draw, confidence, seed)
    shares = grid_indices(filled)
    found = _described(store, values, filled, [str(d) for d in values.dims], shares, half, confidence)
    for name in ("first_order", "total"):  # shares up to rounding
        for end in ("", "_low", "_high"):
            found[name + end] = found[name + end].clip(0.0, 1.0, keep_attrs=True)
    found["levels"] = ("axis", np.array(values.shape), {"units": "1", "long_name": "levels of the axis"})
    return found.assign_attrs(filled=n_fill, notes="\n".join(notes))


def _sampled(store: xr.Dataset, measure: str, n_draw: int, confidence: float, seed: int) -> xr.Dataset:
    values, notes = _usable_values(store, measure, [CASE])
    rows = by_point(values, store)
    usable = np.isfinite(rows)
    whole = np.array([row.all() for row in usable])
    _refuse_gaps(store, measure, usable, notes, "left out")
    n_drop = int((~whole).sum())
    if n_drop > MOST_DROPPED * whole.size:
        raise refusal(
            store,
            f"{measure}: {n_drop} of {whole.size} base points of the sample have a case "
            f"without a value ({'; '.join(notes)}); at most {MOST_DROPPED:.0%} can be left out: run the "
            "study to its end",
        )
    if n_drop:
        notes.append(f"{n_drop} of {whole.size} base points left out, since one of their cases has no value")
    kept = rows[whole]
    _need_variance(store, measure, kept)
    shares, half = estimate(kept, n_draw, confidence, seed)
    # Of one base point the first and the last case are independent; the others repeat their values.
    found = _described(store, values, kept[:, [0, -1]], drawn_axes(store), shares, half, confidence)
    found["drawn_from"] = ("axis", drawn_ranges(store), {"long_name": "what the axis was drawn from"})
    return found.assign_attrs(dropped=n_drop * rows.shape[1], notes="\n".join(notes))


def _refuse_gaps(
    store: xr.Dataset, measure: str, usable: NDArray[np.bool_], notes: list[str], fate: str
) -> None:
    n_gap = usable.size - int(usable.sum())
    if n_gap > MOST_FILLED * usable.size:
        raise refusal(
            store,
            f"{measure}: {n_gap} of {usable.size} cases have no value ({'; '.join(notes)}); "
            f"at most {MOST_FILLED:.0%} can be {fate}: run the study to its end, or select axis values with "
            "fewer of them",
        )


def _need_variance(store: xr.Dataset, measure: str, values: Floats) -> None:
    if not values.std() > _CLOSE * np.abs(values).max():
        raise refusal(store, f"{measure}: the same in all cases; there is no variance to share")


def _usable_values(store: xr.Dataset, measure: str, spread: list[str]) -> tuple[xr.DataArray, list[str]]:
    """Return the measure over some axes, NaN where a case has no value, and notes on those."""
    data = narrow(store, [measure, "status"], spread).load()
    status = data["status"]
    values = data[measure].astype(float).broadcast_like(status).transpose(*status.dims)
    values.attrs = data[measure].attrs
    is_done = status == DONE
    usable = is_done & np.isfinite(values)
    return values.where(usable), _cases_without_value(status.values, (is_done & ~usable).values)


def _levels(store: xr.Dataset, measure: str) -> tuple[xr.DataArray, list[str]]:
    """Return the measure over axes and levels with cases, NaN where one has no value, and notes."""
    spread = [a for a in axes_of(store) if store.sizes[a] > 1]
    values, notes = _usable_values(store, measure, spread)
    usable = values.notnull()
    for axis in spread:
        is_level = usable.any([d for d in usable.dims if d != axis])
        if is_level.any() and not is_level.all():
            lost = written_values(store[axis][~is_level.values])
            notes.append(f"{axis} = {lost}: no case with a value; left out")
            values = values.isel({axis: np.flatnonzero(is_level)})
    values = values.squeeze()
    if not values.ndim or not usable.any():
        raise refusal(
            store,
            f"{measure}: no axis has two values with cases that are done; "
            "run the study to its end, or select others",
        )
    return values, notes


def _cases_without_value(status: NDArray[np.int8], is_odd: NDArray[np.bool_]) -> list[str]:
    """How many cases have no value, and why."""
    kinds = {MISSING: "missing", FAILED: "failed", DIVERGED: "diverged"}
    counts = {text: int((status == code).sum()) for code, text in kinds.items()}
    counts["done, but the value is not finite"] = int(is_odd.sum())
    text_of_counts = ", ".join(f"{n} {text}" for text, n in counts.items() if n)
    return [f"of {status.size} cases {text_of_counts}"] if text_of_counts else []


def _described(
    store: xr.Dataset,
    values: xr.DataArray,
    used: Floats,
    axes: list[str],
    shares: Floats,
    half: Floats,
    confidence: float,
) -> xr.Dataset:
    """Shares and ends of their intervals, (2, n_axis) each, as a dataset over `axis`."""
    found: dict[str, Any] = {}
    texts = {"first_order": "first-order Sobol index", "total": "total Sobol index"}
    for (name, text), share, width in zip(texts.items(), shares, half, strict=True):
        found[name] = ("axis", share, {"units": "1", "long_name": text})
        for end, value in (("low", share - width), ("high", share + width)):
            about = {"units": "1", "long_name": f"{end} end of the {confidence:.0%} interval of the {text}"}
            found[f"{name}_{end}"] = ("axis", value, about)
    names = [str(store[a].attrs.get("long_name", a)) for a in axes]
    selected = {str(name): at for name, at in values.coords.items() if at.ndim == 0}
    about_all: dict[str, Any] = {
        "measure": str(values.name),
        "measure_name": str(values.attrs.get("long_name", values.name)),
        "of_stators": str(values.attrs.get("of_stators", "")),
        "units": str(values.attrs.get("units", "1")),
        "mean": float(used.mean()),
        "standard_deviation": float(used.std()),
        "interactions": max(0.0, 1.0 - float(shares[0].sum())),
        "confidence": confidence,
        "cases": values.size,
    }
    return xr.Dataset(found, {"axis": axes, "axis_name": ("axis", names), **selected}, about_all)
