"""Cases of a store as one file."""

import json
import sys
from functools import partial

import h5py
import numpy as np
import pandas as pd
import pytest
import synthetic_store
import xarray as xr
from printing import printed

from postproc.store.attributes import table_of
from postproc.store.open import open_store
from rubhpc.commands.export import export
from rubhpc.errors import InputError


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return partial(printed, export)


def test_whole_store_comes_back(synthetic_path, run, tmp_path):
    assert run(synthetic_path).startswith("study.h5 (")
    with xr.open_dataset("study.h5", engine="h5netcdf") as back, open_store(synthetic_path) as known:
        assert set(back.variables) == set(known.variables)
        for name in known.variables:
            np.testing.assert_array_equal(back[name], known[name])
            assert back[name].dims == known[name].dims
            assert back[name].attrs.get("units") == known[name].attrs.get("units")
        assert back.attrs["rig"] == known.attrs["rig"]
        assert table_of(back, "rig")["name"] == "mokhtar2017"
    with h5py.File("study.h5") as file:  # and without xarray
        assert file["vertical"].shape == known["vertical"].shape
        assert file["vertical"].compression == "gzip"
    assert [path.name for path in tmp_path.iterdir()] == ["study.h5"]


def test_chosen_cases_and_variables(synthetic_path, run):
    run(
        synthetic_path, "--select", "speed_ratio=1.5", "--value", "peak_contact_force", "--output", "force.nc"
    )
    with xr.open_dataset("force.nc", engine="h5netcdf") as back, open_store(synthetic_path) as known:
        assert list(back.data_vars) == ["peak_contact_force"]
        np.testing.assert_array_equal(back.peak_contact_force, known.peak_contact_force.sel(speed_ratio=1.5))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--value", "peak_contact_fore"], "did you mean peak_contact_force"),
        (["--output", "a.mat"], "unknown format"),
        (["--output", "a.json"], "unknown format; choose one of .nc, .h5, .hdf5, .csv, .parquet"),
        (["--value", "torsion", "--output", "a.csv"], "torsion: has many values a case"),
        (["--output", "nowhere/a.h5"], "no directory nowhere"),
        (["--select", "speed_ratio=77"], "speed_ratio"),
    ],
)
def test_mistakes_are_reported_and_leave_nothing(synthetic_path, run, tmp_path, words, message):
    with pytest.raises(InputError, match=message):
        run(synthetic_path, *words)
    assert not list(tmp_path.iterdir())


def test_file_that_is_there_stays_until_the_new_one_is_whole(synthetic_path, run, tmp_path, monkeypatch):
    run(synthetic_path, "--value", "period")
    before = (tmp_path / "study.h5").read_bytes()

    def fail(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(xr.Dataset, "to_netcdf", fail)
    with pytest.raises(InputError, match="No space left"):
        run(synthetic_path)
    assert (tmp_path / "study.h5").read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1


@pytest.fixture
def ring(tmp_path):
    made = synthetic_store.make(keep=("section",), n_stator=3)
    made["peak_contact_force"] = made["peak_contact_force"] * xr.DataArray([0.0, 1.0, 0.5], dims="stator")
    made["peak_contact_force"].attrs = {"units": "N", "long_name": "peak contact force"}
    synthetic_store.write(tmp_path / "ring.zarr", made)
    return made


def rows_of(made, name, **at):
    return made[name].isel(at).broadcast_like(made["status"]).values.ravel()


def test_a_table_in_csv_has_a_row_a_case_and_units_in_its_heading(ring, run):
    run("ring.zarr", "--output", "cases.csv")
    table = pd.read_csv("cases.csv")
    assert len(table) == ring["status"].size
    assert list(table.columns[:4]) == [
        "speed_ratio",
        "clearance (m)",
        "friction",
        "stator_youngs_modulus (Pa)",
    ]
    force = rows_of(ring, "peak_contact_force", stator=1)
    assert table["peak_contact_force (N)"].to_numpy() == pytest.approx(force, nan_ok=True)
    third = table["peak_contact_force_stator_3 (N)"].to_numpy()
    assert third == pytest.approx(0.5 * force, nan_ok=True)
    assert table["clearance (m)"].to_numpy() == pytest.approx(rows_of(ring, "clearance"))
    assert set(table["status"]) == {"done", "missing", "failed", "diverged"}
    assert not [name for name in table if "section" in name]


def test_a_table_in_parquet_has_units_in_its_columns(ring, run):
    from pyarrow import parquet

    run("ring.zarr", "--select", "friction=0.3", "--output", "cases.parquet")
    table = parquet.read_table("cases.parquet")
    assert table.num_rows == ring["status"].size // 2
    assert table.schema.field("peak_contact_force").metadata[b"units"] == b"N"
    assert b"largest of 3 stators" in table.schema.field("peak_contact_force").metadata[b"long_name"]
    assert json.loads(table.schema.metadata[b"rig"])["name"] == "mokhtar2017"
    assert set(table["friction"].to_pylist()) == {0.3}
    force = rows_of(ring.sel(friction=0.3), "peak_contact_force", stator=1)
    assert table["peak_contact_force"].to_pandas().to_numpy() == pytest.approx(force, nan_ok=True)
    assert table["period"].null_count == int(np.isnan(force).sum())


def test_parquet_says_what_it_needs(ring, run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InputError, match=r"cases.parquet: Parquet needs .*rubhpc\[parquet\]"):
        run("ring.zarr", "--output", "cases.parquet")
    assert [path.name for path in tmp_path.iterdir()] == ["ring.zarr"]
