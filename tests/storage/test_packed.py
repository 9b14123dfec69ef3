"""Packed arrays as zarr stores them, whatever their chunks."""

from __future__ import annotations

import numpy as np
import pytest
import zarr
from running import array_of, stored_bytes, write_study

from rubhpc.schema import VARIABLES
from rubhpc.storage import layout
from rubhpc.storage.new_manifest import manifest_of
from rubhpc.storage.packed import read_packed, write_packed
from rubhpc.storage.store import Store
from rubhpc.study.cases import CaseGrid
from rubhpc.study.study import read_study


@pytest.mark.parametrize("most", [2**20, 5])
def test_files_are_those_that_zarr_writes(tmp_path, monkeypatch, most):
    """One chunk, or several that reach beyond the grid; a number a case, and one a stator of it."""
    monkeypatch.setattr(layout, "_PACKED_CHUNK", most)
    store = Store.create(tmp_path / "a.zarr", CaseGrid(read_study(write_study(tmp_path))))
    rng = np.random.default_rng(1)
    for name in ("status", "period", "contact_fraction"):
        variable = VARIABLES[name]
        shape = (*store.manifest.shape, *store.manifest.extent(variable))
        values = rng.integers(0, 3, shape).astype(variable.dtype)
        assert read_packed(store.path, store.manifest, variable) is None
        array_of(store.path, name)[...] = values
        by_zarr = stored_bytes(store.path)
        np.testing.assert_array_equal(read_packed(store.path, store.manifest, variable), values)
        write_packed(store.path, store.manifest, variable, values)
        assert stored_bytes(store.path) == by_zarr
        assert len([path for path in by_zarr if path.startswith(f"{name}/c/")]) == (1 if most > 5 else 4)
        chunk = next((store.path / name / "c").rglob("*"))
        chunk = chunk if chunk.is_file() else next(path for path in chunk.rglob("*") if path.is_file())
        chunk.write_bytes(chunk.read_bytes()[:-1])
        assert read_packed(store.path, store.manifest, variable) is None


def test_metadata_of_equal_arrays_are_those_that_zarr_writes(tmp_path):
    case_grid = CaseGrid(read_study(write_study(tmp_path)))
    manifest = manifest_of(case_grid)
    files = layout.skeleton(case_grid, manifest)
    group = zarr.create_group(tmp_path / "own.zarr", zarr_format=3)
    for variable in manifest.packed:
        layout._create(group, variable, manifest, chunk=layout.packed_chunk(manifest.shape))
        name = f"{variable.name}/zarr.json"
        assert (tmp_path / "own.zarr" / name).read_bytes() == files[name]
