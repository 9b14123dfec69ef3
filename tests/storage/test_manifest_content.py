"""A manifest that another program has written, with a checksum of its own, is refused in one line."""

from __future__ import annotations

import json
import shutil
from typing import TYPE_CHECKING, Any
from zlib import crc32

import pytest

from rubhpc.errors import StoreError
from rubhpc.storage.manifest import Manifest
from rubhpc.storage.resume import grid_for
from rubhpc.storage.store import Store
from rubhpc.storage.verify import verify
from rubhpc.study.cases import CaseGrid
from rubhpc.study.study import read_study

if TYPE_CHECKING:
    from pathlib import Path

STUDY = """
rig = "mokhtar2017"
output = "map.zarr"
[grid]
speed_ratio = { start = 0.9, stop = 1.3, num = 5 }
friction = { start = 0.0, stop = 0.4, num = 5 }
clearance_ratio = 0.7
"contact.law" = ["lagrange", "penalty"]
[contact]
stiffness = 1e8
[record]
revolutions = 2
keep = ["section"]
[refine]
coarse = 4
[[record.probe]]
name = "left"
node = 1
"""
GONE = object()
EDITS: list[tuple[str, Any]] = [
    *((name, GONE) for name in ("title", "identity", "parts", "axes", "chunk", "sizes", "keep", "files")),
    *(
        (name, 5)
        for name in ("title", "identity", "parts", "axes", "chunk", "shard", "sizes", "keep", "refine")
    ),
    *(("chunk", odd) for odd in ([], [0, 1, 1, 1], [1, 1, 1], [1, 1, 1, 2**70], [1.5, 1, 1, 1])),
    *(("shard", odd) for odd in ([1], [0, 0, 0, 0], "4")),
    *((f"sizes/{name}", odd) for name in ("stator", "section") for odd in (GONE, None, -1, 2**70, 1e300)),
    *(
        (f"axes/0/{name}", odd)
        for name in ("name", "dimension", "unit", "long_name")
        for odd in (None, {}, GONE)
    ),
    *(("axes/0/values", odd) for odd in ([], [None], 5, "x", [True])),
    *(("axes/0/sweep", odd) for odd in (None, "both", "x")),
    ("axes/1/name", "speed_ratio"),
    ("axes/1/dimension", "speed_ratio"),
    ("axes/3/values", [7.0, 8.0]),
    *(("measures/0/dtype", odd) for odd in (None, 1e300, "U7", [])),
    *(("measures/0/dims", odd) for odd in (["section"], "x", [[]], None)),
    *((f"measures/{i}/dims", ["stator"] if i == 0 else []) for i in (0, 8)),
    ("measures/0/name", ""),
    ("measures/0/name", []),
    ("measures/1/flags", 5),
    ("measures/1", None),
    ("added", ["x"]),
    ("accepted", ["x"]),
    ("files/zarr.json", "x"),
    ("parts/physics", None),
    *(("parts/record", odd) for odd in (GONE, [], {"probe": 5}, {"probe": [{"name": "left"}]})),
    *((f"refine/{name}", odd) for name in ("by", "coarse", "dimensions") for odd in (GONE, 5.5, None, ["x"])),
    ("refine/coarse", 3),
]


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A new store: nothing is computed."""
    folder = tmp_path_factory.mktemp("map")
    (folder / "map.toml").write_text(STUDY)
    return Store.create(folder / "map.zarr", CaseGrid(read_study(folder / "map.toml"))).path


def edited(text: bytes, where: str, value: Any) -> bytes:
    """Return a manifest with one value changed or gone, and its checksum right."""
    head, _, body = text.partition(b"\n")
    content = within = json.loads(body)
    *ways, last = (int(step) if step.isdigit() else step for step in where.split("/"))
    for step in ways:
        within = within[step]
    if value is GONE:
        del within[last]
    else:
        within[last] = value
    body = json.dumps(content).encode()
    return b"%s %08x\n%s" % (head.rsplit(b" ", 1)[0], crc32(body), body)


@pytest.fixture
def changed(store: Path) -> Any:
    """Returns what puts an edit into both copies; they are whole again afterwards."""
    places = [store / ".rubhpc" / name for name in ("manifest.json", "manifest.copy.json")]
    whole = places[0].read_bytes()

    def change(where: str, value: Any) -> None:
        for place in places:
            place.write_bytes(edited(whole, where, value))

    yield change
    for place in places:
        place.write_bytes(whole)


@pytest.mark.parametrize(("where", "value"), EDITS, ids=[f"{where} {v!r:.9}" for where, v in EDITS])
def test_what_cannot_be_used_is_refused(store, changed, where, value):
    changed(where, value)
    with pytest.raises(StoreError, match=r"both copies of its manifest are damaged \(unknown content\); put"):
        Manifest.read(store)


def test_the_manifest_of_a_store_is_accepted(store):
    assert Manifest.read(store).refine is not None
    assert not verify(store)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"null",
        b"[1]",
        b"\xff",
        b"[" * 100_000,
        b'[["other", 1]]',
        b'[["run000001-rank00000.journal", 1e9]]',
    ],
    ids=lambda content: repr(content[:12]),
)
def test_a_garbled_note_of_the_packing_is_named(store, content):
    note = store / ".rubhpc" / "packed.json"
    note.write_bytes(content)
    assert verify(store).arrays == ("packed.json",)
    assert not note.exists()  # the next run packs again
    assert not verify(store)


@pytest.mark.parametrize(
    ("lost", "said"),
    [
        ((".rubhpc",), r"its directory \.rubhpc is missing, .*copy it too"),
        ((".rubhpc/manifest.json", ".rubhpc/manifest.copy.json"), "both copies of its manifest are missing"),
        ((".rubhpc", "zarr.json"), "is not a rubhpc store"),
    ],
)
def test_what_a_store_has_lost_is_named_and_nothing_is_overwritten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lost: tuple[str, ...], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(STUDY)
    study = read_study(tmp_path / "s.toml")
    store = Store.create(study.output, CaseGrid(study)).path
    for name in lost:
        place = store / name
        shutil.rmtree(place) if place.is_dir() else place.unlink()
    left = sorted(store.rglob("*"))
    for use in (Store, lambda _: grid_for(study), lambda _: Store.create(store, CaseGrid(study))):
        with pytest.raises(StoreError, match=said):
            use(store)
    assert sorted(store.rglob("*")) == left
