"""Stores that anybody may have made: nothing in them is run, and what they state is not believed."""

from __future__ import annotations

import json
import os
import pickle
import shutil
from typing import TYPE_CHECKING

import numpy as np
import pytest
import xarray as xr
from numcodecs.zstd import Zstd

from postproc.store.open import open_store
from rubhpc.errors import InputError, StoreError
from rubhpc.study.state_of_case import read_state

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from typing import Any


@pytest.fixture
def store(synthetic_path, tmp_path):
    return shutil.copytree(synthetic_path, tmp_path / "foreign.zarr")


def change(store: Path, name: str, edit: Callable[[dict[str, Any]], object]) -> None:
    """Change the metadata of an array, or ("") of the group, wherever they are."""
    own, whole = store / name / "zarr.json", store / "zarr.json"
    metadata = json.loads(own.read_text())
    edit(metadata)
    own.write_text(json.dumps(metadata))
    group = json.loads(whole.read_text())
    if name and group.get("consolidated_metadata"):
        group["consolidated_metadata"]["metadata"][name] = metadata
        whole.write_text(json.dumps(group))


class Touch:
    """Makes a file when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, (str(self.path),)


def test_pickles_of_format_2_are_not_there(tmp_path):
    store, trace = tmp_path / "old.zarr", tmp_path / "trace"
    array = {"zarr_format": 2, "shape": [2], "chunks": [2], "dtype": "|O", "compressor": None, "order": "C"}
    array |= {"fill_value": None, "filters": [{"id": "pickle", "protocol": 4}]}
    dims = {"_ARRAY_DIMENSIONS": ["case"]}
    for name in ("status", "case", "rig"):
        (store / name).mkdir(parents=True)
        (store / name / ".zarray").write_text(json.dumps(array))
        (store / name / ".zattrs").write_text(json.dumps(dims))
        (store / name / "0").write_bytes(pickle.dumps([Touch(trace), [2]]))
    (store / ".zgroup").write_text(json.dumps({"zarr_format": 2}))
    (store / ".zattrs").write_text(json.dumps({"rig": {}, "study": {}}))
    with pytest.raises(StoreError, match="cannot be read as a zarr store"):
        open_store(store)
    with pytest.raises(InputError, match="is not a store of a study"):
        read_state(str(store), [])
    assert not trace.exists()


CODEC = {"name": "bytes", "configuration": {"endian": "little"}}


@pytest.mark.parametrize(
    ("name", "key", "value", "says"),
    [
        ("status", "codecs", [{"name": "numcodecs.pickle", "configuration": {}}], "codecs numcodecs.pickle"),
        ("status", "codecs", [CODEC, {"name": "gzip", "configuration": {"level": 1}}], "codecs bytes, gzip"),
        ("status", "codecs", [], ""),
        ("status", "data_type", "string", "no numbers"),
        ("status", "data_type", {"name": "struct", "configuration": {"fields": []}}, ""),
        ("stator", "shape", [10**7], "too many chunks"),
        ("stator", "shape", [2**70], "lengths that are no numbers"),
        ("stator", "shape", [-1], "lengths that are no numbers"),
        ("stator", "chunk_grid", {"name": "other"}, "unequal"),
        ("status", "dimension_names", ["\x1b[31m"] * 4, "not named"),
    ],
)
def test_what_no_store_holds_is_refused(store, name, key, value, says):
    change(store, name, lambda metadata: metadata.update({key: value}))
    with pytest.raises(StoreError) as refusal:
        open_store(store)
    assert says in str(refusal.value)
    assert str(refusal.value).isprintable()


def test_a_coordinate_of_which_nothing_is_there_is_refused(store):
    def edit(metadata: dict[str, Any]) -> None:
        metadata["shape"] = metadata["chunk_grid"]["configuration"]["chunk_shape"] = [10**7]

    change(store, "stator", edit)
    with pytest.raises(StoreError, match="10000000 values, of which its files hold few"):
        open_store(store)


def test_a_chunk_that_decodes_into_more_than_it_should_is_not_decoded(store):
    def edit(metadata: dict[str, Any]) -> None:
        metadata["codecs"] = [CODEC, {"name": "zstd", "configuration": {"level": 0, "checksum": False}}]

    change(store, "friction", edit)
    (store / "friction" / "c" / "0").write_bytes(Zstd().encode(np.zeros(2**20)))
    with pytest.raises(StoreError, match=r"a chunk of another size|longer than a chunk"):
        open_store(store)


def test_a_file_without_end_is_not_read(store):
    with (store / "friction" / "c" / "0").open("r+b") as file:
        file.truncate(2**40)  # takes no place
    with pytest.raises(StoreError, match="longer than a chunk can be"):
        open_store(store)


@pytest.mark.parametrize(
    "attributes",
    [
        {"study": []},
        {"rig": "no table"},
        {"study": {"grid": []}},
        {"study": {"grid": {"friction": {"unit": 1}}}},
        {"study": {"grid": {"friction": {"unit": "1", "values": [[1]]}}}},
        {"study": {"contact": {"friction_law": {}}}},
        {"study": {"record": {"probe": [{"name": 1}]}}},
        {"study": {"branch": {"along": 3}}},
        {"title": 1},
    ],
)
def test_attributes_of_other_types_are_refused(store, attributes):
    change(store, "", lambda metadata: metadata["attributes"].update(attributes))
    with pytest.raises(StoreError, match="its attributes are not those of a store"):
        open_store(store)


def test_a_store_made_with_a_word_of_an_older_version_is_read(store):
    study = {"record": {"transient": "shared"}}
    change(store, "", lambda metadata: metadata["attributes"].update(study=study))
    assert json.loads(open_store(store).attrs["study"]) == study


def test_control_characters_do_not_reach_the_reader(store):
    red = "\x1b[31mred\x9b"
    change(store, "", lambda metadata: metadata["attributes"].update(title=red, own={"a": red}))
    change(store, "peak_torsion", lambda metadata: metadata["attributes"].update(long_name=red))
    opened = open_store(store)
    for text in (opened.attrs["title"], opened.attrs["own"], opened["peak_torsion"].attrs["long_name"]):
        assert text.isprintable()


def test_a_dataset_is_written_as_netcdf(synthetic_path, tmp_path):
    opened = open_store(synthetic_path)
    opened.to_netcdf(tmp_path / "study.nc")
    with xr.open_dataset(tmp_path / "study.nc") as back:
        assert set(back.variables) == set(opened.variables)
        assert json.loads(back.attrs["study"]) == json.loads(opened.attrs["study"])
