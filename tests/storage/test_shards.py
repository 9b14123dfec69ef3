"""Large stores are packed into shards: no reader, damage or kill makes a difference to their cases."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from running import killed_after, shards, stored_bytes, write_study

import rubhpc
from postproc.cases.reduction import open_in_pieces
from rubhpc.errors import StoppedEarly
from rubhpc.running.driver import run as run_study
from rubhpc.running.plan import make_plan
from rubhpc.running.stopping import Stopping
from rubhpc.schema import STATE, VARIABLES
from rubhpc.storage.new_manifest import shard_of
from rubhpc.storage.store import Store
from rubhpc.storage.verify import verify
from rubhpc.study.study import read_study


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with a file for each block."""
    study = write_study(tmp_path_factory.mktemp("plain"))
    run_study(study, quiet=True)
    return study.with_name("tiny.zarr")


@pytest.fixture(scope="module")
def packed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same in shards."""
    study = write_study(tmp_path_factory.mktemp("packed"))
    with shards():
        run_study(study, quiet=True)
    return study.with_name("tiny.zarr")


@pytest.fixture
def store(packed: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(packed, tmp_path / "tiny.zarr"))


def rerun(store: Path, packed: Path) -> int:
    """Run the study again on a store; how many cases it computed until all was as before."""
    summary = run_study(packed.with_name("tiny.toml"), output=store, quiet=True)
    assert summary.counts == (0, 12, 0, 0, 0)
    assert stored_bytes(store) == stored_bytes(packed)
    assert not (store / ".rubhpc" / "blocks").exists()
    assert not verify(store)
    return summary.computed


def arrays(dataset: xr.Dataset) -> dict[str, Any]:
    return {str(n): v.values for n, v in dataset.variables.items() if n != "wall_time"}


def unpack(store: Path, every: int = 1) -> Store:
    """Put blocks back in files of their own, as while a run is on: all, or every second one."""
    opened = Store(store)
    files = opened.block_files
    blocks = [(start, opened.read_block(start)) for start in opened.blocks()]
    if every == 1:
        for variable in opened.manifest.variables:
            for shard in (store / variable.name).glob("c.*"):
                shard.unlink()
    for start, data in blocks[::every]:
        opened.write_block(start, data)
    assert files.folder.is_dir()
    return opened


def test_every_reader_finds_the_same_cases_as_without_shards(plain, packed):
    assert Store(packed).manifest.shard == (1, 2, 4)
    expected = arrays(xr.open_zarr(plain))
    for dataset in (xr.open_zarr(packed), rubhpc.open(packed), open_in_pieces(packed)):
        found = arrays(dataset)
        assert found.keys() == expected.keys()
        for name, values in found.items():
            np.testing.assert_array_equal(values, expected[name], err_msg=name)
    assert not verify(packed)


def test_there_are_as_many_files_as_planned(packed):
    plan = make_plan(read_study(packed.with_name("tiny.toml")))
    files = [path for path in packed.rglob("*") if path.is_file()]
    assert len(files) == pytest.approx(plan.n_file, rel=0.1)
    assert plan.n_file_running > plan.n_file
    assert f"{plan.n_file} files, up to {plan.n_file_running} before a run packs them" in plan.text()


@pytest.mark.parametrize(
    ("shape", "chunk"),
    [
        ((100, 50, 20), (1, 1, 16)),
        ((100_000,), (16,)),
        ((20, 100_000), (1, 16)),
        ((10, 10, 10, 10, 10), (1, 1, 1, 1, 10)),
        ((2, 50_000), (2, 1)),
        ((300, 1, 3, 111), (1, 1, 1, 1)),
        ((257,), (1,)),
    ],
)
def test_large_grids_have_few_shards_of_whole_blocks(shape, chunk):
    shard = shard_of(shape, chunk)
    assert all(s % c == 0 for s, c in zip(shard, chunk, strict=True))
    n_shard = np.prod([-(-n // s) for n, s in zip(shape, shard, strict=True)])
    assert 16 <= n_shard <= 48  # enough for the ranks that pack them
    n_array = sum(v.role in ("waveform", "spectrum", "section", STATE) for v in VARIABLES.values())
    assert n_shard * n_array + 100 < 1000


def test_small_grids_have_none():
    assert shard_of((16, 16), (1, 1)) == ()


@pytest.mark.parametrize("every", [1, 2])
def test_blocks_that_are_not_packed_are_read_all_the_same(store, packed, every):
    opened = unpack(store, every)
    expected = arrays(xr.open_zarr(packed))
    for dataset in (rubhpc.open(store), open_in_pieces(store)):
        for name, values in arrays(dataset).items():
            np.testing.assert_array_equal(values, expected[name], err_msg=name)
        one = dataset["vertical"][1, 0, 2].values  # a part of a shard
        np.testing.assert_array_equal(one, expected["vertical"][1, 0, 2])
    assert np.isnan(xr.open_zarr(store)["vertical"]).all() == (every == 1)
    assert not verify(store)
    lazy = rubhpc.open(store)["torsion"]
    lazy[0, 0, 0].load()
    opened.block_files.pack()
    np.testing.assert_array_equal(lazy.values, expected["torsion"])
    assert stored_bytes(store) == stored_bytes(packed)


def test_a_part_of_the_shards_is_packed_by_each_rank(store, packed):
    files = unpack(store).block_files
    files.pack(1, 3)
    assert files.folder.is_dir()
    files.pack(least=99)
    assert files.folder.is_dir()
    for part in (0, 2):
        files.pack(part, 3)
    assert not files.folder.exists()
    assert stored_bytes(store) == stored_bytes(packed)


def test_a_kill_at_any_step_of_packing_loses_nothing(store, packed):
    files = unpack(store, 2).block_files
    n_call = 0
    while files.folder.exists():
        with killed_after(n_call):
            files.pack()
        assert not verify(store)
        n_call += 7
    assert n_call > 7
    assert rerun(store, packed) == 0


@pytest.mark.parametrize("at", [3, -1, -30])
def test_a_changed_byte_costs_the_cases_that_verify_names(store, packed, at):
    """Of a chunk in the shard, of the checksum of the index, or of the index."""
    path = store / "vertical" / "c.1.0.0.0"
    data = bytearray(path.read_bytes())
    data[at] ^= 0x10
    path.write_bytes(data)
    damage = verify(store)
    assert 0 < len(damage.cases) <= 6
    assert rerun(store, packed) == len(damage.cases)


@pytest.mark.parametrize("left", [0, 100, None])
def test_a_run_repairs_a_lost_or_truncated_shard_by_itself(store, packed, left):
    path = store / "torsion" / "c.0.0.0.0"
    if left is None:
        path.unlink()
    else:
        path.write_bytes(path.read_bytes()[:left])
    assert 0 < rerun(store, packed) <= 6


def test_a_shard_that_was_written_twice_is_named_and_written_anew(store, packed):
    """Its index lies at its end, so that readers find all cases in it."""
    shard = next((store / "vertical").glob("c.*"))
    shard.write_bytes(2 * shard.read_bytes())
    damage = verify(store)
    assert damage.arrays == ("vertical (a shard with bytes that belong to no case)",)
    assert not damage.cases
    assert rerun(store, packed) == 0


@pytest.mark.parametrize("content", [b'{"run": 1}', b"rubhpc 99 00000000\n{}"])
def test_a_copy_of_the_manifest_with_other_content_is_named_and_repaired(store, packed, content):
    """It looks as if another version had written it."""
    copy = store / ".rubhpc" / "manifest.copy.json"
    copy.write_bytes(content)
    assert verify(store).arrays == (copy.name,)
    assert rerun(store, packed) == 0


def test_a_stopped_run_leaves_blocks_that_the_next_one_packs(store, packed, tmp_path):
    class Soon(Stopping):
        """Stops after the second block."""

        def look(self) -> str:
            if len(list((tmp_path / "new.zarr").glob(".rubhpc/blocks/vertical/*"))) > 1:
                self.ask("the test")
            return self.reason

    study = packed.with_name("tiny.toml")
    with shards(), pytest.raises(StoppedEarly):
        run_study(study, output=tmp_path / "new.zarr", quiet=True, stopping=Soon())
    new = tmp_path / "new.zarr"
    assert (new / ".rubhpc" / "blocks").is_dir()
    assert not verify(new)
    assert 0 < rerun(new, packed) < 12


def test_a_store_keeps_its_layout(plain, tmp_path):
    """Stores made before there were shards, or when they were small, have none."""
    store = Path(shutil.copytree(plain, tmp_path / "tiny.zarr"))
    (store / "vertical" / "c" / "1" / "0" / "0" / "0").unlink()
    with shards():
        longer = write_study(tmp_path, friction=[0.1, 0.2, 0.3, 0.5])
        assert run_study(longer, quiet=True).computed == 6
    assert Store(store).manifest.shard == ()
    assert not (store / ".rubhpc" / "blocks").exists()
    assert not verify(store)
