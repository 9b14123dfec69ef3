"""A measure that the schema gains later: older stores are read, verified, resumed and grown."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from typing import TYPE_CHECKING
from zlib import crc32

import numpy as np
import pytest
import xarray as xr
from running import killed_after, write_study

from postproc.store.open import open_live
from rubhpc import schema
from rubhpc.running import worker
from rubhpc.running.driver import run
from rubhpc.running.recompute import reproduce
from rubhpc.schema import Variable
from rubhpc.storage import growth, measures, new_manifest
from rubhpc.storage.manifest import PRIVATE
from rubhpc.storage.measures import added_measures, unlisted_measures
from rubhpc.storage.resume import bring_up_to_date, grid_for
from rubhpc.storage.status import read_status
from rubhpc.storage.store import Store
from rubhpc.storage.verify import verify
from rubhpc.study.study import make_axis, read_study

if TYPE_CHECKING:
    from pathlib import Path

    from rubhpc.integrate.record import Record
    from rubhpc.study.study import Study

TOYS = (
    Variable(name="toy", role="measure", dims=("stator",), unit="m", long_name="a measure added later"),
    Variable(name="toy_count", role="measure", dtype="int64", long_name="an integer added later"),
)


@pytest.fixture
def study(tmp_path: Path) -> Study:
    return read_study(write_study(tmp_path, speed_ratio=[0.9], keep='["section"]', friction=[0.1, 0.3]))


@pytest.fixture
def toys(monkeypatch: pytest.MonkeyPatch) -> None:
    """Add two measures, as a later version of the program would."""
    run_case = worker.run_case

    def with_toys(*args: object, **options: object) -> Record:
        record = run_case(*args, **options)
        record.measures.update(toy=np.array([2.5]), toy_count=5)
        return record

    for variable in TOYS:
        monkeypatch.setitem(schema.VARIABLES, variable.name, variable)
    monkeypatch.setattr(worker, "run_case", with_toys)


def longer(study: Study) -> Study:
    """The study with a friction before the others and one after them."""
    friction = make_axis("friction", [0.05, 0.1, 0.3, 0.4], study.rig)
    return replace(study, axes=(*study.axes[:-1], friction))


def as_format_3(store: Path) -> None:
    """Turn a store into one whose manifest does not list its measures."""
    for name in ("manifest.json", "manifest.copy.json"):
        path = store / PRIVATE / name
        reported = json.loads(path.read_bytes().partition(b"\n")[2])
        assert reported.pop("measures")
        assert not reported.pop("added")
        text = json.dumps(reported).encode()
        path.write_bytes(b"rubhpc 3 %08x\n%s" % (crc32(text), text))


@pytest.mark.parametrize("is_format_3", [False, True])
def test_a_store_without_a_measure_is_resumed_and_grown(study, request, capsys, monkeypatch, is_format_3):
    with monkeypatch.context() as patch:
        if is_format_3:  # with the measures of its time
            for module in (new_manifest, measures):
                patch.setattr(module, "case_measures", unlisted_measures)
        run(study, quiet=True)
    if is_format_3:
        as_format_3(study.output)
    added = [v.name for v in added_measures(unlisted_measures())] if is_format_3 else []
    added += ["toy", "toy_count"]
    before = xr.open_zarr(study.output).load()
    request.getfixturevalue("toys")
    assert "4 done" in read_status(study.output).text()
    assert not verify(study.output)
    assert "toy" not in open_live(study.output)
    assert Store(study.output).is_packed()
    capsys.readouterr()

    assert run(study).computed == 0
    said = capsys.readouterr().out
    assert said.count(f"was made before the measures {', '.join(added)} existed: its 4 cases have none") == 1
    with xr.open_zarr(study.output, consolidated=True) as store:
        assert np.isnan(store.toy).all()
        assert (store.toy.attrs["units"], store.toy.dims[-1]) == ("m", "stator")
        assert (store.toy_count == -1).all()
        assert store.load().drop_vars(added).identical(before)
    assert not verify(study.output)

    assert run(longer(study)).computed == 4
    assert "was made before" not in capsys.readouterr().out
    with xr.open_zarr(study.output, consolidated=True) as store:
        is_old = np.isin(store.friction, (0.1, 0.3))
        assert np.isnan(store.toy[:, :, is_old]).all()
        assert (store.toy[:, :, ~is_old] == 2.5).all()
        assert store.toy_count[0, 0].values.tolist() == [5, -1, -1, 5]
        for name in before.data_vars:
            now = store[name].sel(friction=[0.1, 0.3]) if "friction" in before[name].dims else store[name]
            assert now.load().identical(before[name]), name
    assert not verify(study.output)
    for flat in (0, 1):  # one case with the measure, one without it
        reported = reproduce(longer(study), Store(study.output).manifest.case_id(flat))
        assert "bit for bit" in reported.verdict


def test_older_cases_are_read_where_no_header_is_left(study, toys):
    for variable in TOYS:
        del schema.VARIABLES[variable.name]
    run(study, quiet=True)
    old = Store(study.output).replay()
    for variable in TOYS:
        schema.VARIABLES[variable.name] = variable
    run(study, quiet=True)
    for path in Store(study.output).journal_directory.iterdir():
        path.write_bytes(b"X" + path.read_bytes()[1:])
        if "growth" in path.name:
            path.unlink()
    new = Store(study.output).replay()
    assert new.skipped.total() == 1
    for name in old.measures.dtype.names:
        assert new.measures[name].tobytes() == old.measures[name].tobytes()
    assert np.isnan(new.measures["toy"]).all()


def test_a_store_with_an_unknown_measure_is_read_resumed_and_grown(study, toys, tmp_path):
    run(study, quiet=True)
    for variable in TOYS:
        del schema.VARIABLES[variable.name]
    assert not verify(study.output)
    (study.output / "toy" / "zarr.json").write_text("garbled")
    assert run(longer(study), quiet=True).computed == 4
    assert not verify(study.output)
    with xr.open_zarr(study.output, consolidated=True) as store:
        assert store.toy[0, 0].values.ravel()[1:3].tolist() == [2.5, 2.5]
        assert store.toy.attrs["long_name"] == "a measure added later"


@pytest.mark.parametrize("apart", [101, pytest.param(23, marks=pytest.mark.long)])
def test_a_kill_while_a_measure_is_added_loses_nothing(study, toys, tmp_path, monkeypatch, apart):
    """Killed at some changes of the disk: what is left is verified, and the next run adds the measure."""
    for variable in TOYS:
        del schema.VARIABLES[variable.name]
    run(study, quiet=True)
    before = xr.open_zarr(study.output).load()
    for variable in TOYS:
        schema.VARIABLES[variable.name] = variable

    monkeypatch.setattr(growth.os, "sync", lambda: None)
    is_whole, n = False, 0
    while not is_whole:
        n += apart
        copy = replace(study, output=tmp_path / f"copy{n}.zarr")
        shutil.copytree(study.output, copy.output)
        with killed_after(n):
            bring_up_to_date(Store(copy.output), grid_for(copy))
            is_whole = True
        read_status(copy.output)
        assert run(copy, quiet=True).computed == 0
        assert not verify(copy.output)
        after = xr.open_zarr(copy.output, consolidated=True).load()
        assert np.isnan(after.toy).all()
        assert after.drop_vars(["toy", "toy_count"]).identical(before)
    assert n > 2 * apart
