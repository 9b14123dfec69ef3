"""A store grows by values anywhere on its axes, in any order; a kill at any moment loses nothing."""

from __future__ import annotations

import math
import tempfile
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from running import array_of, killed_after, shards, write_study

from rubhpc.errors import StoreError
from rubhpc.schema import DIVERGED, DONE, FAILED, MISSING
from rubhpc.storage.journal import Entry, next_run
from rubhpc.storage.regular_files import RegularFiles
from rubhpc.storage.resume import bring_up_to_date, grid_for, open_store
from rubhpc.storage.store import Store, case_checksum
from rubhpc.storage.verify import verify
from rubhpc.study import identity
from rubhpc.study.study import Run, Study, make_axis, read_study

AXES = {
    "speed_ratio": [0.9, 1.5, 2.0, 2.5],
    "clearance_ratio": [0.6, 0.7, 0.8],
    "friction": [0.1, 0.2, 0.3, 0.4, 0.5],
}


def make_study(folder: Path, grid: dict[str, list[float]], block: int = 4) -> Study:
    base = read_study(write_study(folder, keep='["section"]'))
    axes = tuple(make_axis(name, values, base.rig) for name, values in grid.items())
    return replace(base, axes=axes, run=Run(block=block))


def numbers(point: list[float], name: str, extent: tuple[int, ...]) -> np.ndarray:
    """What the stand-in for the physics gives: numbers that show their case and array."""
    return np.full(extent, math.fsum(p * 10**i for i, p in enumerate(point)) + len(name))


def outcome(point: list[float]) -> int:
    """Some cases fail, some diverge, some are left for later."""
    return (DONE, DONE, DONE, FAILED, DIVERGED, MISSING)[round(100 * math.fsum(point)) % 6]


def compute(store: Store, *, all_of_it: bool = False) -> int:
    """Compute what is missing as a run does; how many cases that were."""
    ledger = store.replay()
    n_case = 0
    with store.journal(next_run(store.journal_directory), "rank00000") as journal:
        for start in store.blocks():
            flat = store.flat(start)
            data = store.empty_block(start)
            stored = store.read_block(start)
            for i_case in np.flatnonzero(np.isin(ledger.status[flat], (DONE, DIVERGED))).tolist():
                assert stored is not None
                assert case_checksum(stored, i_case) == ledger.checksum[flat[i_case]]
                for name, values in stored.items():
                    data[name][i_case] = values[i_case]
            entries = []
            for i_case in np.flatnonzero(ledger.status[flat] == MISSING).tolist():
                point = store.manifest.points.at_flat(int(flat[i_case]))
                status = DONE if all_of_it else outcome(point)
                if status == MISSING:
                    continue
                row = np.zeros((), store.manifest.header.record_type)
                row["steps"] = round(1000 * math.fsum(point))
                if status == DONE:
                    for name, values in data.items():
                        values[i_case] = numbers(point, name, values.shape[1:])
                check = case_checksum(data, i_case) if status != FAILED else 0
                packed = row.tobytes() if status != FAILED else b""
                name = store.manifest.case_id(int(flat[i_case]))
                entries.append(
                    Entry(int(flat[i_case]), name, status, check, packed, "why" * (status != DONE))
                )
            if entries:
                store.write_block(start, data)
                journal.write(entries)
                n_case += len(entries)
    store.pack(store.replay())
    store.block_files.pack()
    return n_case


def known(store: Store) -> dict[tuple[float, ...], tuple[Any, ...]]:
    """What is known of each case, by its coordinates."""
    ledger = store.replay()
    return {
        tuple(store.manifest.points.at_flat(flat)): (
            int(ledger.status[flat]),
            int(ledger.checksum[flat]),
            ledger.measures[flat].tobytes(),
            ledger.reasons.get(flat),
        )
        for flat in np.flatnonzero(ledger.is_known & (ledger.status != MISSING)).tolist()
    }


