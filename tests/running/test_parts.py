"""Parts of a study computed apart, in any order, at once, killed anywhere: the bytes are those of one run."""

from __future__ import annotations

import json
import os
import shutil
import signal
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from running import killed_after, shards, start, stored_bytes, write_study
from stub_physics import Physics, record

from rubhpc.errors import InputError, StoppedEarly, StoreError
from rubhpc.running.driver import run
from rubhpc.running.plan import make_plan
from rubhpc.running.sampled_cases import Estimate, Sample
from rubhpc.schema import MISSING
from rubhpc.storage.in_progress import InProgress
from rubhpc.storage.lock import read_holder
from rubhpc.storage.status import read_status
from rubhpc.storage.store import Store
from rubhpc.storage.verify import verify
from rubhpc.study.cases import CaseGrid
from rubhpc.study.parts import Part, share_out
from rubhpc.study.study import Study, read_study

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

FRICTIONS = [0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4]


class Distinct(Physics):
    """Every case has a number of its own."""

    def run_case(self, setup: Any, *, clearance: float, friction: float, recording: Any, **rest: Any) -> Any:
        super().run_case(setup, clearance=clearance, friction=friction, recording=recording, **rest)
        return record(recording, friction + 1e3 * clearance + setup.spin)


@pytest.fixture
def physics(monkeypatch: pytest.MonkeyPatch) -> Physics:
    monkeypatch.setattr(os, "sync", lambda: None)  # no power is cut
    return Distinct().put_in(monkeypatch)


def make_study(folder: Path, friction: list[float] = FRICTIONS) -> Study:
    """28 cases in 12 blocks."""
    return read_study(
        write_study(folder, output=folder / "parts.zarr", friction=friction, block=3, keep='["section"]')
    )


def compute(study: Study, part: str | None = None) -> Any:
    return run(study, part=part, quiet=True)


def whole(study: Study) -> dict[str, bytes]:
    """The bytes that one run of all of it stores."""
    other = replace(study, output=study.output.with_name("whole.zarr"))
    compute(other)
    return stored_bytes(other.output)


def bury(store: Path) -> None:
    """Have the holders of all locks and drafts be dead: in a test they are this process."""
    for draft in store.parent.glob(".*.draft"):
        shutil.rmtree(draft)
    for path in [store / ".rubhpc" / "lock", *(store / ".rubhpc" / "parts").glob("*.lock")]:
        if path.exists():
            path.write_text(json.dumps(json.loads(path.read_text()) | {"born": "1"}))


class Elsewhere:
    """A part that another process computes meanwhile, as a context."""

    def __init__(self, study: Study, part: str) -> None:
        self._lock = Store(study.output).parts.lock(Part.parse(part), run=99)

    def __enter__(self) -> None:
        self._lock.__enter__()

    def __exit__(self, *_: object) -> None:
        self._lock.release()


@pytest.mark.parametrize(("order", "is_sharded"), [((1, 2, 3), False), ((3, 1, 2), True)])
def test_parts_in_any_order_store_the_bytes_of_one_run(physics, tmp_path, order, is_sharded):
    with shards() if is_sharded else pytest.MonkeyPatch.context():
        study = make_study(tmp_path)
        expected = whole(study)
        physics.frictions.clear()
        for number in order:
            summary = compute(study, f"{number}/3")
            assert summary.exit_code == 0
            assert summary.counts[MISSING] == 0
        assert sorted(physics.frictions) == sorted(FRICTIONS * 4)  # none twice
        assert stored_bytes(study.output) == expected
        assert not (study.output / ".rubhpc" / "blocks").exists()
        assert not (study.output / ".rubhpc" / "parts").exists()
        assert not verify(study.output)


