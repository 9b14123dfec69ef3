from __future__ import annotations

import errno
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
import xarray as xr
from running import array_of, write_study

from rubhpc import __version__
from rubhpc.errors import StoreError
from rubhpc.schema import DONE, FAILED, FINAL_STATE, MISSING, STATE, VARIABLES
from rubhpc.storage import layout
from rubhpc.storage.disk import disk_errors, write_whole
from rubhpc.storage.journal import Entry
from rubhpc.storage.resume import bring_up_to_date, differences, grid_for, open_store
from rubhpc.storage.store import Store, case_checksum
from rubhpc.study.cases import CaseGrid
from rubhpc.study.study import read_study

if TYPE_CHECKING:
    from pathlib import Path

    from rubhpc.study.study import Study


@pytest.fixture
def study(tmp_path: Path) -> Study:
    return read_study(write_study(tmp_path))


@pytest.fixture
def store(study: Study) -> Store:
    return Store.create(study.output, CaseGrid(study))


def fill(store: Store, start: tuple[int, ...]) -> dict[str, np.ndarray]:
    """Write a block of random numbers."""
    rng = np.random.default_rng(0)
    data = {
        name: rng.normal(size=values.shape).astype(values.dtype)
        for name, values in store.empty_block(start).items()
    }
    store.write_block(start, data)
    return data


def journal(store: Store, start: tuple[int, ...], data: dict[str, np.ndarray]) -> None:
    """Journal a block as done, its metrics counting up."""
    row = np.zeros((), store.manifest.header.record_type)
    with store.journal(1, f"rank{sum(start):05d}") as lines:
        for i_case, flat in enumerate(store.flat(start).tolist()):
            for name in row.dtype.names:
                row[name] = flat
            lines.write([Entry(flat, f"id{flat}", DONE, case_checksum(data, i_case), row.tobytes())])


def test_a_new_store_opens_in_xarray_without_a_warning(store, study):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ds = xr.open_zarr(store.path)
    assert set(VARIABLES) - {FINAL_STATE} <= set(ds.variables)  # that one is kept in sweeps
    for name, variable in VARIABLES.items():
        if name in ds.coords or variable.role in ("setting", STATE):
            continue
        array = ds[name]
        assert array.dims == ("speed_ratio", "clearance_ratio", "friction", *variable.dims)
        assert array.dtype == variable.dtype
        assert (array.attrs["units"], array.attrs["long_name"]) == (variable.unit, variable.long_name)
        if variable.flags:
            assert array.attrs["flag_meanings"].split() == list(variable.flags)
            assert list(array.attrs["flag_values"]) == list(range(len(variable.flags)))
    assert (ds.status == MISSING).all()
    assert ds.attrs["versions"]["rubhpc"] == __version__
    assert np.isnan(ds.vertical).all()
    for axis in study.axes:
        assert tuple(ds[axis.dimension].values) == axis.values
        assert ds[axis.dimension].attrs["units"] == axis.unit
    assert ds.revolution.dims == ("sample",)
    assert ds.revolution.values[33] == pytest.approx(33 / 32)
    assert ds.order.values[:3].tolist() == [0, 0.5, 1]
    assert ds.spin_speed.dims == ("speed_ratio",)
    assert ds.attrs["identity"] == CaseGrid(study).identity
    assert ds.attrs["rig"]["name"] == "mokhtar2017"
    assert ds.attrs["study"]["record"]["revolutions"] == 2


def test_only_what_is_kept_has_arrays(tmp_path):
    study = read_study(write_study(tmp_path, keep='["section"]'))
    ds = xr.open_zarr(Store.create(study.output, CaseGrid(study)).path)
    roles = {VARIABLES[str(name)].role for name in ds.data_vars if name in VARIABLES}
    assert roles == {"section", "measure", "setting", "flag"}
    assert "revolution" in ds.coords  # though nothing here lies along it


def test_a_chunk_is_written_as_zarr_writes_it(store):
    """Blocks are encoded without zarr, which takes three times as long; the files have to be the same."""
    for start in ((0, 1, 0), (1, 0, 2)):  # the latter at the edge
        data = fill(store, start)
        ours = [path.read_bytes() for path in store.chunk_files(start)]
        for path in store.chunk_files(start):
            path.unlink()
        for name, values in data.items():
            window = store.window(start)
            array_of(store.path, name)[window] = values.reshape(1, 1, -1, *values.shape[1:])
        assert [path.read_bytes() for path in store.chunk_files(start)] == ours


