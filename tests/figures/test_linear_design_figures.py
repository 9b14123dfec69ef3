"""Figures of a linear design: what they show, and where they refuse."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from trial_rig import trial_rig

from postproc.figures.drawing import house_style, new_figure
from postproc.figures.linear_design import mode_shapes, unbalance_response
from rubhpc import InputError, Rig, Unbalance, linear_design


@pytest.fixture(scope="module")
def design():
    return linear_design(trial_rig(1), (0.0, 600.0), operating=(350.0, 400.0), n_speed=13)


def test_response_shows_amplitude_phase_and_the_operating_range(design, tmp_path):
    drawing = unbalance_response(design, 3)
    amplitude, phase = drawing.show()
    curve = amplitude.lines[0]
    assert curve.get_xdata() == pytest.approx(30 / np.pi * design.response_speed.values)
    assert curve.get_ydata() == pytest.approx(1e6 * design.major_axis.sel(node=3).values)
    lag = phase.lines[0].get_ydata()
    lead = np.degrees(design.phase.sel(node=3).isel(probe=0).values)
    assert np.exp(1j * np.radians(lag[5])) == pytest.approx(np.exp(-1j * np.radians(lead[5])))
    assert phase.get_ylabel().startswith("Phase lag")
    assert phase.yaxis_inverted()
    assert 90.0 < lag[-1] - lag[1] < 180.0, "past the resonance it falls behind"
    assert "operating speeds" in [text.get_text() for text in amplitude.get_legend().get_texts()]
    named = [text.get_text() for text in amplitude.texts]
    speed, factor = float(design.peak_speed[0]), float(design.amplification_factor[0])
    assert f"{30 / np.pi * speed:.0f}\nAF {factor:.3g}" in named
    assert drawing.save(tmp_path / "response.png").stat().st_size > 10_000
    with pytest.raises(InputError, match="node: 9 is not in the response; choose one of 1, 2, 3, 4, 5"):
        unbalance_response(design, 9)


def test_speeds_of_five_digits_have_room_below_a_response():
    wide = linear_design(trial_rig(1), (0.0, 20000 * np.pi / 30), n_speed=3)
    with house_style():
        figure, axes = new_figure(2, height=90)
        unbalance_response(wide, 3).draw(axes)
        figure.canvas.draw()
        boxes = [label.get_window_extent() for label in axes[1].get_xticklabels() if label.get_text()]
    assert len(boxes) >= 4
    assert all(left.x1 + 0.3 * left.height < right.x0 for left, right in pairwise(boxes))


def test_shapes_have_a_panel_each_and_unit_size(design, tmp_path):
    drawing = mode_shapes(design)
    axes = drawing.show()
    assert len(axes) == design.sizes["critical"]
    for ax in axes:
        size = np.hypot(ax.lines[1].get_ydata(), ax.lines[2].get_ydata())
        assert size.max() == pytest.approx(1.0, abs=1e-9)
        assert ax.lines[1].get_xdata() == pytest.approx(np.linspace(0.0, 0.6, 5))
        assert ax.lines[3].get_xdata() == pytest.approx([0.0, 0.6])  # bearings
    assert drawing.save(tmp_path / "shapes.png").stat().st_size > 10_000


def test_a_rotor_of_matrices_is_drawn_over_its_nodes():
    rig = Rig.from_matrices(
        np.eye(4),
        np.eye(4),
        np.diag([1e4, 1e4, 2e4, 2e4]),
        degrees=[(1, "v"), (1, "w"), (4, "v"), (4, "w")],
        unbalance=[Unbalance(node=4, mass=0.1, radius=0.01)],
    )
    axes = mode_shapes(linear_design(rig, (0.0, 200.0), n_speed=7)).show()
    assert axes[-1].get_xlabel() == "Node"
    assert axes[0].lines[1].get_xdata().tolist() == [1, 4]


def test_no_critical_speed_has_no_shape():
    quiet = linear_design(replace(trial_rig(1)), (10.0, 20.0), n_speed=3)
    with pytest.raises(InputError, match=r"no critical speed from 95.493 to 190.986 rpm; widen the range"):
        mode_shapes(quiet)
