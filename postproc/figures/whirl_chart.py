"""The chart of dry whirl in the bores of a rig: friction that it needs, and its frequency."""

from __future__ import annotations

import math
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.figures.drawing import Drawing
from postproc.figures.run_up_marks import RPM
from postproc.store.units import displayed, scale_of, written_value
from rubhpc.fem.dry_whirl import NAMES
from rubhpc.fem.whirl_balance import ROLLING, SLIPPING

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]

_MARKERS = {SLIPPING: "o", ROLLING: "^"}
_DASHES: tuple[Any, ...] = ("-", (0, (4, 1.5)), (0, (1, 1.2)))
_SAFE: dict[str, Any] = {"color": "0.92", "linewidth": 0}
_RANGE: dict[str, Any] = {"color": "0.6", "linewidth": 0.6}
_WIDE = 8.0  # ratio of frequencies from which their axis is logarithmic
_NEAR = 0.12  # relative distance of frequencies at neighbouring speeds that a line joins
_ROOM = 0.05  # of the height: between the names of two lines


def draw_whirl(found: xr.Dataset) -> Drawing:
    """Return the chart of `rubhpc.dry_whirl`: a row of two panels for each bore.

    Over the speed, or of a single one over the clearance. On the left the friction that whirl needs: below
    the shaded limit none exists; thin lines show the ranges of frequencies in which it can begin, with their
    frequency at the end. On the right the frequencies of whirls at the frictions given, full where they are
    stable, or else those at which whirl begins. Of a single speed and clearance, one panel: the friction over
    the frequency.
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
                for ax in row if i < n_bore - 1 else ():
                    ax.set_xlabel("")
            row[0].set_title(f"Stator {int(found['stator'][i])}, node {int(found['node'][i])}")
        _legend(axes[0], found, along)
        return axes

    return Drawing(
        shown=found,
        draw=draw,
        panels=(n_bore, n_column),
        is_shared=False,
        height=20 + 42 * n_bore,
        width=88 if n_column == 1 else 160,
    )


def _draw_friction(ax: Axes, found: xr.Dataset, i: int, along: str) -> None:
    """Draw the friction above which whirl exists, and the one at which it begins in each range."""
    x, label = _abscissa(found, along)
    lines = found["least_friction"].isel(stator=i).transpose(along, ...).values.reshape(x.size, -1)
    top = _most_friction(found, lines)
    shaded, least = _outline(x, np.minimum(lines.min(axis=1), top), top)
    ax.fill_between(shaded, least, **_SAFE)
    some = _select(found, "threshold", i)
    places, needed = _places(some, "threshold", along), some["threshold_friction"].values
    hertz = _hertz(some, "threshold")
    names = []
    for clearance in np.unique(some["threshold_clearance"].values) if along == "speed" else [None]:
        is_here = (
            np.ones(needed.size, bool) if clearance is None else some["threshold_clearance"] == clearance
        )
        for branch in _branches(places, hertz, np.flatnonzero(is_here)):
            ax.plot(places[branch], needed[branch], **_RANGE)
            end = branch[-1]
            if places[end] == x[-1] and needed[end] < top:
                names.append((needed[end] / top, f"{float(f'{hertz[end]:.3g}'):g} Hz"))
    for k, line in enumerate(lines.T):
        ax.plot(x, np.where(np.isfinite(line), line, np.nan), color="k", linestyle=_DASHES[k % len(_DASHES)])
    for k, friction in enumerate(found.attrs["frictions"]):
        ax.axhline(friction, color=f"C{k}", linewidth=0.7)
    ax.set(xlabel=label, ylabel="Friction needed", xlim=(x.min(), x.max()), ylim=(0.0, top))
    _name_ends(ax, names)


def _outline(x: Floats, least: Floats, top: float) -> tuple[Floats, Floats]:
    """The limit of friction, with a step half way between a place with whirl and one without."""
    at = np.flatnonzero(np.diff(least == top))
    middle = np.repeat((x[at] + x[at + 1]) / 2, 2)
    ends = np.stack([least[at], least[at + 1]], axis=1).ravel()
    where = np.repeat(at + 1, 2)
    return np.insert(x, where, middle), np.insert(least, where, ends)


def _name_ends(ax: Axes, names: list[tuple[float, str]]) -> None:
    """Write names where lines end at the right, by height: from the lowest on, those with room."""
    free = -math.inf
    for height, name in sorted(set(names)):
        if height > free:
            ax.annotate(
                name,
                (1.0, height),
                (2, 0),
                xycoords="axes fraction",
                textcoords="offset points",
                fontsize=6,
                color="0.35",
                va="center",
            )
            free = height + _ROOM


def _draw_frequency(ax: Axes, found: xr.Dataset, i: int, along: str) -> None:
    """Draw the frequencies of whirls, full where they are stable, or else those at which whirl begins."""
    from matplotlib.ticker import LogLocator

    dim = "whirl" if found.attrs["frictions"] else "threshold"
    some = _select(found, dim, i)
    x, label = _abscissa(found, along)
    room = 0.03 * float(np.ptp(x))
    ax.set(xlabel=label, ylabel="Whirl frequency (Hz)", xlim=(x.min() - room, x.max() + room))
    places, hertz = _places(some, dim, along), _hertz(some, dim)
    if not hertz.size:
        _write_none(ax)
        ax.set_yticks([])
        return
    kind, clearance = some[f"{dim}_kind"].values, some[f"{dim}_clearance"].values
    is_full = _is_stable(some) if dim == "whirl" else np.ones(kind.size, dtype=bool)
    gaps = np.unique(clearance) if along == "speed" else [None]
    for k, level in enumerate(found.attrs["frictions"] or [None]):
        color = "k" if level is None else f"C{k}"
        for word, gap in product(NAMES, gaps):
            is_here = (kind == word) & (gap is None or clearance == gap)
            if level is not None:
                is_here &= some[f"{dim}_friction"].values == level
            near = _NEAR if word == SLIPPING else math.inf  # rolling follows the rim, and there is one
            for branch in _branches(places, hertz, np.flatnonzero(is_here), near):
                ax.plot(places[branch], hertz[branch], color=color, linewidth=0.5)
            for full, fill in ((True, color), (False, "white")):
                chosen = is_here & (is_full == full)
                ax.plot(places[chosen], hertz[chosen], **_mark(word, color, fill))
    if along == "speed":
        ax.plot(x, np.abs(x) / 60.0, color="0.6", linewidth=0.5, zorder=1)
    if hertz.max() > _WIDE * hertz.min():
        ax.set(yscale="log", ylim=(0.7 * hertz.min(), 1.4 * hertz.max()))
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.yaxis.set_major_formatter("{x:g}")
        ax.yaxis.set_minor_formatter("")
    else:
        ax.set_ylim(0.0, 1.1 * hertz.max())


def _draw_curve(ax: Axes, found: xr.Dataset, i: int) -> None:
    """Draw the friction that slipping whirl needs over its frequency, and the whirls at those given."""
    curve = found.isel(point=np.flatnonzero(found["curve_stator"].values == int(found["stator"][i])))
    needed = curve["curve_friction"].values
    hertz = curve["curve_frequency"].values / (2 * math.pi)
    ax.plot(hertz, needed, color="k")
    some = _select(found, "whirl", i)
    is_full = _is_stable(some)
    for k, friction in enumerate(found.attrs["frictions"]):
        ax.axhline(friction, color=f"C{k}", linewidth=0.7)
        for word, (full, fill) in product(NAMES, ((True, f"C{k}"), (False, "white"))):
            chosen = (some["whirl_kind"].values == word) & (some["whirl_friction"].values == friction)
            chosen &= is_full == full
            at = some["whirl_frequency"].values[chosen] / (2 * math.pi)
            ax.plot(at, some["whirl_friction"].values[chosen], **_mark(word, f"C{k}", fill))
    top = _most_friction(found, needed)
    shown = hertz[needed < top]
    ax.set(xlabel="Whirl frequency (Hz), forward positive", ylabel="Friction needed", ylim=(0.0, top))
    if shown.size:
        ends = [*shown, *some["whirl_frequency"].values / (2 * math.pi)]
        room = 0.03 * float(np.ptp(ends))
        ax.set_xlim(min(ends) - room, max(ends) + room)
    else:
        _write_none(ax)


def _legend(ax: Axes, found: xr.Dataset, along: str | None) -> None:
    """Name frictions, kinds of whirl and clearances below the panels."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    gaps, frictions = found["clearance"], found.attrs["frictions"]
    handles: list[Any] = [
        Line2D([], [], color=f"C{k}", label=f"friction {mu:g}") for k, mu in enumerate(frictions)
    ]
    dim = "whirl" if frictions else "threshold"
    is_full = _is_stable(found) if frictions else np.ones(found.sizes[dim], dtype=bool)
    for (word, name), full in product(NAMES.items(), (True, False)):
        if ((found[f"{dim}_kind"].values == word) & (is_full == full)).any() and (along or frictions):
            label = f"{'stable' if full else 'unstable'} {name}" if frictions else f"{name} begins"
            handles.append(Line2D([], [], label=label, **_mark(word, "k", "k" if full else "white")))
    if along:
        handles.append(Patch(label="no dry whirl", **_SAFE))
    if along == "speed":
        for k, gap in enumerate(gaps if gaps.size > 1 else ()):
            name = f"clearance {written_value(gap)}"
            handles.append(Line2D([], [], color="k", linestyle=_DASHES[k % len(_DASHES)], label=name))
        handles.append(Line2D([], [], color="0.6", linewidth=0.5, label="1X"))
    if handles:
        n_column = min(len(handles), 5 if along else 3)
        ax.figure.legend(handles=handles, loc="outside lower center", ncols=n_column, frameon=False)


