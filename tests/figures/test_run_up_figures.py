"""Figures of run-ups: what a signal of known orders and a known offset becomes in them."""

import itertools
import math
from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr

from postproc.figures.bode import bode
from postproc.figures.centreline import centreline
from postproc.figures.polar import polar
from postproc.figures.run_up_marks import critical_speeds, name_speeds
from postproc.figures.spectrum import spectrum
from postproc.figures.speed import speed
from postproc.figures.waterfall import waterfall
from postproc.signals.run_ups import mean_positions, run_up_spectra
from rubhpc import LumpedStator, Rig, Unbalance
from rubhpc.errors import InputError

N, TURNS = 32, 60


def run_up(**attributes):
    """1X of 2 um that lags by 30 degrees, 3X of 1 um, and an offset that grows; two probes at 45 degrees."""
    angle = 2 * math.pi * np.arange(N * TURNS) / N
    offset = 1e-8 * np.arange(N * TURNS) / N
    moving = 2e-6 * np.cos(angle - math.pi / 6) + 1e-6 * np.cos(3 * angle)
    lines = np.stack([np.full(TURNS, 1e-6), np.full(TURNS, 2e-6)], axis=-1)
    phases = np.full((TURNS, 2), -math.pi / 6)
    metres = {"units": "m", "long_name": "amplitude of the displacement"}
    left = (offset + moving) * math.cos(math.pi / 4)
    return xr.Dataset(
        {
            "vertical": ("sample", offset + moving, {"units": "m"}),
            "horizontal": ("sample", 0.0 * moving, {"units": "m"}),
            "probe_left": ("sample", left, {"units": "m"}),
            "probe_right": ("sample", left, {"units": "m"}),
            "speed": ("revolution", np.linspace(50.0, 150.0, TURNS), {"units": "rad s-1"}),
            "amplitude_probe_left": (("revolution", "order"), lines, metres),
            "phase_probe_left": (("revolution", "order"), phases),
        },
        coords={
            "turned": ("sample", np.arange(N * TURNS) / N),
            "order": [0.5, 1.0],
            "revolution": np.arange(TURNS),
        },
        attrs={
            "study": {
                "record": {
                    "probe": [
                        {"name": name, "node": 1, "angle": angle, "quantity": "displacement"}
                        for name, angle in (("left", -math.pi / 4), ("right", math.pi / 4))
                    ]
                }
            }
        }
        | attributes,
    )


def test_spectra_have_the_heights_of_the_lines():
    found = run_up_spectra(run_up(), "vertical", window=8, count=5)
    assert found.sizes["place"] == 5
    heights = found["amplitude"].sel(order=[1.0, 2.0, 3.0])
    assert heights.values[:, 0] == pytest.approx(2e-6, rel=0.02)
    assert heights.values[:, 1] == pytest.approx(0.0, abs=3e-8)
    assert heights.values[:, 2] == pytest.approx(1e-6, rel=0.02)
    rising = found["frequency"].sel(order=1.0).values
    assert rising == pytest.approx(found["speed"].values / (2 * math.pi))


def test_a_waterfall_stacks_them_at_their_speeds():
    ax = waterfall(run_up(), window=8, count=5).show()
    assert "Vertical displacement 2 µm" in [text.get_text() for text in ax.texts]  # the bar
    low, high = ax.get_ylim()
    assert 470 < low < 600
    assert high > 150 * 30 / math.pi - 60
    heights = [
        line.get_ydata().max() - line.get_ydata().min() for line in ax.lines if line.get_color() == "C0"
    ]
    assert heights == pytest.approx([heights[0]] * 5, rel=0.02)
    colours = waterfall(run_up(), form="spectrogram", window=8, orders=True).show()
    assert colours.get_ylim() == (0.0, 4.0)


def whirling():
    """1X forward of 2 um and 1X backward of 1 um at both probes' node, nothing at the disc."""
    passed = run_up()
    turn = 2 * math.pi * passed["turned"].values
    whirl = 2e-6 * np.exp(1j * turn) + 1e-6 * np.exp(-1j * turn)  # vertical and i horizontal
    ways = ("probe_left", -math.pi / 4), ("probe_right", math.pi / 4)
    return passed.assign({p: ("sample", (whirl * np.exp(-1j * at)).real, {"units": "m"}) for p, at in ways})


