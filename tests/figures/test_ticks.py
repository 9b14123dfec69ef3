"""Ticks at the values of a study: as many are labelled as have room, however unequal their steps."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from postproc.figures.cells import degree_steps, tick_levels


def labelled(values: list[float], width: float) -> list[str]:
    ax = Figure(figsize=(width, 2.0)).subplots()
    ax.set_xlim(min(values), max(values))
    levels = xr.DataArray(np.array(values), dims="ratio", name="ratio", attrs={"units": "1"})
    tick_levels(ax, "x", levels)
    assert ax.get_xticks().tolist() == values
    return [text.get_text() for text in ax.get_xticklabels() if text.get_text()]


@pytest.mark.parametrize("turn", [1, -1])
def test_close_values_do_not_cost_far_ones_their_labels(turn):
    values = [4500.0, 6500.0, 6600.0, 6700.0, 7700.0, 8500.0]
    assert labelled(values[::turn], 4.0) == ["4500", "6500", "7700", "8500"][::turn]


def test_equal_steps_are_labelled_at_equal_steps():
    assert labelled([float(v) for v in range(1000, 1010)], 4.0) == [f"{v}" for v in range(1000, 1010, 2)]


def test_where_two_have_room_the_ends_are_labelled():
    assert labelled([1000.0, 1001.0, 1002.0], 0.5) == ["1000", "1002"]


@pytest.mark.parametrize(
    ("low", "high", "step"),
    [
        (-3.0, 720.0, 180),
        (-60.0, 300.0, 90),
        (0.0, 170.0, 45),
        (3.0, 98.0, 30),
        (10.0, 14.0, 1),
        (2.0, 2.35, 0.1),
    ],
)
def test_a_phase_has_a_few_ticks_at_round_angles(low, high, step):
    ax = Figure().subplots()
    ax.set_ylim(high, low)  # a lag grows downwards
    ticks = degree_steps(ax).tick_values(low, high)
    inside = ticks[(ticks >= low) & (ticks <= high)]
    assert np.diff(inside) == pytest.approx(step)
    assert 3 <= inside.size <= 6
    assert inside / step == pytest.approx(np.round(inside / step))
