"""Any byte of a store may be changed, cut off or deleted: `verify` reports it, the next run repairs it."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from running import stored_bytes

from rubhpc.running.driver import run as run_study
from rubhpc.storage.store import Store
from rubhpc.storage.verify import verify


def damage(path: Path, how: str, where: float, bit: int) -> None:
    """Change one bit of a file, cut it short, lengthen it, or delete it."""
    data = bytearray(path.read_bytes())
    at = min(int(where * len(data)), len(data) - 1)
    if how == "delete":
        path.unlink()
    elif how == "bit" and data:
        data[at] ^= 1 << bit
        path.write_bytes(data)
    elif how == "cut":
        path.write_bytes(data[:at])
    elif how == "append":
        path.write_bytes(data + bytes([bit]))


blows = st.tuples(
    st.integers(0, 10**6),
    st.sampled_from(["bit", "bit", "cut", "append", "delete"]),
    st.floats(0, 1),
    st.integers(0, 7),
)


def check(finished: Path, strikes: list[tuple[int, str, float, int]]) -> None:
    """Damage a copy of the store here and there; it is reported, repaired, and equal to the original."""
    with tempfile.TemporaryDirectory() as folder:
        store = Path(shutil.copytree(finished / "tiny.zarr", Path(folder) / "tiny.zarr"))
        files = sorted(path for path in store.rglob("*") if path.is_file() and path.name != "lock.guard")
        whole = stored_bytes(store)
        n_case = {}  # damaged journal lines and blocks, as verify names them
        struck = {files[i % len(files)]: blow for i, *blow in strikes}
        manifests = [path for path in struck if path.name.startswith("manifest")]
        if len(manifests) > 1:
            del struck[manifests[0]]  # with both copies gone there is no store any more
        for path, blow in struck.items():
            damage(path, *blow)
        read = {path for path in store.rglob("*") if path.is_file()}
        reported = verify(store)
        seen = stored_bytes(store) != whole
        if seen:
            assert reported, struck  # nothing that a reader sees is damaged in silence
        assert {path for path in store.rglob("*") if path.is_file()} >= read - {
            store / ".rubhpc" / "packed.json"
        }
        n_case = len(reported.cases)
        summary = run_study(finished / "tiny.toml", output=store, quiet=True)
        assert summary.counts == (0, 12, 0, 0, 0)
        assert summary.computed == n_case, (reported.lines(), struck)
        assert not verify(store)
        assert stored_bytes(store) == whole
        assert Store(store).manifest.damaged_copies(store) == []


@pytest.mark.timeout(3600)
@pytest.mark.parametrize("n_example", [4, pytest.param(100, marks=pytest.mark.long)])
def test_any_damage_is_reported_and_repaired(finished, n_example):
    @settings(max_examples=n_example, phases=[Phase.generate])  # to shrink a failure takes minutes
    @given(strikes=st.lists(blows, min_size=1, max_size=6))
    def strike(strikes):
        check(finished, strikes)

    strike()
