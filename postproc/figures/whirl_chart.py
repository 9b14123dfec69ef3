"""The chart of dry whirl in the bores of a rig: friction that it needs, and its frequency."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.figures.drawing import Drawing
from postproc.store.units import displayed, scale_of, written_value
from rubhpc.fem.dry_whirl import NAMES
from rubhpc.fem.whirl_balance import ROLLING, SLIPPING

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

_RPM = 30 / math.pi
_MARKERS = {SLIPPING: "o", ROLLING: "^"}
_LEVEL: dict[str, Any] = {"color": "0.5", "linewidth": 0.6, "linestyle": (0, (4, 2))}
_WIDE = 50.0  # ratio of frequencies from which their axis is logarithmic


def draw_whirl(found: xr.Dataset) -> Drawing:
    """Return the chart of `rubhpc.dry_whirl`: a row of two panels for each bore.

    Over the speed, or of a single one over the clearance: the least friction that whirl needs, with dots
    where it begins in other ranges of frequency; and the frequencies of whirls at the frictions given, full
    where stable, or else those at which whirl begins. Of a single speed and clearance: the friction over the
    frequency.

    Parameters
    ----------
    found : xarray.Dataset
        From `rubhpc.dry_whirl`.
    """
    along = next((dim for dim in ("speed", "clearance") if found.sizes[dim] > 1), None)
    n_bore, n_column = found.sizes["stator"], 1 if along is None else 2

    def draw(axes: list[Axes]) -> list[Axes]:
        for i in range(n_bore):
            row = axes[n_column * i : n_column * (i + 1)]
            if along is None:
                _draw_curve(row[0], found, i)
            else:
                _draw_friction(row[0], found, i, along)
                _draw_frequency(row[1], found, i, along)
            row[0].set_title(f"Stator {int(found['stator'][i])}, node {int(found['node'][i])}", fontsize=7)
        return axes

    return Drawing(
        shown=found,
        draw=draw,
        panels=(n_bore, n_column),
        is_shared=False,
        height=12 + 45 * n_bore,
        width=88 if n_column == 1 else 150,
    )


def _draw_friction(ax: Axes, found: xr.Dataset, i: int, along: str) -> None:
    """Draw the friction above which whirl exists, and dots where it begins in each range of frequencies."""
    x, label = _abscissa(found, along)
    lines = found["least_friction"].isel(stator=i).transpose(along, ...).values.reshape(x.size, -1)
    dots = _select(found, "threshold", i)
    ax.plot(
        _places(dots, "threshold", along),
        dots["threshold_friction"].values,
        linestyle="",
        marker=".",
        color="0.7",
        markersize=2,
    )
    gaps = found["clearance"]
    for k, line in enumerate(lines.T):
        name = written_value(gaps[k]) if along == "speed" and gaps.size > 1 else None
        ax.plot(
            x, np.where(np.isfinite(line), line, np.nan), color=f"C{k}", marker="o", markersize=2, label=name
        )
    _draw_levels(ax, found)
    ax.set(xlabel=label, ylabel="Friction needed", xlim=_ends(x), ylim=_limits(found, lines))
    if not np.isfinite(lines).any():
        _write_none(ax)
    if ax.get_legend_handles_labels()[1]:
        ax.legend(loc="best", fontsize=6)


def _draw_frequency(ax: Axes, found: xr.Dataset, i: int, along: str) -> None:
    """Draw the frequencies of whirls, full where they are stable, or else those at which whirl begins."""
    dim = "whirl" if found.attrs["frictions"] else "threshold"
    some = _select(found, dim, i)
    x, label = _abscissa(found, along)
    levels = found.attrs["frictions"] or [None]
    places, hertz = _places(some, dim, along), np.abs(some[f"{dim}_frequency"].values) / (2 * math.pi)
    kind = some[f"{dim}_kind"].values
    is_full = some["whirl_growth_rate"].values < 0.0 if dim == "whirl" else np.ones(kind.size, dtype=bool)
    for k, level in enumerate(levels):
        here = np.ones(kind.size, dtype=bool) if level is None else some[f"{dim}_friction"].values == level
        for word, marker in _MARKERS.items():
            for full in (True, False):
                chosen = here & (kind == word) & (is_full == full)
                style: dict[str, Any] = {"markerfacecolor": f"C{k}" if full else "white", "color": f"C{k}"}
                name = _name(word, level, full) if chosen.any() else None
                ax.plot(
                    places[chosen],
                    hertz[chosen],
                    linestyle="",
                    marker=marker,
                    markersize=3.5,
                    markeredgewidth=0.6,
                    label=name,
                    **style,
                )
    ax.set(xlabel=label, ylabel="Whirl frequency (Hz)", xlim=_ends(x))
    if not hertz.size:
        _write_none(ax)
        ax.set_yticks([])
        return
    if along == "speed":
        ax.plot(x, np.abs(x) / 60.0, color="0.6", linewidth=0.5, zorder=1, label="1X")
    if hertz.max() > _WIDE * hertz.min():
        ax.set(yscale="log", ylim=(0.7 * hertz.min(), 1.4 * hertz.max()))
        ax.yaxis.set_minor_formatter("")
    else:
        ax.set_ylim(0.0, 1.1 * hertz.max())
    ax.legend(loc="best", fontsize=6)


def _write_none(ax: Axes) -> None:
    ax.text(0.5, 0.5, "no dry whirl", transform=ax.transAxes, ha="center", va="center")


def _draw_curve(ax: Axes, found: xr.Dataset, i: int) -> None:
    """Draw the friction that slipping whirl needs over its frequency, and the whirls at those given."""
    curve = found.isel(point=np.flatnonzero(found["curve_stator"].values == int(found["stator"][i])))
    needed = curve["curve_friction"].values
    hertz = curve["curve_frequency"].values / (2 * math.pi)
    ax.plot(hertz, needed, color="k")
    _draw_levels(ax, found)
    some = _select(found, "whirl", i)
    for word, marker in _MARKERS.items():
        for full in (True, False):
            chosen = (some["whirl_kind"].values == word) & ((some["whirl_growth_rate"].values < 0.0) == full)
            if chosen.any():
                ax.plot(
                    some["whirl_frequency"].values[chosen] / (2 * math.pi),
                    some["whirl_friction"].values[chosen],
                    linestyle="",
                    marker=marker,
                    color="C1",
                    markerfacecolor="C1" if full else "white",
                    label=_name(word, None, full),
                )
    shown = hertz[needed < _limits(found, needed)[1]]
    if shown.size:
        room = 0.05 * (np.ptp(shown) or abs(shown[0]))
        ax.set_xlim(shown.min() - room, shown.max() + room)
    ax.set(
        xlabel="Whirl frequency (Hz), negative: backward",
        ylabel="Friction needed",
        ylim=_limits(found, needed),
    )
    if ax.get_legend_handles_labels()[1]:
        ax.legend(loc="best", fontsize=6)


def _name(kind: str, friction: float | None, is_full: bool) -> str:
    at = "" if friction is None else f" at {friction:g}"
    return f"{NAMES[kind]}{at}" + ("" if is_full else ", unstable")


def _draw_levels(ax: Axes, found: xr.Dataset) -> None:
    for friction in found.attrs["frictions"]:
        ax.axhline(friction, **_LEVEL)


def _limits(found: xr.Dataset, needed: Floats) -> tuple[float, float]:
    """Ends of an axis of friction: up to that of cases, and beyond the least that is needed."""
    there = needed[np.isfinite(needed)]
    least, most = (float(there.min()), min(float(there.max()), 1.0)) if there.size else (0.0, 0.0)
    return 0.0, 1.1 * max([*found.attrs["frictions"], 1.2 * least, most]) or 1.0


def _select(found: xr.Dataset, dim: str, i: int) -> xr.Dataset:
    return found.isel({dim: np.flatnonzero(found[f"{dim}_stator"].values == int(found["stator"][i]))})


def _abscissa(found: xr.Dataset, along: str) -> tuple[Floats, str]:
    if along == "speed":
        return _RPM * found["speed"].values, "Spin speed (rpm)"
    return displayed(found["clearance"])


def _places(some: xr.Dataset, dim: str, along: str) -> Floats:
    factor = _RPM if along == "speed" else scale_of(some["clearance"]).factor
    return np.asarray(factor * some[f"{dim}_{along}"].values)


def _ends(x: Floats) -> tuple[float, float]:
    room = 0.03 * float(np.ptp(x))
    return float(x.min()) - room, float(x.max()) + room
