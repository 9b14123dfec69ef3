"""Ticks at the values of an axis of the study, where these are few enough to be labelled."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from postproc.store.units import displayed, meanings, plain_number

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.ticker import Locator
    from numpy.typing import NDArray

MOST = 10  # values; an axis of more has round ticks
_CHARACTER, _GAP, _LINE = 1.5, 1.5, 3.6  # mm, of labels of 8 pt
_DEGREES = (1, 2, 5, 10, 15, 30, 45)  # between ticks of a phase
_PANEL = 0.85  # of the room for axes and their labels, taken by the axes


def tick_levels(ax: Axes, which: str, levels: xr.DataArray, at: NDArray[np.float64] | None = None) -> None:
    """Tick the values of a coordinate, and label the first and, going on, each that has room.

    Set limits and scale of the axes first. An axis of many values keeps its ticks.

    Parameters
    ----------
    which : {"x", "y"}
    at : (n,), optional
        Where the values are on the axes, if not at their displayed value.
    """
    from matplotlib.ticker import NullLocator

    values, _ = displayed(levels)
    if values.size > MOST:
        return
    places = values if at is None else at
    names = [plain_number(value) for value in values]
    if flags := meanings(levels):
        names = [flags[int(value)] for value in levels.values]
    axis: Axis = getattr(ax, f"{which}axis")
    ascending = np.argsort(places)
    along = _millimetres(ax, which, places[ascending])
    need = _LINE if which == "y" else _GAP + _CHARACTER * max(map(len, names))
    named = [0]
    for k in range(1, values.size):
        if abs(along[k] - along[named[-1]]) >= need:
            named.append(k)
    if len(named) == 1:
        named.append(values.size - 1)
    labels = [""] * values.size
    for i in ascending[named]:
        labels[i] = names[i]
    axis.set_ticks(places, labels)
    axis.set_minor_locator(NullLocator())


def _millimetres(ax: Axes, which: str, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where values are along an axis, about: the layout of the figure is not known yet."""
    scale = getattr(ax, f"{which}axis").get_transform()
    ends = np.asarray(scale.transform(np.asarray(getattr(ax, f"get_{which}lim")())))
    share = (np.asarray(scale.transform(places)) - ends[0]) / (ends[1] - ends[0])
    box = ax.get_window_extent()
    pixels = box.width if which == "x" else box.height
    millimetres: NDArray[np.float64] = share * _PANEL * pixels / ax.figure.dpi * 25.4
    return millimetres


def degree_steps(ax: Axes) -> Locator:
    """Return ticks for the phase on an ordinate, degrees: right angles, or parts of them where it has few."""
    from matplotlib.ticker import MaxNLocator, MultipleLocator

    low, high = sorted(ax.get_ylim())
    if high - low < _DEGREES[0]:
        return MaxNLocator(4, steps=[1, 2, 5, 10])
    step = next((step for step in _DEGREES if high - low <= 4 * step), 90 * max(1, round((high - low) / 450)))
    return MultipleLocator(step)