def check_arrays(study: Study) -> None:
    """Every stored number stands where its coordinates say, and readers see the study's own axes."""
    dataset = xr.open_zarr(RegularFiles(study.output)).load()
    for axis in study.axes:
        assert tuple(dataset[axis.dimension].values) == axis.values
        assert dataset.attrs["study"]["grid"][axis.name]["values"] == list(axis.values)
    assert dataset.spin_speed.shape == (len(study.axes[0].values),)
    for index in np.ndindex(dataset.status.shape):
        point = [axis.values[i] for axis, i in zip(study.axes, index, strict=True)]
        status = int(dataset.status.values[index])
        assert dataset.steps.values[index] == (
            round(1000 * math.fsum(point)) if status in (DONE, DIVERGED) else -1
        )
        for name in ("section_vertical", "section_torsion"):
            values = dataset[name].values[index]
            expected = numbers(point, name, values.shape) if status == DONE else np.full(values.shape, np.nan)
            np.testing.assert_array_equal(values, expected)


@st.composite
def growths(draw: st.DrawFn) -> list[dict[str, list[float]]]:
    """A grid and two that it grows to: values come anywhere, and the order changes."""
    grids: list[dict[str, list[float]]] = []
    held = {name: draw(st.integers(1, 2)) for name in AXES}
    for _ in range(3):
        grids.append({})
        for name, values in AXES.items():
            before = grids[-2][name] if len(grids) > 1 else []
            more = [v for v in draw(st.permutations(values)) if v not in before][: held[name] - len(before)]
            grids[-1][name] = draw(st.permutations(before + more))
        held = {name: min(n + draw(st.integers(0, 2)), len(AXES[name])) for name, n in held.items()}
    return grids


@pytest.mark.timeout(3600)
@pytest.mark.parametrize(("n_example", "most_kills"), [(2, 2), pytest.param(60, 4, marks=pytest.mark.long)])
def test_growth_in_any_order_keeps_every_case_though_it_is_killed(n_example, most_kills):
    @settings(max_examples=n_example, phases=[Phase.generate])
    @given(
        grids=growths(),
        block=st.integers(1, 7),
        kills=st.lists(st.integers(0, 130), max_size=most_kills),
        is_sharded=st.booleans(),
    )
    def grow(grids, block, kills, is_sharded):
        with shards() if is_sharded else nullcontext():
            grow_and_kill(grids, block, kills)

    grow()


def grow_and_kill(grids: list[dict[str, list[float]]], block: int, kills: list[int]) -> None:
    """Grow a store through grids, killed after so many changes of the disk, and compare all of it."""
    with tempfile.TemporaryDirectory() as folder:
        study = make_study(Path(folder), grids[0], block)
        compute(open_store(grid_for(study)))
        for grid in grids[1:]:
            before = known(Store(study.output))
            study = make_study(Path(folder), grid, block)
            for n_call in kills:
                with killed_after(n_call):
                    store = open_store(grid_for(study))
                    bring_up_to_date(store, grid_for(study))
                assert known(Store(study.output)) == before
            store = open_store(grid_for(study))
            bring_up_to_date(store, grid_for(study))
            assert known(store) == before
            assert not verify(study.output).cases
            store.pack(store.replay())
            check_arrays(study)
            compute(store)
            assert not verify(study.output)
            check_arrays(study)
        store = Store(study.output)
        n_missing = int((store.replay().status == MISSING).sum())
        assert compute(store, all_of_it=True) == n_missing
        assert not verify(study.output)


@pytest.mark.parametrize("apart", [23, pytest.param(1, marks=pytest.mark.long)])
@pytest.mark.parametrize("layout", [nullcontext, shards])
def test_a_kill_at_any_step_of_a_growth_loses_nothing(tmp_path, layout, apart):
    """Without draws: the process ends before the first, the 24th, ... change of the disk, or each one."""
    with layout():
        kill_at_steps(tmp_path, apart)


def kill_at_steps(tmp_path: Path, apart: int) -> None:
    grid = {"speed_ratio": [0.9, 2.0], "clearance_ratio": [0.7], "friction": [0.1, 0.3, 0.5]}
    first = make_study(tmp_path, grid)
    compute(open_store(grid_for(first)), all_of_it=True)
    before = known(Store(first.output))
    study = make_study(tmp_path, {**grid, "speed_ratio": [2.0, 1.5, 0.9], "friction": [0.2, 0.5, 0.3, 0.1]})
    n_call = 0
    while Store(first.output).manifest.shape != (3, 1, 4) or (first.output / ".rubhpc" / "growth").exists():
        with killed_after(n_call):
            bring_up_to_date(open_store(grid_for(study)), grid_for(study))
        assert known(Store(first.output)) == before
        n_call += apart
    print(f"\na growth killed at {n_call // apart} places lost nothing")
    bring_up_to_date(Store(first.output), grid_for(study))
    assert compute(Store(first.output), all_of_it=True) == 6
    check_arrays(study)


