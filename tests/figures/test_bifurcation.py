"""Bifurcation diagrams of a synthetic store: which points, in which colours, along which axis."""

import numpy as np
import pytest
import synthetic_store
import xarray as xr
from matplotlib.colors import to_rgba
from printing import printed

from postproc.figures.bifurcation import default_axis, draw_bifurcation, draw_simulated
from postproc.figures.palette import REGIME_COLORS
from postproc.signals.sections import sections_along
from postproc.store.open import open_store
from postproc.store.select import select
from rubhpc.errors import InputError
from rubhpc.schema import DIVERGED, DONE, REGIME

CHOICE = {"clearance": "84 um", "friction": 0.3, "stator.youngs_modulus": "30 GPa"}
UNFINISHED = {"clearance": "70 um", "friction": 0.1, "stator.youngs_modulus": "3 GPa"}
SPEEDS = synthetic_store.AXES["speed_ratio"][2]
POINTS = synthetic_store.REVOLUTIONS


@pytest.fixture
def store(synthetic_path):
    return select(open_store(synthetic_path), CHOICE)


@pytest.fixture
def data(store):
    return sections_along(store, "vertical", "speed_ratio").load()


@pytest.fixture
def unfinished(synthetic_path):
    return sections_along(select(open_store(synthetic_path), UNFINISHED), "vertical", "speed_ratio")


def both_ways(data):
    """The same of a sweep up and down."""
    flags = xr.DataArray([0, 1], dims="direction", attrs={"flag_meanings": "up down"})
    return data.expand_dims(direction=[0, 1]).copy(deep=True).assign_coords(direction=flags)


def drawn(ax):
    """Abscissas of the points in each colour, by its name."""
    return {line.get_label(): np.unique(line.get_xdata()) for line in ax.lines}


def test_points_have_the_colour_of_their_regime(data, ax):
    assert draw_bifurcation(data, "vertical", ax) is ax
    expected = {name: [] for name in ("no contact", "periodic", "quasi-periodic", "chaotic")}
    for speed, code in zip(SPEEDS, synthetic_store.REGIMES, strict=True):
        expected[REGIME[code].replace("no_", "no ").replace("_", "-")].append(speed)
    assert {name: list(at) for name, at in drawn(ax).items()} == expected
    for line in ax.lines:
        assert len(line.get_xdata()) == POINTS * len(drawn(ax)[line.get_label()])
    assert to_rgba(ax.lines[-1].get_color()) == to_rgba(REGIME_COLORS[REGIME.index("chaotic")])
    assert "once a revolution (µm)" in ax.get_ylabel()


def test_points_have_the_colour_of_their_period(data, ax):
    draw_bifurcation(data, "vertical", ax, "period")
    assert {name: list(at) for name, at in drawn(ax).items()} == {
        "none": [1.5, 1.7],
        "P1": [1.0, 1.25],
        "P2": [0.75],
    }


def test_points_are_every_whole_revolution_of_the_waveform(store, data, ax):
    draw_bifurcation(data, "vertical", ax, color=None)
    whole = store["vertical"].values[:, :: synthetic_store.SAMPLES]
    assert ax.lines[0].get_ydata() == pytest.approx(1e6 * whole.ravel(), rel=1e-6)


def test_cases_that_are_not_done_leave_no_point(unfinished, ax):
    draw_bifurcation(unfinished, "vertical", ax)
    values = synthetic_store.make()["status"].values[:, 0, 0, 0]
    there = np.concatenate(list(drawn(ax).values()))
    assert sorted(there) == [s for s, status in zip(SPEEDS, values, strict=True) if status == DONE]


def hatched(ax):
    """Where along the axis the patches end, by their names in the legend."""
    return {
        patch.get_label(): (
            np.min(patch.get_path().vertices[:, 0]),
            np.max(patch.get_path().vertices[:, 0]),
        )
        for patch in ax.patches
    }


