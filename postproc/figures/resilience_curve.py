"""The resilience curve: the least knock that leads to rub over the speed, and its direction."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.figures.cells import cell_edges, is_geometric
from postproc.figures.drawing import Drawing
from postproc.store.units import displayed, scale_of, written_value
from rubhpc.errors import InputError
from rubhpc.study.axes import SPEED_AXES, written

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

_MOST_LINES = 6
_MARKERS = "oxs+D^"  # of directions, which are often the same for several lines


def resilience(knocks: xr.Dataset) -> Drawing:
    """Return the curve of `rubhpc.knocks.least_knock`: impulse above, direction below if it varies.

    Parameters
    ----------
    knocks : Dataset over the axes of a study
        The curve runs over the speed, or else over the longest axis; a line for each value of the others.

    Raises
    ------
    InputError
        There are too many lines for one figure.
    """
    several = [str(d) for d in knocks.least_impulse.dims if knocks.sizes[d] > 1]
    speeds = [d for d in several if d in SPEED_AXES]
    along = (
        speeds or sorted(several, key=lambda d: -knocks.sizes[d]) or [str(knocks.least_impulse.dims[0])]
    )[0]
    others = [d for d in several if d != along]
    single = {d: 0 for d in knocks.least_impulse.dims if d != along and d not in others}
    shown = knocks.isel(single).sortby(along)
    places = np.ndindex(*(shown.sizes[d] for d in others))
    lines = [shown.isel(dict(zip(others, place, strict=True))) for place in places]
    if len(lines) > _MOST_LINES:
        raise InputError(
            f"{len(lines)} curves are more than {_MOST_LINES}; leave some values of {others[0]} out"
        )

    angles = np.unique(shown["worst_angle"].values)
    is_one = np.isfinite(angles).sum() <= 1  # direction, which a line of text names

    def draw(axes: list[Axes]) -> list[Axes]:
        above, below = axes[0], axes[-1]
        x, x_label = displayed(shown[along])
        scale = scale_of(shown["least_impulse"])
        for i, line in enumerate(lines):
            name = ", ".join(written_value(line[d]) for d in others)
            impulse = line["least_impulse"].values * scale.factor
            style: dict[str, Any] = {"color": f"C{i}", "marker": "o", "markersize": 2.5}
            above.plot(x, impulse, linewidth=1.0, label=name or None, **style)
            found = np.isfinite(impulse)
            harmless = np.where(found, line["harmless_impulse"].values * scale.factor, np.nan)
            above.fill_between(x, 0.0, harmless, color=f"C{i}", alpha=0.12, linewidth=0.0)
            is_safe = line["has_contact_free_motion"].values & ~found
            if is_safe.any():
                _point_up(above, x[is_safe], f"C{i}", i, _tried(line))
            if not is_one:
                turned = (np.degrees(line["worst_angle"].values) + 180.0) % 360.0 - 180.0
                below.plot(x, turned, linestyle="", **{**style, "marker": _MARKERS[i]})
        _mark(above, x, lines)
        largest = [
            float(np.nanmax(v)) for line in lines if np.isfinite(v := line["least_impulse"].values).any()
        ]
        top = 1.25 * scale.factor * max(largest) if largest else None
        above.set(ylabel=f"Least impulse ({scale.unit})", ylim=(0.0, top))
        below.set_xlabel(x_label)
        if not is_one:
            below.set(ylabel="Direction (\N{DEGREE SIGN})", ylim=(-200.0, 200.0))
            below.set_yticks(range(-180, 181, 90))
            if (place := below.get_subplotspec()) is not None:
                place.get_gridspec().set_height_ratios([2.5, 1.0])
        for ax in axes:
            ax.set_xlim(*cell_edges(x)[[0, -1]])
            if is_geometric(x):
                ax.set_xscale("log")
        if others or above.get_legend_handles_labels()[1]:
            above.legend(loc="best", fontsize=6)
        return axes

    return Drawing(
        shown=shown,
        draw=draw,
        panels=(1 if is_one else 2, 1),
        height=50.0 if is_one else 80.0,
        lines=tuple(_in_words(lines, along, others)),
    )


def _tried(line: xr.Dataset) -> str:
    """The largest knock that was tried without success, in words."""
    tried = line["harmless_impulse"].where(line["has_contact_free_motion"] & line["least_impulse"].isnull())
    scale = scale_of(tried)
    low, high = (f"{float(end) * scale.factor:.2g}" for end in (tried.min(), tried.max()))
    return f"none up to {high if low == high else f'{low} to {high}'} {scale.unit}"


def _point_up(ax: Axes, x: NDArray[np.float64], color: str, number: int, label: str) -> None:
    """Mark at the upper edge where the least knock is beyond all that were tried."""
    ax.plot(
        x,
        np.full(x.size, 0.97 - 0.05 * number),
        linestyle="",
        marker="^",
        markersize=3.0,
        color=color,
        transform=ax.get_xaxis_transform(),
        label=label,
    )


def _mark(ax: Axes, x: NDArray[np.float64], lines: list[xr.Dataset]) -> None:
    """Shade where no line has a contact-free motion to start from."""
    is_rubbing = ~np.any([line["has_contact_free_motion"].values for line in lines], axis=0)
    edges = cell_edges(x)
    for i in np.flatnonzero(is_rubbing):
        label = "no contact-free motion" if i == np.flatnonzero(is_rubbing)[0] else None
        ax.axvspan(edges[i], edges[i + 1], color="0.85", linewidth=0, zorder=0, label=label)


def _in_words(lines: list[xr.Dataset], along: str, others: list[str]) -> list[str]:
    """A line of text for each curve: where the machine is least resilient."""
    lines_of_text = []
    for line in lines:
        name = ", ".join(_plain(line[d]) for d in others)
        impulse = line["least_impulse"].values
        head = f"{name}: " if name else ""
        if not np.isfinite(impulse).any():
            lines_of_text.append(f"{head}no knock that was tried leads to rub")
            continue
        i = int(np.nanargmin(impulse))
        worst = line.isel({along: i})
        lines_of_text.append(
            f"{head}least knock {float(worst.least_impulse):.4g} N s at {_plain(worst[along])}, "
            f"{np.degrees(float(worst.worst_angle)):.0f} degrees from straight up"
        )
    return lines_of_text


def _plain(value: xr.DataArray) -> str:
    return written(str(value.name), float(value), str(value.attrs["units"]))
