"""Modes followed over speed, critical speeds, and the figure that shows them."""

import math

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from postproc.figures.linear_design import campbell_diagram
from rubhpc.fem.critical_speeds import campbell
from rubhpc.fem.modes import modes
from rubhpc.fem.rotor import assemble_rotor
from rubhpc.rig.parts import Bearing, Disc, ShaftSection, Torsion
from rubhpc.rig.rotors import Rotor


@pytest.fixture(scope="module")
def overhung():
    """A disc beside its bearings: strong gyroscopic splitting, and curves that cross torsion."""
    shaft = ShaftSection(
        length=0.5, outer_diameter=0.03, elements=5, youngs_modulus=2.1e11, shear_modulus=8e10, density=7800.0
    )
    disc = Disc(node=6, diameter=0.3, thickness=0.03, density=7800.0)
    supports = (Bearing(node=1, stiffness=5e7), Bearing(node=4, stiffness=5e7))
    return assemble_rotor(
        Rotor(shaft=(shaft,), disc=(disc,), bearing=supports, torsion=Torsion(fixed_node=1))
    )


@pytest.fixture(scope="module")
def curves(overhung):
    return campbell(overhung, np.linspace(0.0, 3000.0, 16))


def test_every_mode_has_one_curve(overhung, curves):
    assert curves.sizes == {"mode": overhung.n_dof, "speed": 16}
    for i_speed in (0, 7, 15):
        alone = sorted(mode.frequency for mode in modes(overhung, float(curves["speed"][i_speed])))
        assert np.sort(curves["frequency"][:, i_speed]) == pytest.approx(alone)


def test_curves_keep_their_whirl_and_run_smoothly(curves):
    spinning = curves.isel(speed=slice(1, None))
    for whirl in spinning["whirl"].values:
        assert len(set(whirl)) == 1
    forward = spinning["whirl"].values[:, 0] == "forward"
    backward = spinning["whirl"].values[:, 0] == "backward"
    assert forward.sum() == backward.sum() == (curves["kind"].values == "lateral").sum() / 2
    slopes = np.diff(curves["frequency"].values, axis=1)
    # spin stiffens forward whirl and softens backward whirl; 1e-6 Hz is rounding of the highest modes
    assert slopes[forward].min() > -1e-6
    assert slopes[backward].max() < 1e-6


def test_diagram_draws_each_motion_in_its_own_style(overhung, curves):
    shown = curves.isel(mode=curves["kind"].values != "axial").isel(mode=slice(5))
    ax = Figure().subplots()
    critical = [300.0, 900.0, 1500.0]
    assert campbell_diagram(shown, ax, critical, limit=300.0) is ax
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert names == ["Forward", "Backward", "Torsional", "Critical (1X)"]
    assert ax.get_xlabel() == "Spin speed (rpm)"
    assert ax.get_ylabel() == "Natural frequency (Hz)"
    assert ax.get_xlim() == pytest.approx((0.0, 3000 * 30 / math.pi))
    assert ax.get_ylim() == (0.0, 300.0)
    numbers = {f"{30 / math.pi * speed:.0f}" for speed in critical}
    texts = {text.get_text() for text in ax.texts}
    assert texts > {"1X", "2X"}
    assert texts - {"1X", "2X"} == numbers
    marks = next(line for line in ax.lines if line.get_marker() == "o")
    # on the 1X line: as many turns a second as hertz
    assert marks.get_xdata() / 60 == pytest.approx(marks.get_ydata())
    assert len(marks.get_xdata()) == len(critical) > 0
    whole = [line for line in ax.lines if len(line.get_xdata()) == 16]
    assert len(whole) == 5
    assert {mpl.colors.to_hex(line.get_color()) for line in whole} == {
        mpl.colors.to_hex(color) for color in ("C0", "C1", "C2")
    }


@pytest.mark.parametrize(("gap", "written"), [(0.02, {"4000, 4080"}), (0.5, {"4000", "6000"})])
def test_critical_speeds_whose_numbers_would_meet_share_a_line(curves, gap, written):
    ax = Figure(figsize=(3.5, 2.4)).subplots()
    critical = [4000 * math.pi / 30, 4000 * (1 + gap) * math.pi / 30]
    campbell_diagram(curves.isel(mode=slice(5)), ax, critical, limit=300.0)
    assert {text.get_text() for text in ax.texts} - {"1X", "2X"} == written


def test_diagram_breaks_the_curve_where_a_mode_does_not_oscillate(curves):
    shown = curves.isel(mode=[0]).copy(deep=True)
    shown["damping_ratio"][0, 5:7] = 1.5
    shown["frequency"][0, 7] = 0.0
    ax = Figure().subplots()
    campbell_diagram(shown, ax)
    drawn = max(ax.lines, key=lambda line: len(line.get_xdata())).get_ydata()
    assert np.isnan(drawn[5:8]).all()
    assert np.isfinite(np.delete(drawn, [5, 6, 7])).all()


def test_legend_names_no_motion_that_is_not_drawn(curves):
    shown = curves.isel(mode=[0]).copy(deep=True)
    shown["whirl"] = (("mode", "speed"), [["backward"] + 15 * ["forward"]])
    shown["damping_ratio"][0, 0] = 1.5  # the one stretch of backward whirl is overdamped
    ax = Figure().subplots()
    campbell_diagram(shown, ax)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["Forward"]


def test_diagram_changes_style_where_a_mode_changes_its_whirl(curves):
    shown = curves.isel(mode=[0]).copy(deep=True)
    shown["whirl"] = (("mode", "speed"), [["planar"] + 6 * ["backward"] + ["planar"] + 8 * ["forward"]])
    ax = Figure().subplots()
    campbell_diagram(shown, ax)
    parts = [line.get_xdata() for line in ax.lines if len(line.get_xdata()) > 2]
    # lone planar points join what follows, and the parts meet
    assert [len(part) for part in parts] == [8, 9]
    assert parts[0][-1] == parts[1][0]
