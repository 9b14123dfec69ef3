"""Stores of sweeps both ways: the directions by name, apart in figures, on the page."""

import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.figure import Figure
from running import write_study

import rubhpc
from postproc.figures.bifurcation import default_coloring, draw_bifurcation
from postproc.report.grid import described_axes
from postproc.signals.sections import sections_along
from postproc.store.attributes import table_of
from postproc.store.select import first_of_rest, select
from postproc.store.units import caption, written_value
from rubhpc.cli import commands
from rubhpc.errors import InputError


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """A study of three speeds up and down at two clearances."""
    folder = tmp_path_factory.mktemp("swept")
    axis = '{ values = [0.9, 1.4, 1.9], sweep = "both" }'
    study = write_study(folder, speed_ratio=axis, friction=[0.2], transient=4)
    rubhpc.run(study, quiet=True)
    return folder / "tiny.zarr"


@pytest.fixture
def store(path):
    return rubhpc.open(path)


@pytest.mark.parametrize(("word", "i"), [("up", 0), ("down", 1), ("1", 1), (0, 0)])
def test_a_direction_is_selected_by_its_name(store, word, i):
    one = select(store, {"direction": word})
    assert int(one.direction) == i
    assert "direction" not in one.dims
    assert written_value(one.direction) == f"direction {('up', 'down')[i]}"
    assert f"direction {('up', 'down')[i]}" in caption(one)


def test_both_directions_may_be_listed_and_others_are_refused(store):
    assert select(store, {"direction": "down,up"}).direction.values.tolist() == [1, 0]
    with pytest.raises(InputError, match="direction = sideways: not on the grid; choose one of up, down"):
        select(store, {"direction": "sideways"})
    _, notes = first_of_rest(store, ["speed_ratio", "clearance_ratio"], "peak_torsion")
    assert notes == ["direction = up: the first of 2; change with --select direction=VALUE"]


def test_a_diagram_distinguishes_the_directions_unless_one_is_chosen(store):
    assert default_coloring(store) == "direction"
    one = select(store, {"direction": "up", "clearance_ratio": 0.7})
    assert default_coloring(one) == "regime"
    with pytest.raises(InputError, match='the store has one direction; sweep an axis "both" ways'):
        default_coloring(one, "direction")
    data = sections_along(select(store, {"clearance_ratio": 0.7}), "vertical", "speed_ratio", "direction")
    ax = draw_bifurcation(data, "vertical", Figure(layout="constrained").add_subplot(), "direction")
    up, down = ax.lines
    assert [line.get_label() for line in ax.lines] == ["up", "down"]
    assert up.get_color() != down.get_color()
    assert up.get_marker() != down.get_marker()
    points = 1e6 * data.section_vertical.transpose("direction", "speed_ratio", "section").values
    for line, way in zip(ax.lines, points, strict=True):
        assert line.get_xdata().tolist() == np.repeat([0.9, 1.4, 1.9], 2).tolist()
        np.testing.assert_allclose(line.get_ydata(), way.ravel(), rtol=1e-12)


@pytest.mark.parametrize(
    "arguments",
    [
        ("bifurcation",),
        ("bifurcation", "--color", "period", "--select", "direction=down"),
        ("map", "--value", "regime", "--facet", "direction"),
        ("map", "--x", "speed_ratio", "--y", "direction"),
        ("cascade", "--select", "direction=up", "--select", "clearance_ratio=0.7"),
        ("waveform", "--select", "speed_ratio=1.4", "--select", "clearance_ratio=0.7", "--over", "direction"),
        ("orbit", "--select", "speed_ratio=1.4", "--select", "clearance_ratio=0.7", "--over", "direction"),
    ],
)
def test_every_figure_takes_a_store_of_two_directions(path, tmp_path, arguments):
    figure = tmp_path / "figure.png"
    done = CliRunner().invoke(commands, [arguments[0], str(path), *arguments[1:], "--figure", str(figure)])
    assert done.exit_code == 0, (done.output, done.exception)
    assert figure.stat().st_size > 5000


def test_the_page_names_the_directions(store):
    axis = described_axes(store)[-1]
    assert (axis["name"], axis["names"], axis["label"]) == ("direction", ["up", "down"], "Direction")
    assert all(about["names"] == [] for about in described_axes(store)[:-1])


def test_the_store_keeps_its_study_without_the_added_axis(store):
    grid = table_of(store, "study")["grid"]
    assert list(grid) == ["speed_ratio", "clearance_ratio", "friction"]
    assert grid["speed_ratio"]["sweep"] == "both"
    assert "sweep" not in grid["friction"]
