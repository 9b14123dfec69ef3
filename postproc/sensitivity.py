"""Sobol indices of a scalar over the axes of a study: which of them it depends on, and which act together.

A study's grid is a full factorial, so nothing is estimated where all cases are done: with every level of an
axis weighing the same and axes independent, the decomposition of the variance (I. M. Sobol', Math. Modelling
Comput. Exp. 1, 1993) is a matter of means along axes, exact on the levels that were computed. The intervals
tell what else could have come of other levels of the same range.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from postproc.load import axes_of, need, source
from postproc.selection import narrow, written_values
from rubhpc.errors import InputError
from rubhpc.schema import DIVERGED, DONE, FAILED, MISSING, VARIABLES

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

SCALARS = tuple(n for n, v in VARIABLES.items() if v.role in ("scalar", "setting"))
MOST_FILLED = 0.1  # of the cases: a tenth, filled, moves an index of the Ishigami function by up to 0.04
_PASSES = 200  # of the fill, at most; each takes an unbalanced grid closer to least squares
_CLOSE = 1e-10  # of the spread: the fill stands still


def sensitivity(
    store: xr.Dataset, scalar: str, *, n_draw: int = 500, confidence: float = 0.95, seed: int = 1
) -> xr.Dataset:
    """Return first-order and total Sobol indices of a scalar over the axes of several values.

    Levels without any usable case are left out; other cases without a value (missing, failed, diverged, or
    done with a value that is not finite) are filled with the sum of main effects that fits the rest best.
    Both are told in `notes`. Half the width of an interval is the normal quantile times the deviation over
    `n_draw` draws, as in SALib. A draw takes as many levels of every axis again, with replacement and at
    least two different ones, and adds a residual of the fit to each filled case.

    Parameters
    ----------
    store : Dataset
        All stators but one must have been left out by selection; axes of one value are dropped.
    scalar : str
        A measure or setting of a case.
    confidence : float
        Of the intervals, 0 to 1.

    Returns
    -------
    Dataset over `axis`, the largest total index first
        `first_order`, `total`: shares of the variance; `first_order_low`, `_high`, `total_low`, `_high`: ends
        of the intervals, within 0 to 1; `levels`: how many were used. Attributes `scalar`, `mean`,
        `standard_deviation`, `interactions` (share of the variance that no axis has for itself), `cases`
        and `filled`, `notes` (text, one a line).

    Raises
    ------
    InputError
        No such scalar, fewer than one axis of two levels, too many cases without a value, or no variance.
    """
    if scalar not in SCALARS:
        need(store, [scalar])
        raise InputError(f"{source(store)}: {scalar}: no scalar of a case; choose {', '.join(SCALARS)}")
    values, notes = _values(store, scalar)
    levels, axes = values.shape, [str(d) for d in values.dims]
    usable = np.isfinite(values.values)
    n_fill = usable.size - int(usable.sum())
    if n_fill > MOST_FILLED * usable.size:
        raise InputError(
            f"{source(store)}: {scalar}: {n_fill} of {usable.size} cases have no value ({'; '.join(notes)}); "
            f"at most {MOST_FILLED:.0%} can be filled: run the study to its end, or select axis values with "
            "fewer of them"
        )
    filled, residuals = _filled(values.values, usable)
    if n_fill:
        notes.append(f"{n_fill} of {usable.size} cases filled with the main effects of the others")
    if not filled.std() > _CLOSE * np.abs(filled).max():
        raise InputError(f"{source(store)}: {scalar}: the same in all cases; there is no variance to share")
    shares = grid_indices(filled)
    half = _half_widths(filled, ~usable, residuals, n_draw, confidence, seed)
    selected = {str(name): at for name, at in values.coords.items() if at.ndim == 0}
    found = _described(shares, half, confidence).assign_coords(axis=axes, **selected)
    found = found.assign_coords(axis_name=("axis", [str(store[a].attrs.get("long_name", a)) for a in axes]))
    found["levels"] = ("axis", np.array(levels), {"units": "1", "long_name": "levels of the axis"})
    found.attrs = {
        "scalar": scalar,
        "scalar_name": str(values.attrs.get("long_name", scalar)),
        "units": str(values.attrs.get("units", "1")),
        "mean": float(filled.mean()),
        "standard_deviation": float(filled.std()),
        "interactions": max(0.0, 1.0 - float(shares[0].sum())),
        "confidence": confidence,
        "cases": usable.size,
        "filled": n_fill,
        "notes": "\n".join(notes),
    }
    return found.isel(axis=np.argsort(-found["total"].values, kind="stable"))


def _values(store: xr.Dataset, scalar: str) -> tuple[xr.DataArray, list[str]]:
    """Return the scalar over axes and levels with cases, NaN where one has no value, and what to tell."""
    spread = [a for a in axes_of(store) if store.sizes[a] > 1]
    data = narrow(store, [scalar, "status"], spread).load()
    status = data["status"]
    values = data[scalar].astype(float).broadcast_like(status).transpose(*status.dims)
    values.attrs = data[scalar].attrs
    is_done = status == DONE
    usable = is_done & np.isfinite(values)
    notes = _cases_told(status.values, (is_done & ~usable).values)
    values = values.where(usable)
    for axis in spread:
        is_level = usable.any([d for d in usable.dims if d != axis])
        if is_level.any() and not is_level.all():
            lost = written_values(store[axis][~is_level.values])
            notes.append(f"{axis} = {lost}: no case with a value; left out")
            values = values.isel({axis: np.flatnonzero(is_level)})
    values = values.squeeze()
    if not values.ndim or not usable.any():
        raise InputError(
            f"{source(store)}: {scalar}: no axis has two values with cases that are done; "
            "run the study to its end, or select others"
        )
    return values, notes


def grid_indices(values: Floats, weights: list[Floats] | None = None) -> Floats:
    """Return first-order and total Sobol indices on a full grid, exactly.

    `S_i = Var(E[f | x_i]) / Var(f)`, `T_i = E[Var(f | x_j, j != i)] / Var(f)`, with independent axes whose
    levels weigh `weights`, or all the same.

    Parameters
    ----------
    values : (n_1, ..., n_axis)
    weights : list of (n_i,), optional
        Each sums to 1.

    Returns
    -------
    (2, n_axis)
    """
    weights = weights or [np.full(n, 1 / n) for n in values.shape]
    values = values - values.mean()  # or squares of a large mean hide a small variance
    first, total = np.empty(values.ndim), np.empty(values.ndim)
    mean = _mean_over(values, weights, range(values.ndim))
    variance = _mean_over((values - mean) ** 2, weights, range(values.ndim))
    for i in range(values.ndim):
        others = [j for j in range(values.ndim) if j != i]
        main = _mean_over(values, weights, others)
        first[i] = weights[i] @ (main - mean) ** 2
        within = np.tensordot(values, weights[i], (i, 0))
        spread = np.tensordot(values**2, weights[i], (i, 0)) - within**2
        total[i] = _mean_over(spread, [weights[j] for j in others], range(len(others)))
    shares: Floats = np.array([first, total]) / variance
    return shares


def _mean_over(values: Floats, weights: list[Floats], axes: Any) -> Floats:
    """Weighted mean along axes, the last first, so that the others keep their numbers."""
    for i in sorted(axes, reverse=True):
        values = np.tensordot(values, weights[i], (i, 0))
    return values


def _filled(values: Floats, usable: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Values with the best sum of main effects where none is usable, and the residuals of it elsewhere.

    Filling, taking the effects of the whole grid and filling anew converges to least squares over the usable
    cases (F. Yates, Emp. J. Exp. Agric. 1, 1933).
    """
    filled = np.where(usable, values, values[usable].mean())
    spread = values[usable].std()
    additive = filled
    for _ in range(_PASSES if not usable.all() else 1):
        mean = filled.mean()
        additive = np.full_like(filled, mean)
        for i in range(filled.ndim):
            others = tuple(j for j in range(filled.ndim) if j != i)
            additive = additive + filled.mean(axis=others, keepdims=True) - mean
        change = np.abs(additive - filled)[~usable].max(initial=0.0)
        filled = np.where(usable, values, additive)
        if change <= _CLOSE * spread:
            break
    return filled, (values - additive)[usable]


