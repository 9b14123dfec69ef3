"""Cases of a store as one HDF5 file."""

import json

import h5py
import numpy as np
import pytest
import xarray as xr
from click.testing import CliRunner

from postproc.store.open import open_store
from rubhpc.commands.export import export
from rubhpc.errors import InputError


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return lambda *words: (
        CliRunner().invoke(export, [str(word) for word in words], catch_exceptions=False).output
    )


def test_whole_store_comes_back(synthetic_path, run, tmp_path):
    assert run(synthetic_path).startswith("study.h5 (")
    with xr.open_dataset("study.h5", engine="h5netcdf") as back, open_store(synthetic_path) as known:
        assert set(back.variables) == set(known.variables)
        for name in known.variables:
            np.testing.assert_array_equal(back[name], known[name])
            assert back[name].dims == known[name].dims
            assert back[name].attrs.get("units") == known[name].attrs.get("units")
        assert json.loads(back.attrs["rig"]) == known.attrs["rig"]
    with h5py.File("study.h5") as file:  # and without xarray
        assert file["vertical"].shape == known["vertical"].shape
    assert [path.name for path in tmp_path.iterdir()] == ["study.h5"]


def test_chosen_cases_and_variables(synthetic_path, run):
    run(
        synthetic_path, "--select", "speed_ratio=1.5", "--value", "peak_contact_force", "--output", "force.nc"
    )
    with xr.open_dataset("force.nc", engine="h5netcdf") as back, open_store(synthetic_path) as known:
        assert list(back.data_vars) == ["peak_contact_force"]
        np.testing.assert_array_equal(back.peak_contact_force, known.peak_contact_force.sel(speed_ratio=1.5))


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--value", "peak_contact_fore"], "did you mean peak_contact_force"),
        (["--output", "a.mat"], "unknown format"),
        (["--output", "a.csv"], "an export is HDF5; name it a.h5"),
        (["--output", "nowhere/a.h5"], "no directory nowhere"),
        (["--select", "speed_ratio=77"], "speed_ratio"),
    ],
)
def test_mistakes_are_told_and_leave_nothing(synthetic_path, run, tmp_path, words, told):
    with pytest.raises(InputError, match=told):
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