def test_cases_without_a_result_are_hatched_and_named(unfinished, ax):
    draw_bifurcation(unfinished, "vertical", ax)
    middle = (np.array(SPEEDS[1:]) + SPEEDS[:-1]) / 2
    assert {name: pytest.approx(ends) for name, ends in hatched(ax).items()} == {
        "diverged": (SPEEDS[0] - (middle[0] - SPEEDS[0]), middle[0]),
        "failed": (middle[0], middle[1]),
        "missing": (middle[1], middle[2]),
    }
    named = [text.get_text() for text in ax.figure.legends[0].get_texts()]
    assert set(hatched(ax)) <= set(named)
    assert ax.get_xlim()[0] < SPEEDS[0]  # though no point is there
    assert ax.get_ylim()[1] < 400  # µm: the hatch has the height of the panel, whatever it is


def test_of_a_sweep_both_ways_those_of_each_are_hatched(data, ax):
    swept = both_ways(data)
    swept["status"][1, -1] = DIVERGED
    draw_bifurcation(swept, "vertical", ax, "direction")
    assert list(hatched(ax)) == ["diverged, down"]


def test_under_branches_the_marks_of_both_sweeps_stand_out(data, ax):
    """A falling sweep lies on the line of its branch: its marks are wider than the line, and dark."""
    draw_simulated(both_ways(data), "vertical", ax)
    up, down = ax.lines
    assert (up.get_marker(), down.get_marker()) == ("^", "v")
    assert up.get_markersize() > down.get_markersize() > 3.0  # pt; lines of branches are 1.2 wide
    assert to_rgba(up.get_color())[0] - to_rgba(down.get_color())[0] > 0.5  # greys


def test_points_are_read_lazily(store):
    assert sections_along(store, "vertical", "speed_ratio")["section_vertical"].chunks is not None


def test_signal_without_section_is_taken_from_its_waveform(store):
    found = sections_along(store, "contact_force", "speed_ratio")["section_contact_force"]
    assert found.shape == (5, POINTS)


def test_longest_axis_is_the_one(synthetic_path):
    store = open_store(synthetic_path)
    assert default_axis(store) == "speed_ratio"
    assert default_axis(store, "stator.youngs_modulus") == "stator_youngs_modulus"
    with pytest.raises(InputError, match="several values"):
        default_axis(store.isel(dict.fromkeys(store["status"].dims, 0)))


def test_command_takes_the_first_of_other_axes_and_writes_the_points(synthetic_path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    args = [str(synthetic_path), "--along", "clearance", "--color", "period", "--data", "points.csv"]
    args += ["--select", "speed_ratio=1.5", "--signal", "torsion"]
    said = printed("bifurcation", *args).splitlines()
    assert "friction = 0.1: the first of 2; change with --select friction=VALUE" in said
    assert said[-2:] == ["study_bifurcation.png", "points.csv"]
    table = np.genfromtxt("points.csv", delimiter=",", names=True, deletechars="")
    assert len(table) == 3 * POINTS
    assert set(np.unique(table["clearance_(m)"])) == {70e-6, 84e-6, 100e-6}


def test_an_axis_of_even_ratios_is_drawn_on_a_log_scale(synthetic_path, ax):
    store = select(
        open_store(synthetic_path), {"friction": 0.3, "stator.youngs_modulus": "30 GPa", "speed_ratio": 1.0}
    )
    store = store.assign_coords(clearance=store["clearance"].copy(data=[1e-5, 1e-4, 1e-3]))
    draw_bifurcation(sections_along(store, "vertical", "clearance"), "vertical", ax)
    assert ax.get_xscale() == "log"


def test_points_that_differ_by_rounding_do_not_fill_the_axes(data, ax):
    data["section_vertical"][...] = 1e-4 * (1 + 1e-9 * np.random.default_rng(1).random((5, POINTS)))
    draw_bifurcation(data, "vertical", ax)
    assert np.ptp(ax.get_ylim()) == pytest.approx(2.0)  # um, of 100