def _mark(word: str, color: str, fill: str) -> dict[str, Any]:
    """The marker of a whirl: its kind by shape, its friction by colour, full where it is stable."""
    return {
        "linestyle": "",
        "marker": _MARKERS[word],
        "markersize": 3.2,
        "markeredgewidth": 0.6,
        "color": color,
        "markerfacecolor": fill,
    }


def _branches(x: Floats, y: Floats, chosen: Ints, near: float = _NEAR) -> list[Ints]:
    """Join points at neighbouring abscissas to lines: those that are each other's nearest, and near."""
    lines: list[list[int]] = []
    last: list[list[int]] = []
    for place in np.unique(x[chosen]):
        here = chosen[x[chosen] == place]
        apart = np.array([[abs(math.log(y[k] / y[line[-1]])) for k in here] for line in last])
        new = set(here.tolist())
        for row, line in enumerate(last):
            column = int(apart[row].argmin())
            if apart[row, column] < near and apart[:, column].argmin() == row:
                line.append(int(here[column]))
                new.discard(line[-1])
        lines += (begun := [[k] for k in sorted(new)])
        last = [line for line in last if x[line[-1]] == place] + begun
    return [np.array(line) for line in lines]


def _write_none(ax: Axes) -> None:
    ax.text(0.5, 0.5, "no dry whirl", transform=ax.transAxes, ha="center", va="center", fontsize=7)