def test_a_growth_at_the_ends_leaves_the_blocks_where_they_are(tmp_path):
    study = make_study(tmp_path, {"speed_ratio": [0.9], "clearance_ratio": [0.7], "friction": [0.1, 0.2]}, 1)
    store = open_store(grid_for(study))
    compute(store, all_of_it=True)
    files = {path: path.stat().st_ino for start in store.blocks() for path in store.chunk_files(start)}
    longer = make_study(
        tmp_path, {"speed_ratio": [0.9, 1.5], "clearance_ratio": [0.7], "friction": [0.1, 0.2, 0.3]}, 1
    )
    bring_up_to_date(store, grid_for(longer))
    assert {path: path.stat().st_ino for path in files} == files


def test_a_damaged_case_is_left_behind(tmp_path):
    """A block that moves is written again: what no longer matches its checksum must not get a new one."""
    grid = {"speed_ratio": [0.9], "clearance_ratio": [0.7], "friction": [0.1, 0.2]}
    store = open_store(grid_for(make_study(tmp_path, grid)))
    compute(store, all_of_it=True)
    array_of(store.path, "section_torsion")[0, 0, 1, 0] = 99.0
    study = make_study(tmp_path, {**grid, "friction": [0.05, 0.2, 0.1]})
    bring_up_to_date(store, grid_for(study))
    assert store.replay().status.tolist() == [MISSING, MISSING, DONE]
    assert compute(store, all_of_it=True) == 2


def test_a_disk_that_fills_up_during_growth_leaves_the_store_as_it_was(tmp_path, monkeypatch):
    grid = {"speed_ratio": [0.9], "clearance_ratio": [0.7], "friction": [0.1, 0.2]}
    first = make_study(tmp_path, grid)
    store = open_store(grid_for(first))
    compute(store, all_of_it=True)
    before = known(store)
    write_block = Store.write_block

    def fill_up(self: Store, *arguments: Any) -> None:
        write_block(self, *arguments)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Store, "write_block", fill_up)
    study = make_study(tmp_path, {**grid, "friction": [0.05, 0.2, 0.1]})
    with pytest.raises(StoreError, match="the disk is full"):
        bring_up_to_date(store, grid_for(study))
    assert not list(store.private.glob("growth*"))
    assert known(Store(first.output)) == before
    assert not verify(first.output)
    bring_up_to_date(Store(first.output), grid_for(first))  # the study as it was goes on as well


def test_values_that_are_gone_are_refused_by_name(tmp_path):
    grid = {"speed_ratio": [0.9], "clearance_ratio": [0.7], "friction": [0.1, 0.2, 0.3, 0.4, 0.5]}
    open_store(grid_for(make_study(tmp_path, grid)))
    with pytest.raises(StoreError, match=r"axis friction lacks 0.1, 0.2, 0.4 and 1 more, which is stored"):
        grid_for(make_study(tmp_path, {**grid, "friction": [0.3]}))


def test_another_version_of_the_physics_is_refused_unless_it_is_accepted(tmp_path, monkeypatch):
    grid = {"speed_ratio": [0.9], "clearance_ratio": [0.7], "friction": [0.1, 0.2]}
    study = make_study(tmp_path, grid)
    store = open_store(grid_for(study))
    compute(store, all_of_it=True)
    before = known(store)
    old = identity.PHYSICS
    monkeypatch.setattr(identity, "PHYSICS", identity.PHYSICS + 1)
    reported = f"physics was {old}, is {old + 1}"
    with pytest.raises(StoreError, match=f"{reported}; --accept-version keeps its cases"):
        grid_for(study)
    changed = make_study(tmp_path, {**grid, "friction": [0.1]})
    with pytest.raises(StoreError, match=f"{reported}; axis friction lacks 0.2, .*choose another"):
        grid_for(changed, accept_version=True)
    bring_up_to_date(store, grid_for(study, accept_version=True), accept_version=True)
    assert known(Store(study.output)) == before
    assert compute(store) == 0
    assert xr.open_zarr(study.output).attrs["accepted_physics"] == [old]
    assert grid_for(study).identity == Store(study.output).manifest.identity
