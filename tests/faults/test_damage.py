"""What is damaged is named, exactly; the next run computes it again, and nothing else."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from running import array_of, run, stored_bytes

from rubhpc.running.driver import run as run_study
from rubhpc.storage.store import Store
from rubhpc.storage.verify import verify


@pytest.fixture
def store(tmp_path: Path, finished: Path) -> Path:
    return Path(shutil.copytree(finished / "tiny.zarr", tmp_path / "tiny.zarr"))


def named_by_verify(store: Path) -> set[tuple[int, ...]]:
    """Indices of the cases that verify names."""
    damage = verify(store)
    assert damage
    assert damage.note == ""
    return {tuple(int(i) for i in np.unravel_index(flat, (2, 2, 3))) for flat in damage.cases}


def repaired_by_run(store: Path, finished: Path) -> int:
    """Run the study again; how many cases that took to make all as it was."""
    summary = run_study(finished / "tiny.toml", output=store, quiet=True)
    assert summary.counts == (0, 12, 0, 0, 0)
    assert stored_bytes(store) == stored_bytes(finished / "tiny.zarr")
    assert not verify(store)
    return summary.computed


def change_byte(path: Path, at: int) -> None:
    data = bytearray(path.read_bytes())
    data[at] ^= 0x40
    path.write_bytes(data)


@pytest.mark.parametrize(("name", "at"), [("vertical", -1), ("contact_force", 16), ("section_torsion", -3)])
def test_a_byte_of_a_chunk_is_changed(store, finished, name, at):
    """The chunk holds the cases (0, 1, 0) and (0, 1, 1); a byte may belong to one or to both."""
    change_byte(store / name / "c" / "/".join("010" + "0" * (array_of(store, name).ndim - 3)), at)
    named = named_by_verify(store)
    assert named
    assert named <= {(0, 1, 0), (0, 1, 1)}
    assert repaired_by_run(store, finished) == len(named)


def test_one_case_of_a_chunk_is_changed(store, finished):
    """Only its own numbers: the other case of the chunk is carried over."""
    array_of(store, "torsion")[1, 0, 0, 7] += 1e-9
    assert named_by_verify(store) == {(1, 0, 0)}
    assert repaired_by_run(store, finished) == 1


def test_links_that_lead_back_to_themselves(store, finished):
    """In place of a chunk, of the chunks of some cases, and of a journal."""
    chunk, other = Store(store).chunk_files((1, 0, 0))[4], store / "vertical" / "c" / "0"
    (journal,) = (store / ".rubhpc" / "journal").iterdir()
    for path, n_case in ((chunk, 2), (other, 6), (journal, 4)):  # that of the repairs holds 8
        shutil.rmtree(path) if path.is_dir() else path.unlink()
        path.symlink_to(path)
        assert len(named_by_verify(store)) == n_case
        assert repaired_by_run(store, finished) == n_case


@pytest.mark.parametrize("lose", [Path.unlink, lambda path: path.write_bytes(b"")], ids=["deleted", "empty"])
def test_a_run_sees_a_lost_chunk_by_itself(store, finished, lose):
    lose(Store(store).chunk_files((1, 0, 0))[4])
    assert repaired_by_run(store, finished) == 2


def test_a_line_of_the_journal_is_changed(store, finished):
    (path,) = (store / ".rubhpc" / "journal").iterdir()
    lines = path.read_bytes().splitlines(keepends=True)
    flat = int(lines[4].split()[1])
    change_byte(path, len(b"".join(lines[:4])) + 60)
    assert named_by_verify(store) == {tuple(int(i) for i in np.unravel_index(flat, (2, 2, 3)))}
    assert repaired_by_run(store, finished) == 1


def test_lines_of_no_case_behind_a_journal_are_named(store, finished):
    """They cost nothing: a warning with their number, and exit code 0."""
    (path,) = (store / ".rubhpc" / "journal").iterdir()
    with path.open("ab") as journal:
        journal.writelines(b"%08x 3 junk %d\n" % (k, k) for k in range(50))
        journal.write(b"\xff\xfe cut short")
    done = run("verify", store)
    warning, checked = done.stdout.splitlines()
    assert warning == f"warning: 51 damaged lines in {path.name}: skipped"
    assert checked == "12 cases checked, no damage"
    assert (done.returncode, done.stderr) == (0, "")
    assert repaired_by_run(store, finished) == 0


@pytest.mark.parametrize("name", ["period", "status", "speed_ratio", "clearance", "revolution"])
def test_what_is_no_case_is_written_anew_without_computing(store, finished, name):
    (chunk,) = (path for path in (store / name / "c").rglob("*") if path.is_file())
    change_byte(chunk, -1)
    damage = verify(store)
    assert damage.arrays == (name,)
    assert damage.cases == {}
    assert repaired_by_run(store, finished) == 0


def test_a_chunk_of_missing_values_is_deleted(store, finished):
    """Readers see the same numbers without it; it is named and written again."""
    chunk = store / "lyapunov_exponent" / "c" / "0" / "0" / "0"
    assert np.isnan(array_of(store, "lyapunov_exponent")[...]).all()
    chunk.unlink()
    assert verify(store).arrays == ("lyapunov_exponent",)
    assert repaired_by_run(store, finished) == 0


def test_axes_that_no_journal_has(store):
    """A manifest of another program: what is stored fits none of its cases, and verify says so."""
    manifest = Store(store).manifest
    first, *rest = manifest.axes
    replace(manifest, axes=(replace(first, values=first.values[:1]), *rest)).write(store)
    assert "status" in verify(store).arrays


def test_a_partial_file_is_no_damage(store, finished):
    stray = store / "vertical" / "c" / "0" / "0" / "0" / "0.5f.partial"
    stray.write_bytes(b"half a chunk")
    assert not verify(store)
    assert repaired_by_run(store, finished) == 0
    assert not stray.exists()


def test_the_command_names_the_damage_though_the_store_is_in_use(store):
    Store(store).chunk_files((1, 0, 0))[4].unlink()
    with Store(store).lock():
        done = run("verify", store)
    assert done.returncode == 3
    assert done.stdout.splitlines() == [
        "damaged: case (1, 0, 0) speed_ratio=2, clearance_ratio=0.7, friction=0.1: a file is missing",
        "damaged: case (1, 0, 1) speed_ratio=2, clearance_ratio=0.7, friction=0.3: a file is missing",
    ]
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"rubhpc: {store}: damage in 2 cases and 0 arrays; not marked for the next run: ")
    again = run("verify", store)
    assert (
        again.stderr == f"rubhpc: {store}: damage in 2 cases and 0 arrays; run its study again to repair it\n"
    )
