"""The bifurcation diagram: section points along an axis, coloured by regime, period or sweep direction."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from postproc.figures.branch_lines import draw_branches, name_branches
from postproc.figures.cells import cell_edges, hatch_cells, is_geometric, tick_levels
from postproc.figures.drawing import Drawing
from postproc.figures.palette import NOT_DONE, categories
from postproc.signals.sections import section_of, sections_along
from postproc.store.axes import axes_of, find_axis, ordered_axes, refusal
from postproc.store.branch_points import is_of_points, one_case
from postproc.store.open import open_store
from postproc.store.run_ups import is_run_up
from postproc.store.select import at_most_loaded_stator, first_of_rest, select
from postproc.store.units import displayed, meanings, scale_of, short_name
from postproc.store.variables import require_results, require_variables
from rubhpc.schema import HAS_VALUES, INFERRED
from rubhpc.study.axes import DIRECTION, DIRECTIONS

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from postproc.figures.options import Axis, File

_WIDTH = 180  # mm: two columns, since an axis has hundreds of values
_MOST_DRAWN = 200_000  # points in a pdf or svg; of more, they become a picture in it
_SIZES = 0.6, 3.5  # of the points, pt
_LEAST_RANGE = 0.02  # of the largest value: points of one motion differ by rounding over all cases
_UNDER = ("0.66", 0.6), ("0.1", 1.0)  # simulated points under branches, of up (or both) and down: grey, size
_LEAST_UNDER = 1.4  # pt: a smaller mark of a sweep does not show beside the line
_WAYS = (("^", "#E69F00", 2.4), ("v", "#0072B2", 1.2))  # up and down: marker, colour, size
_IN_A_ROW = 6  # names in the legend


def bifurcation(
    cases: xr.Dataset,
    signal: str = "vertical",
    *,
    along: Axis | None = None,
    color: Literal["regime", "period", "direction"] | None = None,
    over: File | None = None,
) -> Drawing:
    """Bifurcation diagram: section points of a signal along an axis.

    There is one point per revolution, coloured by regime, period or direction of the sweep. Cases without a
    result are hatched by their status. Of a branch study the branches are drawn: stable parts full, unstable
    ones dashed, with their events.

    Parameters
    ----------
    cases
        Axes that are not drawn are taken at their first value.
    signal
        vertical, horizontal or torsion, or one of their velocities, such as vertical_velocity.
    along
        The axis of the diagram [default: the longest].
    color
        [default: direction, where an axis was swept both ways; else regime]
    over
        Of a branch study: a store of simulated cases that the branches are drawn over.
    """
    if is_of_points(cases):
        return _of_branches(cases, signal, over)
    if is_run_up(cases):
        fix = "draw the section of one case, or the orders by rubhpc bode"
        raise refusal(cases, f"bifurcation: the speed changes, and no motion is steady; {fix}")
    if over is not None:
        raise refusal(cases, "over: is for branches; give the store of a study with [branch]")
    coloring = default_coloring(cases, color)
    axis = default_axis(cases, along)
    over = coloring if coloring == DIRECTION else None
    name = f"section_{signal}"
    kept = [axis] if over is None else [axis, over]
    cases = cases.assign({name: section_of(cases, signal)})
    if "stator" in cases[name].dims:
        cases = at_most_loaded_stator(cases)
    cases, notes = first_of_rest(cases, kept, name)
    shown = sections_along(cases, signal, axis, over)
    if n_inferred := int((shown["status"] == INFERRED).sum()):
        n_shown = shown["status"].size
        notes = [*notes, f"{n_inferred} of {n_shown} cases were inferred, not computed, and have no points"]
    return Drawing(
        shown=shown,
        draw=lambda axes: draw_bifurcation(shown, signal, axes[0], coloring),
        height=90,
        width=_WIDTH,
        lines=tuple(notes),
    )


def _of_branches(cases: xr.Dataset, signal: str, over: str | None) -> Drawing:
    """The diagram of branches, over simulated cases at the same values of the other axes."""
    cases, along, notes = one_case(cases)
    require_variables(cases, [f"section_{signal}"])
    simulated = None
    if over is not None:
        store = open_store(over)
        axis = find_axis(store, along)
        held = [name for name in axes_of(store) if name != axis and name in cases.coords]
        store = select(store, {name: float(cases[name]) for name in held})
        ways = DIRECTION if store.sizes.get(DIRECTION, 1) > 1 else None
        kept = [axis] if ways is None else [axis, ways]
        store, more = first_of_rest(store, kept, f"section_{signal}")
        simulated, notes = sections_along(store, signal, axis, ways), [*notes, *more]

    def draw(axes: list[Axes]) -> None:
        ax = axes[0]
        if simulated is not None:
            draw_simulated(simulated, signal, ax)
        draw_branches(cases, f"section_{signal}", along, ax)
        scale = scale_of(cases[f"section_{signal}"])
        ax.set(
            xlabel=displayed(cases[along])[1],
            ylabel=scale.label(f"{short_name(cases[f'section_{signal}'])},\nonce a revolution"),
        )
        name_branches(axes)

    return Drawing(shown=cases, draw=draw, height=90, width=_WIDTH, lines=tuple(notes))


def draw_simulated(data: xr.Dataset, signal: str, ax: Axes) -> Axes:
    """Draw the points of `sections_along` in grey, under branches; by their markers where swept both ways."""
    has_ways = DIRECTION in data.dims
    draw_bifurcation(data, signal, ax, DIRECTION if has_ways else None, has_legend=False)
    for line, (shade, share) in zip(ax.lines, _UNDER, strict=False):
        line.set(color=shade, zorder=1)
        if has_ways:
            line.set_markersize(max(_LEAST_UNDER, share * line.get_markersize()))
    return ax


def default_axis(store: xr.Dataset, along: str | None = None) -> str:
    """Return the axis named, or else the longest one; InputError where there is none of several values."""
    if along:
        return find_axis(store, along)
    axes = ordered_axes(store, "a bifurcation diagram")
    return max(axes, key=lambda a: store.sizes[a])


def default_coloring(store: xr.Dataset, color: str | None = None) -> str:
    """Return the colouring named, or else the direction of the sweep where there are two, or the regime.

    InputError of a direction in a store with a single one.
    """
    ways = store.sizes.get(DIRECTION, 1)
    if color == DIRECTION and ways < 2:
        raise refusal(
            store, 'color: the store has one direction; sweep an axis "both" ways, or color by "regime"'
        )
    return color or (DIRECTION if ways > 1 else "regime")


def draw_bifurcation(
    data: xr.Dataset, signal: str, ax: Axes, color: str | None = "regime", *, has_legend: bool = True
) -> Axes:
    """Draw the points of `sections_along` over its axis, by regime, period, direction or in one colour."""
    section = data[f"section_{signal}"].load()
    require_results(section, data)
    along = str(section.dims[-2])
    x, x_label = displayed(data[along])
    scale = scale_of(section)
    size = float(np.clip(2.0 * np.sqrt(80 / x.size), *_SIZES))
    groups = _directions(data, section, size) if color == DIRECTION else _groups(data, section, size, color)
    for style, chosen, values in groups:
        ax.plot(
            np.repeat(x[chosen], values.shape[1]),
            values.ravel() * scale.factor,
            linestyle="",
            markeredgewidth=0.0,
            rasterized=section.size > _MOST_DRAWN,
            **style,
        )
    ax.margins(x=0.01)
    if is_geometric(x):
        ax.set_xscale("log")
    tick_levels(ax, "x", data[along])
    _widen(ax, section.values * scale.factor)
    _hatch(ax, x, data["status"].values)
    if ax.get_legend_handles_labels()[1] and has_legend:
        ax.figure.legend(
            loc="outside upper right",
            ncols=_IN_A_ROW,
            markerscale=4.0 / size,
            handletextpad=0.2,
            columnspacing=1.0,
        )
    ax.set(xlabel=x_label, ylabel=scale.label(f"{short_name(section)},\nonce a revolution"))
    return ax


def _groups(
    data: xr.Dataset, section: xr.DataArray, size: float, color: str | None
) -> Iterator[tuple[dict[str, Any], NDArray[np.bool_], NDArray[Any]]]:
    """Yield how to draw each regime, period or all of them, where along the axis it is, and its points."""
    style: dict[str, Any] = {"marker": "o", "markersize": size}
    if color is None:
        yield {**style, "color": "C0"}, np.ones(len(section), bool), section.values
        return
    codes = np.where(np.isin(data["status"].values, HAS_VALUES), data[color].values, -1)
    for code, (name, shade) in categories(color, codes).items():
        chosen = codes == code
        yield {**style, "color": shade, "label": name}, chosen, section.values[chosen]


def _directions(
    data: xr.Dataset, section: xr.DataArray, size: float
) -> Iterator[tuple[dict[str, Any], NDArray[np.bool_], NDArray[Any]]]:
    """Yield how to draw each way of the sweep; of points that both have, one shows around the other."""
    for i, name in enumerate(meanings(data[DIRECTION])):
        marker, shade, larger = _WAYS[i]
        style = {"marker": marker, "color": shade, "markersize": larger * size, "label": name}
        yield style, np.ones(section.shape[1], bool), section.values[i]


def _hatch(ax: Axes, x: NDArray[np.float64], status: NDArray[np.int8]) -> None:
    """Hatch the cases without a result, of `status` (n_x,), or (2, n_x) where swept both ways."""
    edges = cell_edges(x), np.array([0.0, 1.0])  # of the whole height
    over = ax.get_xaxis_transform()
    ways = np.atleast_2d(status)
    for code, (name, shade, hatch) in NOT_DONE.items():
        has_none = np.all(ways == code, axis=0)
        hatch_cells(ax, edges, has_none[None], name, hatch, facecolor=shade, transform=over)
        if len(ways) == 1:
            continue
        for of_way, way, (_, color, _) in zip(ways, DIRECTIONS, _WAYS, strict=True):
            of_one = (of_way == code) & ~has_none
            hatch_cells(ax, edges, of_one[None], f"{name}, {way}", hatch, color=color, transform=over)
    ax.autoscale_view(scaley=False)  # such cases may lie at the ends


def _widen(ax: Axes, y: NDArray[np.float64]) -> None:
    """Keep points that differ by rounding from filling the axes."""
    low, high = float(np.nanmin(y)), float(np.nanmax(y))
    least = _LEAST_RANGE * max(abs(low), abs(high))
    if high - low < least:
        ax.set_ylim((low + high - least) / 2, (low + high + least) / 2)
