"""Figures of an identification: its posterior, and what that predicts over what was measured."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.figures.drawing import Drawing
from postproc.store.units import displayed, scale_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

_SIDE = 32.0  # mm, of a panel of the posterior
_BINS = 24
_SHARES = (0.95, 0.5)  # of the draws within a contour
_GRID = 60  # points of a density along each axis
_PREDICTED, _MEASURED = "C0", "k"


def corner(tree: xr.DataTree) -> Drawing:
    """Return the posterior of each quantity, and of each pair, from the tree of `rubhpc.identify`."""
    posterior, prior = (tree[group].to_dataset().isel(chain=0, drop=True) for group in ("posterior", "prior"))
    names = [str(name) for name in prior.data_vars]
    shown = posterior[names]

    def draw(axes: list[Axes]) -> list[Axes]:
        columns = [displayed(shown[name]) for name in names]
        columns = [(values, label.replace(" (", "\n(")) for values, label in columns]  # panels are narrow
        n = len(names)
        for i, (y, y_label) in enumerate(columns):
            for j, (x, x_label) in enumerate(columns):
                ax = axes[i * n + j]
                if j > i:
                    ax.set_axis_off()
                    continue
                if i == j:
                    _one(ax, x, prior[names[i]].values * scale_of(shown[names[i]]).factor)
                else:
                    _pair(ax, x, y)
                ax.tick_params(labelbottom=i == n - 1, labelleft=j == 0 and i > 0)
                ax.locator_params(nbins=3)
                ax.tick_params(axis="x", labelrotation=30.0)
                if i == n - 1:
                    ax.set_xlabel(x_label, fontsize="small")
                if j == 0 and i > 0:
                    ax.set_ylabel(y_label, fontsize="small")
        return axes

    n = len(names)
    size = max(_SIDE * n, 63.0)
    return Drawing(shown=shown, draw=draw, panels=(n, n), is_shared=False, height=size, width=size + 20.0)


def _one(ax: Axes, x: np.ndarray[Any, Any], before: np.ndarray[Any, Any]) -> None:
    """One quantity, the prior where it reaches into the view."""
    low, high = _view(x)
    ax.hist(x, bins=_BINS, range=(low, high), density=True, color=_PREDICTED, alpha=0.6, linewidth=0)
    span = np.histogram(before, bins=_BINS, density=True)
    ax.stairs(span[0], span[1], color="0.5", linewidth=0.8)
    ax.set(xlim=(low, high), yticks=[])


def _pair(ax: Axes, x: np.ndarray[Any, Any], y: np.ndarray[Any, Any]) -> None:
    """Two quantities: draws, and the contours of highest density that hold half and most of them."""
    (x_low, x_high), (y_low, y_high) = _view(x), _view(y)
    ax.plot(x, y, ".", color="0.6", markersize=1.0, zorder=0, rasterized=True)
    ax.set(xlim=(x_low, x_high), ylim=(y_low, y_high))
    if min(np.unique(x).size, np.unique(y).size) < _BINS:
        return
    from scipy.stats import gaussian_kde

    try:
        density = gaussian_kde(np.stack([x, y]))
    except np.linalg.LinAlgError:  # they lie on a line
        return
    grid = np.meshgrid(np.linspace(x_low, x_high, _GRID), np.linspace(y_low, y_high, _GRID))
    levels = np.quantile(density(np.stack([x, y])), [1.0 - share for share in _SHARES])
    if levels[1] > levels[0]:
        ax.contour(
            *grid,
            density(np.stack([g.ravel() for g in grid])).reshape(grid[0].shape),
            levels,
            colors=_PREDICTED,
        )


def _view(x: np.ndarray[Any, Any]) -> tuple[float, float]:
    low, high = np.quantile(x, [0.0, 1.0]).tolist()
    margin = 0.1 * (high - low) or 0.01 * abs(high) or 1.0
    return low - margin, high + margin


def predicted(tree: xr.DataTree) -> Drawing:
    """Return measured spectra and orbit with those of some draws of the posterior of `rubhpc.identify`."""
    observed = tree["observed_data"].to_dataset()
    draws = tree["posterior_predictive"].to_dataset().isel(chain=0, drop=True)
    names = [
        str(name).removeprefix("spectrum_") for name in draws.data_vars if str(name).startswith("spectrum_")
    ]
    has_orbit = "orbit" in observed

    def draw(axes: list[Axes]) -> list[Axes]:
        for ax, name in zip(axes, names, strict=False):
            scale = scale_of(observed[f"spectrum_{name}"])
            order = observed["order"].values
            for line in draws[f"spectrum_{name}"].values * scale.factor:
                ax.plot(order, line, "_", color=_PREDICTED, markersize=5.0, alpha=0.4)
            noise = observed[f"noise_{name}"].values * scale.factor
            ax.fill_between(order, 0.0, noise, step="mid", color="0.85", linewidth=0, label="noise")
            ax.plot([], [], "_", color=_PREDICTED, label="posterior")
            seen = observed[f"spectrum_{name}"].values * scale.factor
            ax.plot(order, seen, ".", color=_MEASURED, markersize=3.0, label="measured")
            ax.set(
                yscale="log", ylabel=scale.label(name.removeprefix("probe_").replace("_", " ").capitalize())
            )
            ax.set_ylim(bottom=0.3 * float(max(np.median(noise), 1e-6 * seen.max())))
            ax.set_xlabel("Order")
        axes[0].legend(fontsize=6)
        if has_orbit:
            _orbit(axes[len(names)], observed, draws)
        for ax in axes[len(names) + has_orbit :]:
            ax.set_axis_off()
        return axes

    n_panel = len(names) + has_orbit
    shown = observed.drop_dims("sample")
    rows = -(-n_panel // 2)
    return Drawing(shown=shown, draw=draw, panels=(rows, 2), is_shared=False, height=52.0 * rows, width=150.0)


def _orbit(ax: Axes, observed: xr.Dataset, draws: xr.Dataset) -> None:
    """Predicted orbits over the measured one."""
    scale = scale_of(observed["orbit"])
    v, w = observed["orbit"].values * scale.factor
    ax.plot(w, v, ".", color=_MEASURED, markersize=2.0)
    for vertical, horizontal in draws["orbit"].values * scale.factor:
        ax.plot(horizontal, vertical, color=_PREDICTED, linewidth=0.6, alpha=0.3)
    ax.set(xlabel=scale.label("Horizontal"), ylabel=scale.label("Vertical"))
    ax.set_aspect("equal", adjustable="datalim")
