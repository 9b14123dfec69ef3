"""A case that kills its rank, or never comes back, fails with its reason; the others finish."""

from __future__ import annotations

from pathlib import Path

import pytest
from running import LAUNCHERS, OWN, each_launcher, run, stored_bytes, write_study

from rubhpc.schema import DONE, FAILED
from rubhpc.storage.in_progress import InProgress, read_deaths
from rubhpc.storage.store import Store
from rubhpc.storage.verify import verify

POISONED = Path(__file__).with_name("poisoned.py")


def write_poisoned(folder: Path, name: str = "tiny.toml", *, guilty: int = 1, **changes: object) -> Path:
    """Write a study of three cases for each that is guilty: of friction 0.3."""
    return write_study(folder, name, speed_ratio=[0.9], clearance_ratio=[0.7, 0.85][:guilty], **changes)


def runs_until_the_end(mode: str, study: Path, store: Path, most: int, **rest: object) -> int:
    """Run the study again and again until it ends with failed cases; how often it died on the way."""
    for n_death in range(most + 1):
        done = run(mode, study, script=POISONED, **rest)
        assert "Traceback (most" not in done.stderr
        if done.returncode == 1 and "cases failed; the first" in done.stderr:
            return n_death
        assert done.returncode not in (0, 2, 3)
        assert not verify(store)
    raise AssertionError(f"no end after {most} deaths: {done.stderr}")


def check_outcome(store: Path, reason: str, guilty: int = 1) -> None:
    """The guilty have failed with their reason, all others are done."""
    ledger = Store(store).replay()
    assert ledger.status.tolist() == [DONE, FAILED, DONE] * guilty
    assert len(ledger.reasons) == guilty
    assert all(reason in text for text in ledger.reasons.values()), ledger.reasons
    assert list((store / ".rubhpc" / "in_progress").iterdir()) == []


@pytest.mark.parametrize(
    ("launcher", "ranks", "guilty"),
    [
        pytest.param(OWN, 0, 1, id="no launcher"),
        *(pytest.param(launcher, 2, 2, id=launcher.name, marks=pytest.mark.long) for launcher in LAUNCHERS),
    ],
)
def test_a_case_with_a_segmentation_fault_fails_after_one_of_them(tmp_path, launcher, ranks, guilty):
    """The next run computes it in a process of its own first."""
    study, store = write_poisoned(tmp_path, guilty=guilty), tmp_path / "tiny.zarr"
    n_death = runs_until_the_end("segfault", study, store, guilty, ranks=ranks, launcher=launcher)
    check_outcome(store, "it ends the process that computes it: segmentation fault", guilty)
    where = f"{launcher.name}, {ranks} ranks"
    print(f"\n{where}: {guilty} cases with a segmentation fault failed after {n_death} deaths")
    healthy = run(study, "--retry-failed")
    assert healthy.returncode == 0, healthy.stderr
    whole = write_poisoned(tmp_path, "whole.toml", guilty=guilty, output=tmp_path / "whole.zarr")
    assert run(whole).returncode == 0
    assert stored_bytes(store) == stored_bytes(tmp_path / "whole.zarr")


@pytest.mark.long
@each_launcher
def test_a_case_whose_rank_is_killed_fails_after_two_times(tmp_path, launcher):
    """SIGKILL does not show its cause: neither the memory nor the user is blamed."""
    study, store = write_poisoned(tmp_path, guilty=2), tmp_path / "tiny.zarr"
    n_death = runs_until_the_end("killed", study, store, 4, ranks=2, launcher=launcher)
    check_outcome(store, "it ends the process that computes it: killed by SIGKILL", guilty=2)
    print(f"\n{launcher.name}: 2 cases that are killed failed after {n_death} deaths")


@each_launcher
def test_a_case_that_never_comes_back_fails_in_the_next_run(tmp_path, launcher):
    """Its kernel does not return, so nobody can ask it whether its time is over."""
    study = write_poisoned(tmp_path, run='case_time_limit = "2 s"')
    store = tmp_path / "tiny.zarr"
    n_death = runs_until_the_end("stuck", study, store, 1, ranks=2, launcher=launcher)
    check_outcome(store, "over its time limit of 2 s, in a single step of it")
    print(f"\n{launcher.name}: a case that never comes back failed after {n_death} deaths")


@pytest.mark.long
def test_one_that_never_comes_back_says_what_to_do(tmp_path):
    study = write_study(tmp_path, speed_ratio=[0.9], run='case_time_limit = "2 s"')
    done = run("stuck", study, script=POISONED)
    assert done.returncode == 75
    (line,) = done.stderr.splitlines()
    assert line.startswith("rubhpc: rank 0: a case is over its time limit of 2 s and cannot be interrupted")


@pytest.fixture
def store(tmp_path: Path) -> Store:
    study = write_study(tmp_path)
    assert run(study, "--time-limit", "1 ms").returncode == 75
    return Store(tmp_path / "tiny.zarr")


def die(store: Store, flat: int) -> InProgress:
    """Leave the record of a rank that died in a case."""
    progress = InProgress(store.in_progress_directory, 1, "rank00000")
    progress.take(flat, store.manifest.case_id(flat))
    return progress


def test_innocent_cases_are_tried_again_and_no_record_of_them_stays(store):
    is_missing = store.replay().status == 0
    die(store, 3)
    suspects = read_deaths(store.in_progress_directory, store.manifest, is_missing)
    assert (suspects.failed, suspects.suspect) == ({}, {})  # one kill of the launcher is no suspicion
    for _ in range(11):
        die(store, 3)
    suspects = read_deaths(store.in_progress_directory, store.manifest, is_missing)
    assert (suspects.failed, suspects.suspect) == ({}, {3: 12})  # nor are twelve
    is_missing[3] = False
    assert read_deaths(store.in_progress_directory, store.manifest, is_missing).suspect == {}
    assert list(store.in_progress_directory.iterdir()) == []


def test_a_record_of_another_grid_or_of_no_case_says_nothing(store):
    is_missing = store.replay().status == 0
    for _ in range(5):
        with InProgress(store.in_progress_directory, 1, "rank00000"):
            pass  # ended in order
        InProgress(store.in_progress_directory, 1, "rank00000")
        InProgress(store.in_progress_directory, 1, "rank00000").take(3, store.manifest.case_id(4))
        InProgress(store.in_progress_directory, 1, "rank00000").take(99, store.manifest.case_id(4))
    suspects = read_deaths(store.in_progress_directory, store.manifest, is_missing)
    assert (suspects.failed, suspects.suspect) == ({}, {})
    assert list(store.in_progress_directory.iterdir()) == []


def test_want_of_memory_is_evidence(store, monkeypatch):
    from rubhpc.storage import in_progress

    is_missing = store.replay().status == 0
    monkeypatch.setattr(in_progress, "oom_kills", lambda: 7)
    die(store, 5)
    monkeypatch.setattr(in_progress, "oom_kills", lambda: 8)
    suspects = read_deaths(store.in_progress_directory, store.manifest, is_missing)
    assert (suspects.failed, suspects.suspect) == ({}, {5: 1})


def test_an_innocent_suspect_is_computed(store):
    for _ in range(12):
        die(store, 3)
    done = run(store.path.with_suffix(".toml"))
    assert done.returncode == 0, done.stderr
    assert list(store.in_progress_directory.iterdir()) == []