def test_a_study_has_parts_of_equal_loads_whose_sweeps_are_whole(tmp_path):
    sweep = '{ values = [0.9, 1.2, 1.5, 1.8, 2.1], sweep = "both" }'
    study = read_study(write_study(tmp_path, speed_ratio=sweep, friction=FRICTIONS))
    grid = CaseGrid(study)
    numbers = share_out(grid, 3).reshape([-(-n // c) for n, c in zip(grid.shape, grid.chunk, strict=True)])
    loads = dict.fromkeys((1, 2, 3), 0)
    for sequence in grid.sequences():
        places = [tuple(s // c for s, c in zip(b.start, grid.chunk, strict=True)) for b in sequence]
        (number,) = {int(numbers[place]) for place in places}
        loads[number] += sum(block.cost for block in sequence)
    longest = max(sum(block.cost for block in sequence) for sequence in grid.sequences())
    assert max(loads.values()) - min(loads.values()) <= longest


def test_parts_of_a_sweep_store_the_bytes_of_one_run(tmp_path):
    """With the real physics: final states go from case to case."""
    sweep = '{ values = [0.9, 1.2, 1.5], sweep = "both" }'
    study = read_study(write_study(tmp_path, speed_ratio=sweep, friction=[0.2, 0.4]))
    expected = whole(study)
    for number in (2, 3, 1):
        compute(study, f"{number}/3")
    assert stored_bytes(study.output) == expected


def test_more_parts_than_blocks_leave_some_without_work(physics, tmp_path):
    study = make_study(tmp_path, friction=[0.1, 0.2])
    summaries = [compute(study, f"{number}/9") for number in range(1, 10)]
    assert sorted(summary.computed for summary in summaries) == [0] * 5 + [2] * 4
    assert "no cases" in next(s for s in summaries if not s.computed).text()
    assert stored_bytes(study.output) == whole(study)


@pytest.mark.parametrize("text", ["0/4", "5/4", "a/b", "3", "1/0", "-1/4", "1/4/2", "", "1/1000001", "²/4"])
def test_a_part_that_is_none_is_refused_in_a_line_and_nothing_is_written(tmp_path, text):
    study = make_study(tmp_path)
    with pytest.raises(InputError, match=r"^part") as caught:
        compute(study, text)
    assert "\n" not in str(caught.value)
    assert not study.output.exists()


def test_a_number_of_parts_that_is_too_large_is_said_to_be_so(tmp_path):
    with pytest.raises(InputError, match="a study has from 1 to 100000 parts"):
        compute(make_study(tmp_path), "1/99999999999")


def test_what_cannot_go_on_beside_a_part_is_refused(physics, tmp_path):
    study = make_study(tmp_path)
    compute(study, "1/3")
    before = stored_bytes(study.output)
    with Elsewhere(study, "2/3"):
        with pytest.raises(StoreError, match=r"part 2/3: in use by part 2/3 \(process"):
            compute(study, "2/3")
        with pytest.raises(StoreError, match=r"parts.zarr: in use by part 2/3"):
            compute(study)
        with pytest.raises(StoreError, match=r"in other parts, by part 2/3"):
            compute(study, "2/4")
        grown = make_study(tmp_path, friction=[*FRICTIONS, 0.5])
        with pytest.raises(StoreError, match=r"the study has changed since part 2/3 .* began it"):
            compute(grown, "3/3")
        (study.output / ".rubhpc" / "parts" / "shares.json").write_text("damaged")
        with pytest.raises(StoreError, match="shares of its parts are damaged"):
            compute(study, "3/3")
    assert stored_bytes(study.output) == before
    assert not (study.output / ".rubhpc" / "lock").exists()
    compute(grown, "3/3")
    compute(grown)
    assert stored_bytes(study.output) == whole(grown)


def test_a_part_leaves_alone_what_others_have_in_hand(physics, tmp_path):
    """Their records are no deaths, their unfinished files no rubbish; the last to end completes the store."""
    with shards():
        study = make_study(tmp_path)
        for number in (1, 2):
            compute(study, f"{number}/3")
        store = Store(study.output)
        partial = study.output / "section_vertical" / "x.partial"
        with Elsewhere(study, "2/3"):
            partial.parent.mkdir(exist_ok=True)
            partial.write_text("")
            (study.output / "STOP").write_text("")
            with InProgress(store.in_progress_directory, 99, "rank00000") as record_of_other:
                record_of_other.take(0, store.manifest.case_id(0))
                with pytest.raises(StoppedEarly):
                    compute(study, "3/3")
                (study.output / "STOP").unlink()
                assert "; no case of another part is missing" in compute(study, "3/3").text()
                assert len(list(store.in_progress_directory.iterdir())) == 1
            assert partial.exists()
            assert (study.output / ".rubhpc" / "blocks").exists()  # part 2 might still write some
        assert compute(study, "2/3").computed == 0
        assert not partial.exists()
        assert stored_bytes(study.output) == whole(study)


def test_the_file_stop_stays_until_the_last_part_has_seen_it(physics, tmp_path):
    study = make_study(tmp_path)
    compute(study, "1/3")
    (study.output / "STOP").write_text("")
    with Elsewhere(study, "2/3"), pytest.raises(StoppedEarly, match="part 3/3"):
        compute(study, "3/3")
    assert (study.output / "STOP").exists()
    with pytest.raises(StoppedEarly):
        compute(study, "3/3")
    assert not (study.output / "STOP").exists()


def test_a_part_that_is_stopped_goes_on_where_it_was(physics, tmp_path):
    study = make_study(tmp_path)

    def stop() -> None:
        if len(physics.frictions) == 4:
            os.kill(os.getpid(), signal.SIGTERM)

    physics.on_case = stop
    with pytest.raises(StoppedEarly, match=r"part 1/2: stopped by SIGTERM with \d+ of \d+ cases missing"):
        compute(study, "1/2")
    physics.on_case = lambda: None
    assert compute(study, "1/2").counts[MISSING] == 0
    assert compute(study).counts[MISSING] == 0  # a whole run completes what parts have begun
    assert stored_bytes(study.output) == whole(study)


def test_lines_written_while_a_part_packs_are_packed_later(physics, tmp_path, monkeypatch):
    """The state of the journals that counts is that of before they are read."""
    study = make_study(tmp_path)
    compute(study, "1/2")
    store = Store(study.output)
    ledger = store.replay()
    compute(study, "2/2")
    store.pack(ledger)
    assert not store.is_packed()


def kill_everywhere(study: Study, parts: tuple[str, ...], step: int, check: Callable[[], None]) -> int:
    """Run parts in turn, killed after more and more changes of the disk, until none is killed."""
    n_kill, n_call = 0, 0
    while True:
        summaries = []
        for part in parts:
            with killed_after(n_call):
                summaries.append(compute(study, part))
            bury(study.output)
        if len(summaries) == len(parts):
            return n_kill
        check()
        n_kill, n_call = n_kill + 1, n_call + step


def test_parts_killed_at_every_step_lose_nothing(physics, tmp_path):
    with shards():
        study = make_study(tmp_path, friction=FRICTIONS[:4])
        expected = whole(study)
        physics.frictions.clear()
        known = np.zeros(16, bool)

        def check() -> None:
            if (study.output / ".rubhpc").exists():
                is_there = Store(study.output).replay(with_measures=False).status != MISSING
                assert is_there[known].all()
                known[is_there] = True

        n_kill = kill_everywhere(study, ("2/2", "1/2"), 9, check)
        assert n_kill > 8
        assert stored_bytes(study.output) == expected
        assert not verify(study.output)


def test_the_end_of_the_last_part_may_be_cut_short_anywhere(physics, tmp_path):
    """What it leaves, the same part completes, or a run of all."""
    with shards():
        study = make_study(tmp_path, friction=FRICTIONS[:2])
        expected = whole(study)
        compute(study, "1/2")
        with Elsewhere(study, "1/2"):
            compute(study, "2/2")  # all cases are there, nothing is packed into shards
        left = tmp_path / "left.zarr"
        shutil.copytree(study.output, left)
        for n_call in range(0, 200, 5):
            shutil.rmtree(study.output)
            shutil.copytree(left, study.output)
            summaries: list[Any] = []
            with killed_after(n_call):
                summaries.append(compute(study, "1/2"))
            bury(study.output)
            if summaries:
                break
            assert compute(study, None if n_call % 10 else "2/2").computed == 0
            assert stored_bytes(study.output) == expected
            assert not (study.output / ".rubhpc" / "blocks").exists()
        assert n_call > 15
        assert stored_bytes(study.output) == expected


def test_status_and_plan_show_the_parts(physics, tmp_path, monkeypatch):
    study = make_study(tmp_path)
    compute(study, "2/4")
    with Elsewhere(study, "3/4"):
        status = read_status(study.output)
        text = status.text()
    assert "running: part 3/4 (process" in text
    assert "4 parts: 1 complete, 1 running; to be run: 1,4" in text
    assert "no run is active" not in text
    assert sum(part.n_case for part in status.parts) == 28
    assert sum(part.n_missing for part in status.parts) == status.counts[MISSING]
    monkeypatch.setattr(Sample, "estimate", lambda _, __, steps: Estimate(*[steps] * 3))
    monkeypatch.setattr(Sample, "set_up", 0.0)
    plans = [make_plan(study, f"{number}/4") for number in range(1, 5)]
    assert [plan.counts[MISSING] == 0 for plan in plans] == [False, True, False, False]
    assert sum(plan.time.seconds for plan in plans) == pytest.approx(make_plan(study).time.seconds)
    assert "part        2/4: " in plans[1].text()


def test_parts_that_run_at_the_same_time_share_a_store(tmp_path):
    """Real processes, all at once, one part twice, another on two workers."""
    file = write_study(tmp_path, friction=FRICTIONS)
    jobs = [start(file, "--part", *more) for more in (("1/2", "--workers", "2"), ("2/2",), ("2/2",))]
    said = [running.communicate(timeout=120) for running in jobs]
    codes = [running.returncode for running in jobs]
    assert codes[0] == 0, said[0][1]
    assert sorted(codes[1:]) in ([0, 0], [0, 3])  # one after the other, or refused
    assert "part 1/2: 14 done; 14 computed" in said[0][0]
    assert stored_bytes(tmp_path / "tiny.zarr") == whole(read_study(file))
    assert read_holder(tmp_path / "tiny.zarr" / ".rubhpc" / "lock") is None