def test_metrics_are_packed_from_the_journals(store):
    for start in ((0, 0, 0), (1, 1, 2)):
        journal(store, start, fill(store, start))
    with store.journal(2, "rank00000") as lines:
        lines.write([Entry(3, "x", FAILED, reason="why")])
    store.pack(store.replay())
    ds = xr.open_zarr(store.path)
    assert ds.status.values.ravel()[[0, 1, 2, 3, 11]].tolist() == [DONE, DONE, MISSING, FAILED, DONE]
    assert ds.period.values.ravel()[[1, 2, 3, 11]].tolist() == [1, -1, -1, 11]
    assert ds.contact_fraction.values[1, 1, 2, 0] == 11
    assert np.isnan(ds.peak_torsion.values.ravel()[3])


def test_a_store_is_packed_again_only_when_there_is_news(store):
    journal(store, (0, 0, 0), fill(store, (0, 0, 0)))
    store.pack(store.replay())
    array_of(store.path, "steps")[0, 0, 0] = 77
    store.pack(store.replay())
    assert array_of(store.path, "steps")[0, 0, 0] == 77
    journal(store, (1, 0, 0), fill(store, (1, 0, 0)))
    store.pack(store.replay())
    assert array_of(store.path, "steps")[0, 0, 0] == 0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"transient": 5}, "record.transient was 1, is 5"),
        ({"speed_ratio": [0.9]}, "axis speed_ratio lacks 2, which is stored"),
        ({"keep": '["waveform"]'}, "record.keep"),
        (
            {"contact": 'normal = "updated"\nfriction_law = "sliding"'},
            'contact.normal was "fixed", is "updated"',
        ),
        ({"run": '[override]\n"stator.length" = "50 mm"'}, "rig.stator.1.length was 0.04, is 0.05"),
        ({"run": '[override]\n"rotor.damping.alpha" = 30'}, "rig.rotor.damping.alpha was 31.7, is 30"),
    ],
)
def test_another_study_is_refused_with_the_differences(tmp_path, store, changes, message):
    with pytest.raises(StoreError) as refused:
        grid_for(read_study(write_study(tmp_path, "other.toml", **changes)))
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)
    assert "--output" in str(refused.value)


def test_the_same_change_of_all_stators_of_a_ring_is_one_difference(store):
    def ring(length):
        return replace(store.manifest, parts={"rig": {"stator": [{"length": length, "node": 8}] * 8}})

    assert differences(ring(0.03), ring(0.04)) == ["rig.stator.*.length (8 of them) was 0.03, is 0.04"]


def test_differences_of_another_rig_are_few(store):
    def shaft(value):
        return replace(
            store.manifest, parts={"physics": 1, "rig": {"rotor": {f"key{i}": value for i in range(9)}}}
        )

    found = differences(shaft(1), shaft(2))
    assert found == [*(f"rig.rotor.key{i} was 1, is 2" for i in range(3)), "6 more of rig.rotor"]


def test_lost_values_of_an_axis_are_written_as_a_study_file_may_state_them(store):
    def over(*speeds):
        axis = replace(store.manifest.axes[0], name="speed", dimension="speed", unit="rad s-1", values=speeds)
        return replace(store.manifest, axes=(axis,))

    found = differences(over(40 * np.pi, 50 * np.pi), over(40 * np.pi))
    assert found[0] == "axis speed lacks 1500 rpm, which is stored"


def test_what_changes_no_result_is_no_difference(tmp_path, store):
    other = read_study(write_study(tmp_path, "other.toml", block=5, run='time_limit = "1 h"'))
    assert grid_for(other).chunk == store.manifest.chunk


@pytest.mark.parametrize("where", ["", "thesis.tex"])
def test_something_else_in_its_place_is_left_alone(study, where):
    kept = study.output / where
    kept.parent.mkdir(exist_ok=True)
    kept.write_text("x")
    for opened in (lambda: open_store(CaseGrid(study)), lambda: Store(study.output)):
        with pytest.raises(StoreError, match="not a rubhpc store"):
            opened()
    assert kept.read_text() == "x"


def test_an_empty_directory_may_become_the_store(study):
    study.output.mkdir()
    assert open_store(CaseGrid(study)).manifest.n_case == 12