def _most_friction(found: xr.Dataset, needed: Floats) -> float:
    """End of an axis of friction: up to that of cases, and beyond the least that is needed."""
    there = needed[np.isfinite(needed)]
    least, most = (float(there.min()), min(float(there.max()), 1.0)) if there.size else (0.0, 0.0)
    return 1.1 * max([*found.attrs["frictions"], 1.2 * least, most]) or 1.0


def _is_stable(some: xr.Dataset) -> NDArray[np.bool_]:
    return np.asarray(some["whirl_growth_rate"].values < 0.0)


def _select(found: xr.Dataset, dim: str, i: int) -> xr.Dataset:
    return found.isel({dim: np.flatnonzero(found[f"{dim}_stator"].values == int(found["stator"][i]))})


def _abscissa(found: xr.Dataset, along: str) -> tuple[Floats, str]:
    if along == "speed":
        return RPM * found["speed"].values, "Spin speed (rpm)"
    return displayed(found["clearance"])


def _places(some: xr.Dataset, dim: str, along: str) -> Floats:
    factor = RPM if along == "speed" else scale_of(some["clearance"]).factor
    return np.asarray(factor * some[f"{dim}_{along}"].values)


def _hertz(some: xr.Dataset, dim: str) -> Floats:
    return np.asarray(np.abs(some[f"{dim}_frequency"].values) / (2 * math.pi))
