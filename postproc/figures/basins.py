"""Basins of attraction: the motion that each start reaches, and the share of the starts of each motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from postproc.cases.attractors import NO_MOTION, attractors, start_axes
from postproc.cases.basin_shares import basin_entropy, examples, fractions
from postproc.cases.sobol import is_log
from postproc.figures.basin_motions import (
    colors_of,
    described,
    draw_motions,
    draw_sections,
    motion_label,
    motion_name,
)
from postproc.figures.cells import cell_edges, hatch_cells, is_geometric, tick_levels
from postproc.figures.drawing import Drawing
from postproc.figures.palette import NOT_DONE, NOT_SETTLED
from postproc.figures.scatter import mark_size
from postproc.figures.small_multiples import legend_below
from postproc.store.axes import axes_of, drawn_axes, find_axis, refusal
from postproc.store.select import first_of_rest, worst_of_stators
from postproc.store.units import displayed, written_value
from rubhpc.schema import DONE
from rubhpc.study.sampling import CASE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from postproc.figures.options import Axis, Share

    Floats = NDArray[np.float64]
    Edges = tuple[Floats, Floats]

_MEASURES = ("peak_contact_force", "peak_to_peak_vertical")  # of a motion, by the mean over its cases
_WIDE, _WIDE_PAIR = 130.0, 170.0  # mm


def basins(
    cases: xr.Dataset,
    *,
    x: Axis | None = None,
    y: Axis | None = None,
    along: Axis | None = None,
    tolerance: Share = 0.01,
) -> Drawing:
    """Basins of attraction: the motion that each start reaches.

    The starts are axes of the study such as initial.vertical, or drawn from ranges of them. Cases are sorted
    by the periodic solution that they reach, or by period and Poincaré section; the share of the starts that
    reach each motion has a 95 % interval. The orbits of the motions are drawn next to it. Along an axis, the
    shares are stacked above the section points of each motion.

    Parameters
    ----------
    cases
        Axes that are not drawn are taken at their first value.
    x
        Axis across [default: the longest of the starts, or of all where starts differ along one axis only].
    y
        Axis up [default: the next longest of the starts].
    along
        Draw the share of each motion along AXIS, over all starts, instead.
    tolerance
        Periodic motions whose sections differ by less, relative to their size, count as one.
    """
    starts = start_axes(cases)
    if along is not None:
        axis = find_axis(cases, along)
        if axis in starts:
            raise refusal(cases, f"--along {along}: is a start; name an axis such as a speed")
        return _along(cases, axis, starts, tolerance)
    across, up = _plane(cases, starts, x, y)
    spread = [CASE] if drawn_axes(cases) else [across, up]
    cases, notes = first_of_rest(cases, [*spread, *starts], "status")
    found = attractors(cases, tolerance)
    over = [d for d in starts if d in found.dims]
    shown = fractions(found, over, cases).assign(_measures(found, cases, over) | {"attractor_reached": found})
    shown["status"] = cases["status"].load()
    beyond = [d for d in over if d not in spread]
    shown = shown.isel(dict.fromkeys(beyond, 0))  # drawn at the first; counted over all
    notes += [f"drawn at {written_value(cases[d][0])}: the first of {cases.sizes[d]}" for d in beyond]
    is_plane = not drawn_axes(cases) and {across, up} == set(starts)
    if is_plane:
        entropy, boundary = basin_entropy(found, across, up)
        shown["basin_entropy"], shown["boundary_basin_entropy"] = entropy, boundary
        near = f"{boundary:.3g} (fractal above 0.693)"
        if not np.isfinite(boundary):
            near = (
                f"none: {'no box has two motions' if shown['attractor'].size > 1 else 'there is one motion'}"
            )
        if np.isfinite(entropy):  # NaN of a grid that is smaller than a box
            notes.append(f"basin entropy {entropy:.3g}, on the boundaries {near}")
    is_one_setting = shown["fraction"].dims == ("attractor",)
    if not (is_one_setting and shown["attractor"].size):
        return Drawing(
            shown=shown,
            draw=lambda axes: draw_basins(shown, across, up, axes[0]),
            height=80.0,
            lines=(*notes, *(described(shown) if is_one_setting else ())),
        )
    shown = shown.assign(examples(found, cases, over).data_vars)

    def draw(axes: list[Axes]) -> None:
        draw_basins(shown, across, up, axes[0])
        axes[0].locator_params(axis="x", nbins=6)
        draw_motions(shown, cases, colors_of(shown), axes[1])

    return Drawing(
        shown=shown,
        draw=draw,
        panels=(1, 2),
        is_shared=False,
        width=_WIDE_PAIR,
        height=85.0,
        lines=(*notes, *described(shown)),
    )


def _plane(cases: xr.Dataset, starts: Sequence[str], x: str | None, y: str | None) -> tuple[str, str]:
    """Axes across and up: those named, or the longest starts, else a start over the longest of the others."""
    drawn = drawn_axes(cases)
    known = drawn or [a for a in axes_of(cases) if cases.sizes[a] > 1]
    named = [name.replace(".", "_") if name else None for name in (x, y)]
    for name in named:
        if name is not None and name not in known:
            raise refusal(cases, f"basins: no axis {name} of several values; choose {', '.join(known)}")
    ordered = sorted(known, key=lambda a: (a not in (drawn or starts), -cases[a].size))
    free = [a for a in ordered if a not in named]
    if len(free) + sum(name is not None for name in named) < 2:
        raise refusal(cases, f"basins: a picture needs two axes of several values; there is {known[0]} alone")
    if named == [None, None] and not drawn and len(starts) == 1:
        return free[1], free[0]  # a start up, a parameter across
    across, up = (name or free.pop(0) for name in named)
    if across == up:
        raise refusal(cases, f"--x and --y are both {across}; a picture needs two axes")
    return across, up


def _measures(found: xr.DataArray, cases: xr.Dataset, starts: Sequence[str]) -> dict[str, xr.DataArray]:
    """Means over the cases of each motion."""
    names = [name for name in _MEASURES if name in cases]
    cases = worst_of_stators(cases, names)[names]
    cases = cases.isel(stator=0, drop=True, missing_dims="ignore")  # there is one, or they have been reduced
    numbers = np.unique(found.values[found.values != NO_MOTION])
    is_of = found == xr.DataArray(numbers, dims="attractor", coords={"attractor": numbers})
    return {
        f"mean_{name}": cases[name].where(is_of).mean(starts).assign_attrs(cases[name].attrs).load()
        for name in names
    }


def _along(cases: xr.Dataset, axis: str, starts: Sequence[str], tolerance: float) -> Drawing:
    """Shares of the motions along an axis, above their sections."""
    cases, notes = first_of_rest(cases, [axis, *starts], "status")
    found = attractors(cases, tolerance)
    shown = fractions(found, starts, cases).assign(_measures(found, cases, starts))
    shown = shown.assign(examples(found, cases, starts).data_vars).sortby(axis)

    def draw(axes: list[Axes]) -> None:
        draw_fractions(shown, axis, axes[0])
        axes[0].set_xlabel("")
        draw_sections(shown, axis, colors_of(shown), axes[1])

    return Drawing(
        shown=shown,
        draw=draw,
        panels=(2, 1),
        height=100.0,
        width=_WIDE,
        lines=tuple(notes),
    )


def draw_basins(data: xr.Dataset, x: str, y: str, ax: Axes) -> Axes:
    """Draw which motion each start reaches: cells over two axes of a grid, or points of a sample."""
    colors = colors_of(data)
    values, status = data["attractor_reached"], data["status"]
    across, x_label = displayed(data[x])
    up, y_label = displayed(data[y])
    handles: list[Artist] = []
    if values.dims == (CASE,):
        handles += _scatter(data, across, up, colors, ax)
        for name, set_scale in ((x, ax.set_xscale), (y, ax.set_yscale)):
            if is_log(data, name):
                set_scale("log")
    else:
        values = values.transpose(y, x).sortby([y, x])
        codes = status.transpose(y, x).sortby([y, x]).values
        edges = cell_edges(np.sort(across)), cell_edges(np.sort(up))
        handles += _cells(values.values, edges, colors, data, ax)
        unsettled = (codes == DONE) & (values.values == NO_MOTION)
        for mask, (name, grey, hatch) in [
            *((codes == code, style) for code, style in NOT_DONE.items()),
            (unsettled, (NOT_SETTLED, "white", "||||")),
        ]:
            handles += hatch_cells(ax, edges, mask, name, hatch, facecolor=grey)
        for numbers, letter in ((across, "x"), (up, "y")):
            if is_geometric(numbers):
                getattr(ax, f"set_{letter}scale")("log")
        ax.set(xlim=edges[0][[0, -1]], ylim=edges[1][[0, -1]])
        tick_levels(ax, "x", data[x])
        tick_levels(ax, "y", data[y])
    ax.set(xlabel=x_label, ylabel=y_label)
    legend_below(ax, handles)
    return ax


def draw_fractions(data: xr.Dataset, axis: str, ax: Axes) -> Axes:
    """Draw the shares of the motions along an axis as stacked areas, with their 95 % intervals as bars."""
    x, x_label = displayed(data[axis])
    bottom = np.zeros(x.size)
    for number, color in colors_of(data).items():
        motion = data.sel(attractor=number)
        share = np.nan_to_num(motion["fraction"].transpose(axis).values)
        label = f"{number}: {motion_name(data, number)}"
        ax.fill_between(x, bottom, bottom + share, color=color, label=label, linewidth=0.4, edgecolor="white")
        top = bottom + share
        inner = (share > 0.0) & (top < 1.0 - 1e-9)
        low, high = ((motion[f"fraction_{end}"].values - share)[inner] for end in ("low", "high"))
        ax.errorbar(
            x[inner],
            top[inner],
            yerr=np.abs([low, high]),
            fmt="none",
            ecolor="0.15",
            elinewidth=0.5,
            capsize=1.2,
        )
        bottom = top
    if is_geometric(np.sort(x)):
        ax.set_xscale("log")
    ax.set(xlabel=x_label, ylabel="Share of the starts", ylim=(0.0, 1.0), xlim=(x.min(), x.max()))
    tick_levels(ax, "x", data[axis])
    legend_below(ax, ax.get_legend_handles_labels()[0])
    return ax


def _cells(
    values: NDArray[np.int16], edges: Edges, colors: dict[int, str], data: xr.Dataset, ax: Axes
) -> list[Artist]:
    """Draw cells of motions, and return a handle for each."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    numbers = [*colors]
    index = np.searchsorted(numbers, values).clip(max=max(len(numbers) - 1, 0))
    cells = np.ma.masked_where(values == NO_MOTION, index)
    if numbers:
        paint = ListedColormap([*colors.values()])
        ax.pcolormesh(*edges, cells, cmap=paint, vmin=-0.5, vmax=len(numbers) - 0.5, rasterized=True)
    return [Patch(facecolor=color, label=motion_label(data, number)) for number, color in colors.items()]


def _scatter(data: xr.Dataset, x: Floats, y: Floats, colors: dict[int, str], ax: Axes) -> list[Artist]:
    """Draw a point a start, and return a handle for each motion."""
    found = data["attractor_reached"].values
    size = mark_size(found.size)
    handles: list[Artist] = [
        ax.scatter(x[found == n], y[found == n], size, color=color, linewidths=0, label=motion_label(data, n))
        for n, color in colors.items()
    ]
    none = found == NO_MOTION
    if none.any():
        handles.append(
            ax.scatter(x[none], y[none], size, color="0.5", marker="x", linewidths=0.6, label="no motion")
        )
    return handles
