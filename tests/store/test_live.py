"""A store looked at while its run is on, and what it shows of the runs."""

import json
import os
import shutil
from dataclasses import replace

import numpy as np
import pytest
import synthetic_store
import xarray as xr
from running import write_study

import rubhpc
from postproc.store.open import open_live
from rubhpc.errors import StoreError
from rubhpc.schema import DONE
from rubhpc.storage.runs import read_runs


@pytest.fixture
def store(tmp_path):
    study = replace(rubhpc.read_study(write_study(tmp_path)), output=tmp_path / "tiny.zarr")
    rubhpc.run(study, quiet=True)
    return study.output


def test_measures_come_from_the_journals_before_they_are_packed(store):
    packed = open_live(store).load()
    for name in ("status", "peak_torsion", "contact_fraction"):
        chunks = store / name / "c"
        for path in sorted(chunks.rglob("*"), reverse=True):
            path.rmdir() if path.is_dir() else path.unlink()
    assert np.isnan(rubhpc.open(store)["peak_torsion"]).all()
    (store / ".rubhpc" / "packed.json").unlink()
    now = open_live(store).load()
    assert (now["status"] == DONE).all()
    xr.testing.assert_equal(now, packed)
    assert now.encoding["source"] == str(store)


def test_what_only_the_journals_know_is_reported(store):
    reported = open_live(store).attrs
    assert reported["reasons"] == {}
    assert reported["running"] == ""
    (run,) = reported["runs"]
    assert run["n_rank"] == 1
    assert run["host"]
    assert run["processor"]
    assert 0 <= run["wrote"] - run["began"] < 120


def test_a_run_of_a_copied_store_lasted_as_long(store, tmp_path):
    copied = shutil.copytree(store, tmp_path / "copy.zarr")
    for path in copied.rglob("*"):
        os.utime(path, (4e9, 4e9))
    assert read_runs(copied) == read_runs(store)
    (record,) = (copied / ".rubhpc" / "runs").iterdir()
    record.write_text(json.dumps(json.loads(record.read_text()) | {"wrote": 0.0}))  # was killed
    assert [run.wrote for run in read_runs(copied)] == [4e9]


def test_a_second_run_that_computes_nothing_leaves_no_trace(store, tmp_path):
    rubhpc.run(tmp_path / "tiny.toml", quiet=True)
    assert [run.number for run in read_runs(store)] == [1]


def test_a_damaged_record_of_a_run_is_passed_over(store):
    (path,) = (store / ".rubhpc" / "runs").iterdir()
    settings = json.loads(path.read_text())
    path.with_name("run000002.json").write_text("{")
    path.with_name("run000003.json").write_text(json.dumps(settings | {"number": 3, "unheard": 1}))
    assert [run.number for run in read_runs(store)] == [1]


def test_a_store_without_journals_comes_as_it_is(tmp_path):
    synthetic_store.write(tmp_path / "copy.zarr", synthetic_store.make(keep=()))
    now = open_live(tmp_path / "copy.zarr")
    assert "reasons" not in now.attrs
    assert float(now["peak_contact_force"].max()) > 0


def test_no_store_is_said(tmp_path):
    with pytest.raises(StoreError, match="no such store"):
        open_live(tmp_path / "none.zarr")
