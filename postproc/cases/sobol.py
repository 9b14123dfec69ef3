"""Sobol indices: exact on the levels of a full grid, estimated from a sample.

Those of a sample are estimated with SALib from Saltelli's design (`rubhpc.study.sampling`): total indices
after Jansen, first-order ones after Saltelli (A. Saltelli et al., Comput. Phys. Commun. 181, 2010), intervals
from base points drawn again.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from postproc.store.attributes import table_of
from postproc.store.axes import drawn_axes, refusal
from postproc.store.units import displayed
from rubhpc.study.axes import coordinate_of
from rubhpc.study.sampling import cases_per_point
from rubhpc.study.tables import SALTELLI

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

_PASSES = 200  # of the fill, at most; each takes an unbalanced grid closer to least squares
_CLOSE = 1e-10  # of the spread: the fill has converged
_LEAST_SHARE = 1e-6  # by which a share of the variance is off through rounding, at most


def grid_indices(values: Floats, weights: list[Floats] | None = None) -> Floats:
    """Return first-order and total Sobol indices on a full grid (n_1, ..., n_axis), exactly, (2, n_axis).

    `S_i = Var(E[f | x_i]) / Var(f)`, `T_i = E[Var(f | x_j, j != i)] / Var(f)`, with independent axes whose
    levels weigh `weights`, (n_i,) each with the sum 1, or all the same.
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


def filled_in(values: Floats, usable: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Return values with the best sum of main effects where none is usable, and its residuals elsewhere.

    Filling, taking the effects of the whole grid and filling again converges to least squares over the usable
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


def half_widths(
    values: Floats,
    is_filled: NDArray[np.bool_],
    residuals: Floats,
    n_draw: int,
    confidence: float,
    seed: int,
) -> Floats:
    """Return half the width of the intervals of the first-order and total indices, (2, n_axis)."""
    from scipy.stats import norm

    random = np.random.default_rng(seed)
    drawn = np.empty((n_draw, 2, values.ndim))
    for i in range(n_draw):
        case = values.copy()
        case[is_filled] += random.choice(residuals, int(is_filled.sum()))
        weights = [_level_weights(random, n) for n in values.shape]
        with np.errstate(divide="ignore", invalid="ignore"):
            drawn[i] = grid_indices(case, weights)
    # By chance a draw takes levels between which the measure changes by rounding alone: no information.
    drawn[~((drawn > -_LEAST_SHARE) & (drawn < 1.0 + _LEAST_SHARE)).all(axis=(1, 2))] = np.nan
    width: Floats = norm.ppf(0.5 + confidence / 2) * np.nanstd(drawn, axis=0, ddof=1)
    return width


def _level_weights(random: np.random.Generator, n: int) -> Floats:
    """How much each of n levels weighs when n are drawn with replacement and two at least differ."""
    while True:
        weights: Floats = random.multinomial(n, np.full(n, 1 / n)) / n
        if np.count_nonzero(weights) > 1:
            return weights


def by_point(values: xr.DataArray, store: xr.Dataset) -> Floats:
    """Return a measure over the cases of a sample by base point, (n_point, n_range + 2).

    InputError where the sample is not Saltelli's, or some of it has been left out by selection.
    """
    sample = table_of(store, "study").get("sample", {})
    if (method := sample.get("method", SALTELLI)) != SALTELLI:
        raise refusal(
            store,
            f'its sample was drawn with method = "{method}", and Sobol indices need '
            'Saltelli\'s design; run the study with [sample] method = "sobol" into another output',
        )
    shape = (int(sample.get("n", 0)), cases_per_point(len(drawn_axes(store))))
    if values.size != math.prod(shape):
        raise refusal(
            store,
            f"{values.size} of the {math.prod(shape)} cases of the sample are selected, and "
            "its indices need all of them; select nothing of what was drawn",
        )
    rows: Floats = values.values.reshape(shape)
    return rows


def is_log(store: xr.Dataset, name: str) -> bool:
    """Whether a quantity was drawn evenly in the logarithm."""
    grid = table_of(store, "study").get("grid", {})
    return any(about.get("scale") == "log" for key, about in grid.items() if coordinate_of(key) == name)


def drawn_ranges(store: xr.Dataset) -> list[str]:
    """Return what each drawn axis was drawn from: "1.4 to 2.2", "1 to 30 GPa, log"."""
    found = []
    for name in drawn_axes(store):
        grid = table_of(store, "study")["grid"]
        about = next(about for key, about in grid.items() if coordinate_of(key) == name)
        ends = np.array([about["start"], about["stop"]])
        shown, label = displayed(xr.DataArray(ends, name=name, attrs={"units": about["unit"]}))
        unit = label.rpartition(" (")[2].rstrip(")") if label.endswith(")") else ""
        text = f"{shown[0]:.6g} to {shown[1]:.6g} {unit}".rstrip()
        found.append(text + (", log" if about["scale"] == "log" else ""))
    return found


def estimate(values: Floats, n_draw: int, confidence: float, seed: int) -> tuple[Floats, Floats]:
    """Return first-order and total indices and half the width of their intervals, (2, n_range) each.

    `values` are (n_point, n_range + 2), of whole base points.
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
