"""The figure commands, from the command line to the files they leave."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import synthetic_store
import xarray as xr
from printing import printed

from postproc.catalogue import figures
from postproc.store.open import open_store
from postproc.store.select import select
from rubhpc.errors import InputError

CLEARANCE, FRICTION, MODULUS = "clearance=84 um", "friction=0.3", "stator.youngs_modulus=3 GPa"


def options(*chosen):
    return [word for choice in chosen for word in ("--select", choice)]


ONE = options("speed_ratio=1.5", CLEARANCE, FRICTION, MODULUS)


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return printed


@pytest.mark.parametrize(
    ("name", "args"),
    [
        (
            "cascade",
            [*options(CLEARANCE, FRICTION, MODULUS), "--form", "intensity", "--mark", "stiff=53.5 Hz"],
        ),
        ("map", ["--value", "regime", "--x", "clearance", "--y", "friction"]),
        ("spectrum", [*options(CLEARANCE, MODULUS, "speed_ratio=1.5"), "--over", "friction", "--log"]),
        ("waveform", ONE),
    ],
)
def test_each_command_leaves_its_figure_and_says_where(run, synthetic_path, name, args):
    said = run(name, synthetic_path, *args).splitlines()
    assert said[-1] == f"study_{name}.png"
    assert Path(said[-1]).read_bytes().startswith(b"\x89PNG")


def test_a_spectrum_shows_its_lines(run, synthetic_path):
    said = run("spectrum", synthetic_path, *ONE, "--signal", "vertical").splitlines()
    assert said[0].split() == ["1X", "47.339", "Hz", "1.0000e-04", "m"]


def test_data_come_as_a_table(run, synthetic_path):
    run("spectrum", synthetic_path, *ONE, "--signal", "vertical", "--data", "lines.csv")
    table = np.genfromtxt("lines.csv", delimiter=",", names=True, deletechars="")
    row = table[np.isclose(table["order"], 1.0)]
    assert row["spectrum_vertical_(m)"] == pytest.approx(1e-4, rel=1e-5)
    assert row["frequency_(Hz)"] == pytest.approx(1.5 * synthetic_store.FIRST_LATERAL)


def test_data_come_as_json_with_null_for_what_is_missing(run, synthetic_path):
    run("map", synthetic_path, "--data", "map.json")
    table = json.loads(Path("map.json").read_text())
    assert table["data_vars"]["peak_contact_force"]["attrs"]["units"] == "N"
    assert table["data_vars"]["peak_contact_force"]["data"][0][0] is None
    assert table["data_vars"]["peak_contact_force"]["data"][1][0] == pytest.approx(75.0)


def test_a_cascade_takes_other_axes_at_their_first_values(run, synthetic_path):
    """As a map does, and says so."""
    said = run("cascade", synthetic_path, *options(CLEARANCE, MODULUS), "--data", "lines.nc")
    assert "friction = 0.1: the first of 2; change with --select friction=VALUE" in said
    with xr.open_dataset("lines.nc") as opened:
        assert float(opened["friction"]) == 0.1


@pytest.mark.parametrize("name", ["orbit.zarr", "orbit.nc"])
def test_data_come_as_arrays(run, synthetic_path, name):
    run("orbit", synthetic_path, *ONE, "--data", name)
    opened = xr.open_zarr(name, consolidated=False) if name.endswith(".zarr") else xr.open_dataset(name)
    with opened:
        assert float(opened["horizontal"].max()) == pytest.approx(1e-4, rel=1e-3)
        assert opened["horizontal"].attrs["units"] == "m"


@pytest.mark.parametrize(
    ("name", "args", "said"),
    [
        ("orbit", ["--select", "speed_ratio=1.5"], "select one value of clearance"),
        ("orbit", ["--select", "speed_ratio"], "is not a pair; write NAME=VALUE"),
        ("orbit", [*ONE, "--data", "orbit.xls"], "unknown format; choose one of"),
        ("waveform", [*ONE, "--signal", "twist"], "twist: no such signal"),
        ("cascade", [*options(CLEARANCE, FRICTION, MODULUS), "--order-lines", "1/0"], "not a list of orders"),
        ("cascade", [*options(CLEARANCE, FRICTION, MODULUS), "--max", "1 kg"], "--max"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(run, synthetic_path, name, args, said):
    with pytest.raises(InputError) as refusal:
        run(name, synthetic_path, *args)
    assert said in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert list(Path().iterdir()) == []


def test_a_figure_needs_no_display_and_no_pyplot(synthetic_path, tmp_path):
    script = (
        "import sys; from rubhpc.cli import commands;"
        f"commands(['map', {str(synthetic_path)!r}], standalone_mode=False);"
        "assert 'matplotlib.pyplot' not in sys.modules;"
        "assert 'mpi4py' not in sys.modules; assert 'numba' not in sys.modules"
    )
    environment = {k: v for k, v in os.environ.items() if k != "DISPLAY"}
    environment["PYTHONPATH"] = str(Path(__file__).parents[2])
    subprocess.run([sys.executable, "-c", script], cwd=tmp_path, env=environment, check=True, timeout=120)


def test_the_help_of_a_figure_loads_nothing_heavy():
    script = (
        "import sys; from rubhpc.cli import commands;"
        "[commands([name, '--help'], standalone_mode=False) for name in ('cascade', 'map', 'hht')];"
        "heavy = {'numpy', 'xarray', 'matplotlib', 'dask', 'numba', 'mpi4py'} & set(sys.modules);"
        "assert not heavy, heavy"
    )
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    subprocess.run([sys.executable, "-c", script], env=environment, check=True, timeout=60)


def test_a_spectrum_needs_no_selection_of_an_axis_of_one_value(synthetic_path):
    store = select(open_store(synthetic_path), {"clearance": 84e-6, "friction": 0.3})
    store = store.isel(speed_ratio=[1], stator_youngs_modulus=[0])
    drawing = figures()["spectrum"].of(store, "vertical")
    assert drawing.lines[0].split()[:2] == ["1X", "31.560"]