def test_a_creation_that_fails_leaves_nothing(study, monkeypatch):
    def fail(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(layout, "write_whole", fail)
    before = set(study.output.parent.iterdir())
    with pytest.raises(StoreError, match="the disk is full"):
        open_store(CaseGrid(study))
    assert set(study.output.parent.iterdir()) == before


@pytest.mark.parametrize("container", ["", ".elsewhere"])
def test_the_draft_of_a_killed_creation_is_removed_but_for_that_of_another_container(study, container):
    import socket

    name = f".tiny.zarr.{socket.gethostname()}{container}.{2**22 + 1}.draft"  # past any pid
    draft = study.output.with_name(name)
    draft.mkdir()
    open_store(CaseGrid(study))
    assert draft.exists() == bool(container)


def test_a_draft_is_removed_by_the_next_run_though_the_store_is_there(study, store):
    """Its process may be a zombie, or its number in use again, when the store is made by another."""
    import os
    import socket

    drafts = [
        study.output.with_name(f".tiny.zarr.{socket.gethostname()}.{pid}.draft")
        for pid in (os.getpid(), 2**22 + 1)
    ]
    for draft in drafts:
        draft.mkdir()
        (draft / "zarr.json").write_text("{}")
    bring_up_to_date(store, CaseGrid(study))
    assert not any(draft.exists() for draft in drafts)


def change_byte(path: Path, at: int) -> None:
    data = bytearray(path.read_bytes())
    data[at % len(data)] ^= 0x20
    path.write_bytes(data)


@pytest.mark.parametrize("at", [0, 8, 12, 30, 400, -2])
def test_one_damaged_manifest_costs_nothing(study, store, at):
    whole = {name: (store.private / name).read_bytes() for name in ("manifest.json", "manifest.copy.json")}
    for name in whole:
        change_byte(store.private / name, at)
        again = Store(store.path)
        assert again.manifest == store.manifest
        assert again.manifest.damaged_copies(store.path) == [name]
        bring_up_to_date(again, CaseGrid(study))
        assert {name: (store.private / name).read_bytes() for name in whole} == whole


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"format": 99}', "rubhpc 99 00000000\n{}"])
def test_a_manifest_that_is_damaged_twice_is_reported_in_a_line(store, text):
    for name in ("manifest.json", "manifest.copy.json"):
        (store.private / name).write_text(text)
    with pytest.raises(StoreError) as reported:
        Store(store.path)
    assert "\n" not in str(reported.value)
    assert "--output" in str(reported.value)


@pytest.mark.parametrize(
    "name", ["zarr.json", "vertical/zarr.json", "status/zarr.json", "friction/zarr.json"]
)
@pytest.mark.parametrize("text", ["", "{", None])
def test_damaged_metadata_are_written_anew(study, store, name, text):
    data = fill(store, (0, 0, 0))
    whole = (store.path / name).read_bytes()
    if text is None:
        (store.path / name).unlink()
    else:
        (store.path / name).write_text(text)
    damaged = Store(store.path)
    assert damaged.damaged_files() == [name]
    bring_up_to_date(damaged, CaseGrid(study))
    assert (store.path / name).read_bytes() == whole
    np.testing.assert_array_equal(xr.open_zarr(store.path).vertical.values[0, 0, :2], data["vertical"])


@pytest.mark.parametrize(
    ("number", "fix"),
    [
        (errno.ENOSPC, "free some space"),
        (errno.EROFS, "--output"),
        (errno.EACCES, "--output"),
        (errno.EDQUOT, "quota"),
    ],
)
def test_errors_of_the_disk_name_the_fix(tmp_path, number, fix):
    with pytest.raises(StoreError, match=fix) as reported, disk_errors(tmp_path):
        raise OSError(number, "whatever")
    assert reported.value.exit_code == 3


def test_a_file_written_whole_replaces_the_old_one_or_leaves_it(tmp_path, monkeypatch):
    path = tmp_path / "file"
    write_whole(path, b"old")

    def fail(handle: int) -> None:
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr("rubhpc.storage.disk.os.fsync", fail)
    with pytest.raises(OSError, match="Input/output"):
        write_whole(path, b"new")
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_a_file_on_the_way_to_a_store_is_reported_with_the_fix(tmp_path):
    (tmp_path / "taken").write_text("mine")
    store = tmp_path / "taken" / "study.zarr"
    with pytest.raises(StoreError, match="--output"), disk_errors(store):
        store.mkdir(parents=True)
    with pytest.raises(StoreError, match="a file of that name exists"), disk_errors(store):
        store.parent.mkdir(parents=True)
    assert (tmp_path / "taken").read_text() == "mine"