def test_full_spectra_of_a_run_up_separate_forward_from_backward_whirl_of_two_probes():
    pair = {"full": True, "probes": ("left", "right")}
    ax = waterfall(whirling(), **pair, window=8, count=5, max=3, orders=True).show()
    assert ax.get_xlim() == (-3.0, 3.0)
    assert {"forward", "backward"} <= {text.get_text() for text in ax.texts}
    drawing = spectrum(whirling(), **pair, at=100.0)
    line = drawing.shown["whirl"]
    assert float(line.sel(order=1.0)) == pytest.approx(2e-6, rel=1e-6)
    assert float(line.sel(order=-1.0)) == pytest.approx(1e-6, rel=1e-6)
    assert float(line["speed"]) == pytest.approx(100.0, rel=0.05)
    with pytest.raises(InputError, match="add --full"):
        waterfall(whirling(), probes=("left", "right"))
    with pytest.raises(InputError, match=r"at: 4774\.65 rpm is none of its speeds"):
        spectrum(whirling(), full=True, at=500.0)


def test_a_waterfall_of_a_speed_that_rises_and_falls_is_drawn_over_revolutions():
    passed = run_up()
    passed["speed"][:] = np.concatenate([np.linspace(50.0, 150.0, TURNS // 2), np.linspace(150.0, 50.0, 30)])
    ax = waterfall(passed, window=8, count=10).show()
    assert ax.get_ylabel() == "Revolution, 583 to 1342 rpm"
    assert min(line.get_ydata().min() for line in ax.lines if line.get_color() == "C0") == 4.0
    named = {text.get_text(): text.xy for text in ax.texts if text.get_text().endswith("X")}
    assert named["3X"][0] > named["2X"][0] > named["1X"][0]
    assert waterfall(passed, form="spectrogram", window=8).show().get_xlim() == (4.0, 56.0)
    few = passed.isel(revolution=slice(0, 6), sample=slice(0, 6 * N))
    with pytest.raises(InputError, match="this run-up has 6 revolutions, too few for spectra"):
        waterfall(few)


def test_a_polar_plot_turns_the_lag_against_the_rotation_from_the_probe():
    ax = polar(run_up(), "probe_left").show()
    curve = ax.get_lines()[np.argmax([line.get_xdata().size == TURNS for line in ax.get_lines()])]
    place = complex(curve.get_ydata()[3], curve.get_xdata()[3])  # clockwise from straight up
    assert abs(place) == pytest.approx(2.0)
    assert math.degrees(np.angle(place)) == pytest.approx(-45 - 30)


def test_the_phase_lag_grows_downwards():
    """Revolutions at the ends, for which no window of six has its middle, have none."""
    amplitude, phase = bode(run_up(), "probe_left").show()
    for drawn, value in ((phase, 30.0), (amplitude, 2.0)):
        values = drawn.lines[0].get_ydata()
        assert np.flatnonzero(np.isnan(values)).tolist() == [0, 1, 2, TURNS - 2, TURNS - 1]
        assert values[3:-2] == pytest.approx(value)
    assert phase.get_ylim()[0] > phase.get_ylim()[1]


def test_a_centreline_is_a_mean_that_whirl_leaves_alone():
    alone = mean_positions(run_up(), ["vertical", "horizontal"])
    expected = 1e-8 * (np.arange(6, TURNS - 5) - 1 / N)
    assert alone["vertical"].values == pytest.approx(expected, abs=1e-12)
    ax = centreline(run_up(), probes=("left", "right")).show()
    scale = 1e9 if "nm" in ax.get_ylabel() else 1e6
    assert ax.lines[0].get_ydata() == pytest.approx(expected * scale, rel=1e-6)
    assert ax.lines[0].get_xdata() == pytest.approx(0.0, abs=1e-9 * scale)
    whirling = run_up()
    for order, left in ((1 / 3, 1e-11), (0.5, 1e-11), (0.43, 5e-7), (2.03, 2e-8)):
        whirl = 2e-5 * np.cos(2 * math.pi * order * whirling["turned"].values)
        found = mean_positions(whirling.assign(vertical=("sample", whirl)), ["vertical"])
        assert np.abs(found["vertical"].values).max() < left


def test_a_centreline_lies_in_the_clearance_of_a_ring():
    tips = [LumpedStator(node=1, angle=2.0 * i, mass=1e-3, stiffness=1e5, radius=0.1) for i in range(3)]
    rig = Rig.from_matrices(
        np.eye(2), None, 1e4 * np.eye(2), degrees=[(1, "v"), (1, "w")], stators=tips, unbalance=[]
    )
    case = run_up(rig=rig.as_dict()).assign_coords(clearance=1e-6)
    ax = centreline(case).show()
    assert np.hypot(*ax.lines[0].get_xydata().T) == pytest.approx(
        1e-6 * (1e9 if "nm" in ax.get_ylabel() else 1e6)
    )
    assert ax.get_legend().get_texts()[0].get_text() == "clearance"
    far = centreline(case.assign_coords(clearance=1e-3)).show()
    assert far.get_legend() is None


def test_there_is_no_phase_where_an_order_is_lost_in_other_motion():
    passed = run_up()
    phase = passed["phase_probe_left"].values.copy()
    phase[20:40, 1] = np.random.default_rng(1).uniform(-math.pi, math.pi, 20)
    phase[45:, 1] = -math.pi / 6 - 0.5 * np.arange(TURNS - 45)  # as fast as on passing a resonance
    passed["phase_probe_left"] = passed["phase_probe_left"].copy(data=phase)
    _, drawn = bode(passed, "probe_left").show()
    lag = drawn.lines[0].get_ydata()
    assert np.isnan(lag[20:40]).all()
    assert lag[3:15] == pytest.approx(30.0)
    assert (lag[45:-2] - lag[44]) == pytest.approx(np.degrees(0.5) * np.arange(TURNS - 47))


def test_an_order_without_a_phase_has_no_polar_plot():
    passed = run_up()
    passed["phase_probe_left"][:, 1] = np.arange(TURNS) * 1.0  # rad a revolution
    with pytest.raises(InputError, match="probe_left: 1X is none, or lost in other motion, and has no phase"):
        polar(passed, "probe_left")


@pytest.mark.parametrize("turns", [0.7, 1.6, 3.0])
def test_speeds_are_written_beside_curve_and_one_another(turns):
    """A spiral, whose ends and bends are where labels would fall on the curve."""
    at = np.linspace(0.02, 1.0, 300) * np.exp(2j * math.pi * turns * np.linspace(0.0, 1.0, 300))
    figure, ax = plt.subplots(figsize=(3.4, 3.4))
    ax.set(xlim=(-1.2, 1.2), ylim=(-1.2, 1.2))
    ax.plot(at.real, at.imag)
    name_speeds(ax, [(at.real, at.imag)], np.linspace(100.0, 300.0, 300))
    figure.canvas.draw()
    points = ax.transData.transform(np.column_stack([at.real, at.imag]))
    boxes = [text.get_window_extent().padded(-0.5) for text in ax.texts]
    assert len(boxes) > 3
    assert not any(box.count_contains(points) for box in boxes)
    assert not any(a.overlaps(b) for a, b in itertools.combinations(boxes, 2))


def test_critical_speeds_that_lie_together_share_a_label():
    cases = run_up(rig=mass_of_1_kg(1e4, 1.02e4).as_dict())
    cases["time"] = "revolution", np.linspace(0.0, 4.0, TURNS)
    (ax,) = speed(cases).show()
    assert [text.get_text() for text in ax.texts] == ["critical, 955, 964 rpm"]


def mass_of_1_kg(*stiffness):
    """A rig with these two stiffnesses, N/m."""
    return Rig.from_matrices(
        np.diag([1.0, 1.0]),
        None,
        np.diag(stiffness),
        degrees=[(1, "v"), (1, "w")],
        stators=[LumpedStator(node=1, mass=0.1, stiffness=1e5, damping=1.0, radius=0.1)],
        unbalance=[Unbalance(node=1, mass=1e-4, radius=0.1)],
    )


def test_a_polar_plot_names_all_critical_speeds():
    for upper, words in ((1.69e4, "critical speeds, 955, 1241 rpm"), (9e6, "critical speed, 955 rpm")):
        ax = polar(run_up(rig=mass_of_1_kg(1e4, upper).as_dict()), "probe_left").show()
        assert [text.get_text() for text in ax.get_legend().get_texts()][-1] == words


def test_speeds_of_a_polar_plot_keep_clear_of_the_names_of_the_rays():
    """Of a signal that leads by 6 degrees, whose speeds lie beside the name of the ray without lag."""
    cases = run_up()
    cases["phase_probe_left"] = 0.0 * cases["phase_probe_left"] + math.radians(6)
    ax = polar(cases, "probe_left").show()
    boxes = {text.get_text(): text.get_window_extent() for text in ax.texts if text.get_text()}
    speeds = [box for name, box in boxes.items() if name.isdigit() and int(name) > 400]
    assert speeds
    ray = boxes["0\N{DEGREE SIGN} lag"]
    assert not any(box.overlaps(ray) for box in speeds)


def test_critical_speeds_are_those_that_the_unbalance_excites():
    cases = run_up(rig=mass_of_1_kg(1e4, 9e6).as_dict())
    assert critical_speeds(cases, xr.DataArray([50.0, 150.0])) == pytest.approx([100.0])
    assert critical_speeds(run_up(), run_up()["speed"]) == []
    _, phase = bode(cases, "probe_left").show()
    assert [text.get_text() for text in phase.get_legend().get_texts()] == ["critical speed, 955 rpm"]


def test_figures_of_cases_of_one_law_seek_them_once(monkeypatch):
    """Their first and last speeds differ a little; a speed beyond those of a case is not its own."""
    asked = []
    monkeypatch.setattr(
        "rubhpc.fem.critical_speeds.find_critical_speeds",
        lambda model, speeds: (
            asked.append(speeds),
            [SimpleNamespace(speed=v, is_excited=True) for v in (100, 149.9)],
        )[1],
    )
    cases = run_up(rig=mass_of_1_kg(1e4, 2e4).as_dict())
    assert critical_speeds(cases, xr.DataArray([50.2, 150.0])) == [100, 149.9]
    assert critical_speeds(cases, xr.DataArray([50.1, 149.8])) == [100]
    assert len(asked) == 1
    assert asked[0][0] <= 50.1
    assert asked[0][-1] >= 150.0


def test_what_has_no_run_up_is_refused():
    steady = xr.Dataset(
        {"vertical": ("sample", np.zeros(8))}, coords={"revolution": ("sample", np.arange(8))}
    )
    with pytest.raises(
        InputError, match=r"its speed is constant; give a run-up, as of a study with \[run_up\]"
    ):
        waterfall(steady)
    with pytest.raises(InputError, match=r"its speeds are constant; give a store with \[run_up\]"):
        speed(steady)
    with pytest.raises(InputError, match=r"left: no such signal; did you mean probe_left\?"):
        waterfall(run_up(), "left")


def test_the_speed_is_drawn_over_the_time_with_the_torques_of_a_drive():
    case = run_up()
    begins = np.concatenate([[0.0], np.cumsum(2 * math.pi / case.speed.values)])[:-1]
    case["time"] = "revolution", begins, {"units": "s"}
    (ax,) = speed(case).show()
    assert ax.lines[0].get_ydata()[[0, -1]] == pytest.approx([1500 / math.pi, 4500 / math.pi])
    assert ax.lines[0].get_xdata()[0] == pytest.approx(math.pi / 50.0)
    case["drive_work"] = "revolution", np.full(TURNS, 4 * math.pi), {"units": "J"}
    case["braking_torque"] = "revolution", np.linspace(0.0, 1.5, TURNS), {"units": "N m"}
    _, torques = speed(case).show()
    brake, drive = torques.lines[:2]
    assert brake.get_ydata()[-1] == pytest.approx(1.5)
    assert drive.get_ydata() == pytest.approx(np.full(TURNS, 2.0))
