"""Floquet multipliers along branches: in the complex plane, and their moduli over the axis followed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.figures.branch_lines import draw_lines, mark_events, name_branches
from postproc.figures.drawing import Drawing
from postproc.figures.palette import categories
from postproc.store.axes import refusal
from postproc.store.branch_points import is_of_points, one_case
from postproc.store.units import displayed, plain_number

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from postproc.figures.options import Count

_LARGEST = 1.5  # modulus that is shown, unless all are smaller


def multipliers(cases: xr.Dataset, *, branch: Count | None = None) -> Drawing:
    """Floquet multipliers of branches: where they cross the unit circle.

    On the left the complex plane with the unit circle; multipliers beyond it are arrows at its edge. On the
    right the largest modulus over the axis that the branches follow, full where the motion is stable and
    dashed where it is not, with all events.

    Parameters
    ----------
    cases
        A branch study; axes but the one followed are taken at their first value.
    branch
        Number of one branch [default: all].
    """
    if not is_of_points(cases):
        raise refusal(cases, "has no multipliers; give the store of a study with [branch]")
    points, along, notes = one_case(cases)
    if branch is not None:
        known = np.unique(points["branch"].values)
        if branch not in known:
            raise refusal(cases, f"branch: there is no {branch}; give one of 1 to {known.max()}")
        points = points.isel(point=np.flatnonzero(points["branch"].values == branch))
    shown = points[["multiplier_real", "multiplier_imag", "stability", "event"]]

    def draw(axes: list[Axes]) -> None:
        draw_plane(shown, axes[0])
        draw_moduli(shown, along, axes[1])
        name_branches(axes)

    return Drawing(
        shown=shown, draw=draw, panels=(1, 2), is_shared=False, height=80, width=180, lines=tuple(notes)
    )


def draw_plane(data: xr.Dataset, ax: Axes) -> Axes:
    """Draw all multipliers in the complex plane, coloured by the period of their motion.

    Those beyond the plane are arrows at its edge, in their direction; the largest modulus is written.
    """
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    ax.plot(np.cos(turn), np.sin(turn), color="0.6", linewidth=0.8)
    values = data["multiplier_real"].values + 1j * data["multiplier_imag"].values
    largest = float(np.nanmax(abs(values)))
    limit = 1.06 * max(1.0, min(_LARGEST, largest))
    periods = data["period"].values
    for code, (_, shade) in categories("period", periods).items():
        of_period = values[periods == code].ravel()
        inside, edges = at_edges(of_period, limit)
        style: dict[str, Any] = {"linestyle": "", "markeredgewidth": 0.0, "color": shade}
        ax.plot(inside.real, inside.imag, marker="o", markersize=1.8, **style)
        for marker, places in edges.items():
            ax.plot(places.real, places.imag, marker=marker, markersize=4.5, clip_on=False, zorder=5, **style)
    if largest > limit:
        text = f"arrows: beyond, up to a modulus of {plain_number(largest, 3)}"
        ax.set_title(text, fontsize=6.5, loc="left", pad=3)
    ax.set(xlim=(-limit, limit), ylim=(-limit, limit), aspect="equal")
    ax.set(xlabel="Real part of the multiplier", ylabel="Imaginary part")
    return ax


def at_edges(values: NDArray[Any], limit: float) -> tuple[NDArray[Any], dict[str, NDArray[Any]]]:
    """Return the complex values in a square, and those beyond it by the arrow of the edge they are drawn at.

    `limit` is half the side of the square around zero. The others are on the ray from zero, by their marker
    ">", "^", "<" or "v". NaN is passed over.
    """
    values = values[np.isfinite(values)]
    reach = np.maximum(abs(values.real), abs(values.imag))
    far = values[reach > limit]
    on_edge = far * limit / reach[reach > limit]
    quarter = np.round(np.angle(far) / (0.5 * np.pi)).astype(int) % 4
    return values[reach <= limit], {
        marker: on_edge[quarter == k] for k, marker in enumerate(">^<v") if (quarter == k).any()
    }


def draw_moduli(data: xr.Dataset, along: str, ax: Axes) -> Axes:
    """Draw the largest modulus over the axis followed, with the events."""
    x, x_label = displayed(data[along])
    size = np.hypot(data["multiplier_real"].values, data["multiplier_imag"].values)[:, 0]
    ax.axhline(1.0, color="0.6", linewidth=0.8)
    draw_lines(data, x, size[:, None], ax)
    mark_events(data, x, size[:, None], ax)
    top = float(np.nanmax(size))
    highest = 1.06 * max(1.0, min(2.0 * _LARGEST, top))
    if top > highest:
        ax.set_title(f"beyond the panel, up to {plain_number(top, 3)}", fontsize=6.5, loc="left", pad=3)
    ax.set(xlabel=x_label, ylabel="Largest modulus", ylim=(0.0, highest))
    return ax