def _half_widths(
    values: Floats,
    is_filled: NDArray[np.bool_],
    residuals: Floats,
    n_draw: int,
    confidence: float,
    seed: int,
) -> Floats:
    """Half the width of the intervals of the first-order and total indices, (2, n_axis)."""
    from scipy.stats import norm

    random = np.random.default_rng(seed)
    drawn = np.empty((n_draw, 2, values.ndim))
    for i in range(n_draw):
        case = values.copy()
        case[is_filled] += random.choice(residuals, int(is_filled.sum()))
        weights = [_level_weights(random, n) for n in values.shape]
        with np.errstate(divide="ignore", invalid="ignore"):
            # A draw may by chance take levels among which the scalar does not change: it tells nothing.
            drawn[i] = grid_indices(case, weights)
    width: Floats = norm.ppf(0.5 + confidence / 2) * np.nanstd(drawn, axis=0, ddof=1)
    return width


def _level_weights(random: np.random.Generator, n: int) -> Floats:
    """How much each of n levels weighs when n are drawn with replacement and two at least differ."""
    while True:
        weights: Floats = random.multinomial(n, np.full(n, 1 / n)) / n
        if np.count_nonzero(weights) > 1:
            return weights


def _cases_told(status: NDArray[np.int8], is_odd: NDArray[np.bool_]) -> list[str]:
    """How many cases have no value, and why."""
    kinds = {MISSING: "missing", FAILED: "failed", DIVERGED: "diverged"}
    counts = {text: int((status == code).sum()) for code, text in kinds.items()}
    counts["done, but the value is not finite"] = int(is_odd.sum())
    told = ", ".join(f"{n} {text}" for text, n in counts.items() if n)
    return [f"of {status.size} cases {told}"] if told else []


def _described(shares: Floats, half: Floats, confidence: float) -> xr.Dataset:
    """Shares and ends of their intervals, (2, n_axis) each, as a dataset over `axis`."""
    found: dict[str, Any] = {}
    texts = {"first_order": "first-order Sobol index", "total": "total Sobol index"}
    for (name, text), share, width in zip(texts.items(), shares, half, strict=True):
        found[name] = ("axis", share.clip(0.0, 1.0), {"units": "1", "long_name": text})  # but for rounding
        for end, value in (("low", share - width), ("high", share + width)):
            about = {"units": "1", "long_name": f"{end} end of the {confidence:.0%} interval of the {text}"}
            found[f"{name}_{end}"] = ("axis", value.clip(0.0, 1.0), about)
    return xr.Dataset(found)
