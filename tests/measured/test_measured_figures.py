"""Figure commands of measured files: in place of a store, and with a case of one."""

from pathlib import Path

import data_logger
import numpy as np
import pytest
import synthetic_store
import xarray as xr
from click.testing import CliRunner

import rubhpc
from postproc.catalogue import figures
from rubhpc.commands.figures import figure_command
from rubhpc.errors import InputError

TABLES = """[time]
column = "t"
[speed]
column = "kp"
level = 2.5
[signal.vertical]
column = "y"
unit = "um"
[signal.horizontal]
column = "z"
unit = "um"
"""
CASE = ("speed_ratio=1.5", "clearance=84 um", "friction=0.3", "stator.youngs_modulus=3 GPa")
CHOSEN = [word for choice in CASE for word in ("--select", choice)]


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logger")
    synthetic_store.write(folder / "study.zarr", synthetic_store.make())
    data_logger.write(folder / "probe.csv", data_logger.steady(duration=0.5))
    data_logger.write(folder / "up.csv", data_logger.run_up(duration=4.0)[0])
    slow = data_logger.steady(duration=0.8)
    data_logger.write(folder / "slow.csv", slow | {"t": 1.5 * slow["t"]})
    for name in ("probe", "up"):
        (folder / f"{name}.toml").write_text(TABLES)
    at_node = TABLES.replace("[signal.horizontal]", "node = 8\n[signal.horizontal]")
    (folder / "rigged.toml").write_text('data = "probe.csv"\nrig = "mokhtar2017"\n' + at_node)
    (folder / "both.toml").write_text('data = ["slow.csv", "probe.csv"]\n' + TABLES)
    return folder


@pytest.fixture
def run(files, monkeypatch):
    monkeypatch.chdir(files)

    def invoke(name, *args):
        command = figure_command(figures()[name])
        return CliRunner().invoke(command, [str(word) for word in args], catch_exceptions=False)

    return invoke


@pytest.mark.parametrize(
    ("name", "args"),
    [
        ("waveform", ["probe.csv"]),
        ("spectrum", ["probe.toml", "--full", "--orders"]),
        ("orbit", ["rigged.toml", "--node", 8]),
        ("hht", ["rigged.toml", "--mode", 2]),
        ("cascade", ["both.toml"]),
        ("bode", ["both.toml", "--signal", "vertical", "--signal", "horizontal"]),
        ("waveform", ["up.toml", "--at", "1500 rpm"]),
        ("spectrum", ["up.toml", "--at", "1500 rpm"]),
        ("waterfall", ["up.toml", "--full"]),
        ("bode", ["up.toml"]),
        ("polar", ["up.toml", "--signal", "horizontal"]),
        ("centreline", ["up.toml"]),
    ],
)
def test_each_figure_takes_a_measured_file(run, name, args):
    said = run(name, *args).output.splitlines()
    assert Path(said[-1]).read_bytes().startswith(b"\x89PNG")


def test_lines_are_fractions_where_the_period_shows_it_and_else_as_measured(run, files):
    named = run("spectrum", "probe.toml", "--lines", 2).output.split()
    assert named[0] == "1X"
    assert "1/2X" in named
    for factor, name in ((1.0, "0.50X"), (0.94, "0.47X")):  # under noise, and off half the speed
        columns = data_logger.steady(duration=0.5, half=0.0)
        rng = np.random.default_rng(3)
        half = 40 * np.cos(np.pi * data_logger.SPEED * factor * columns["t"])
        columns["y"] += half + (20 * rng.standard_normal(half.size) if factor == 1.0 else 0)
        data_logger.write(files / "free.csv", columns)
        (files / "free.toml").write_text(TABLES)
        assert name in run("spectrum", "free.toml", "--lines", 2).output.split()


def test_a_figure_shows_one_case_and_a_record_over_one_another(run):
    both = run(
        "spectrum", "study.zarr", *CHOSEN, "--signal", "vertical", "--measured", "probe.csv", "--data", "s.nc"
    )
    assert both.output.splitlines()[-1] == "s.nc"
    with xr.open_dataset("s.nc", engine="h5netcdf") as shown:
        lines = shown["spectrum_vertical"].sel(order=[0.5, 1.0])
        assert lines.isel(motion=1).values == pytest.approx([40e-6, 100e-6], rel=0.01)
        assert lines.isel(motion=0).values == pytest.approx([2e-5, 1e-4], rel=1e-6)
    for name in ("waveform", "orbit"):
        said = run(name, "study.zarr", *CHOSEN, *(["--signal", "vertical"] if name == "waveform" else []),
                   "--measured", "probe.csv")  # fmt: skip
        assert said.output.splitlines()[-1] == f"study_{name}.png"


def test_figures_that_cannot_share_their_axes_are_next_to_one_another(run):
    chosen = [w for pair in zip(["--select"] * 3, CASE[1:], strict=True) for w in pair]
    args = ["study.zarr", *chosen, "--signal", "vertical", "--measured", "both.toml"]
    assert run("cascade", *args).output.splitlines()[-1] == "study_cascade.png"
    with pytest.raises(InputError, match="leave out --data"):
        run("cascade", *args, "--data", "s.nc")


@pytest.mark.parametrize(
    ("name", "args", "message"),
    [
        ("cascade", ["probe.csv"], "this selection is one case"),
        ("cascade", ["up.csv"], "the speed of this case changes, rubhpc waterfall draws it"),
        ("spectrum", ["up.csv"], "draw it with rubhpc waterfall, bode, or spectrum --at SPEED"),
        ("waterfall", ["probe.csv"], "its speed is constant"),
        (
            "spectrum",
            ["probe.csv", "--signal", "torsion"],
            "torsion: was not measured; there are vertical, hor",
        ),
        ("orbit", ["probe.csv", "--node", 3], "node 3: its motion is not recorded; leave it out"),
        ("waterfall", ["up.csv", "--signal", "probe_x"], "probe_x: was not measured; there are vertical"),
        ("orbit", ["probe.csv", "--stator", 1], "contains no rig; add rig to the measured file"),
        ("orbit", ["study.zarr", *CHOSEN, "--measured", "study.zarr"], "study.zarr: is no measured file"),
        (
            "waveform",
            ["study.zarr", *CHOSEN, "--signal", "torsion", "--measured", "probe.csv"],
            "probe.csv: torsion: was not measured",
        ),
        ("map", ["probe.csv"], "a map needs two axes of several values; there is none"),
        ("orbit", ["nothing.csv"], "nothing.csv: "),
        (
            "spectrum",
            ["study.zarr", "--signal", "vertical", "--measured", "probe.csv"],
            "select one value of",
        ),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_one_line(run, name, args, message):
    with pytest.raises(InputError, match=message) as refused:
        run(name, *args)
    assert "\n" not in str(refused.value)


def test_methods_of_a_measured_dataset_draw_its_figures(files):
    found = rubhpc.measured(files / "probe.csv")
    assert found.rub.spectrum().get_ylabel().startswith("Vertical displacement amplitude")
