"""Runs of refined maps: what is computed, what readers see, and what a kill changes (nothing)."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from running import Killed, shards, stored_bytes, write_study
from simulated_ranks import Simulation
from stub_physics import Physics, record

from postproc.store.open import open_live, open_store
from rubhpc.errors import InputError, StoppedEarly
from rubhpc.running import driver, refining, worker
from rubhpc.running.driver import run
from rubhpc.running.plan import make_plan
from rubhpc.running.stopping import Stopping
from rubhpc.schema import DONE, FAILED, INFERRED, MISSING, REGIME
from rubhpc.storage.status import read_status
from rubhpc.storage.store import Store
from rubhpc.storage.verify import verify
from rubhpc.study.study import read_study

FRICTION = "{ start = 0.0, stop = 0.8, num = 17 }"
COARSE_FRICTION = "{ start = 0.0, stop = 0.8, num = 9 }"
SPEED = "{ start = 1.0, stop = 2.0, num = 17 }"
REFINE = '[refine]\naxes = ["speed_ratio", "friction"]\ncoarse = 4'


RATED, SLOWEST = 139.7, 198.3  # rad/s


class Maps(Physics):
    """A case touches above a friction that falls with the speed; its force rises with the friction."""

    def __init__(self) -> None:
        super().__init__()
        self.n_case = 0
        self.speeds: list[float] = []

    def prepare(self, rig, speed, **_):
        self.speeds.append(speed)
        return SimpleNamespace(model=None, spin=speed / RATED)

    def run_case(self, setup, *, friction, recording, check, **_):
        self.n_case += 1
        self.on_case()
        check()
        poisoned = self.poison(friction=friction, spin=setup.spin)
        if poisoned is not None:
            return poisoned
        made = record(recording, friction)
        touches = friction > 0.9 - 0.3 * setup.spin
        made.measures.update(
            {
                "regime": REGIME.index("periodic") if touches else 0,
                "period": 1,
                "peak_contact_force": np.array([2.0 * friction]),
            }
        )
        return made


@pytest.fixture
def physics(monkeypatch):
    return Maps().put_in(monkeypatch)


def study_of(folder, name="tiny", rest=REFINE, friction=FRICTION, **changes):
    return read_study(
        write_study(
            folder,
            f"{name}.toml",
            output=folder / f"{name}.zarr",
            speed_ratio=SPEED,
            friction=friction,
            run=rest,
            **({"keep": "[]"} | changes),
        )
    )


def test_a_run_computes_what_is_asked_and_readers_fill_the_rest(tmp_path, physics):
    study = study_of(tmp_path)
    summary = run(study, quiet=True)
    n_case = 17 * 2 * 17
    n_done, n_inferred = summary.counts[DONE], summary.counts[INFERRED]
    assert n_done + n_inferred == n_case
    assert physics.n_case == n_done == summary.computed
    assert n_done < 0.6 * n_case
    assert f"{n_inferred} inferred" in summary.text()
    store = open_store(study.output)
    edge = 0.9 - 0.3 * store.spin_speed.values[:, None] / RATED
    assert (store.regime.values == (store.friction.values > edge)[:, None]).all()
    assert store.peak_contact_force.values[..., 0] == pytest.approx(
        np.broadcast_to(2 * store.friction.values, (17, 2, 17)), abs=1e-12
    )
    assert int((store.status == INFERRED).sum()) == n_inferred
    assert read_status(study.output).counts[INFERRED] == n_inferred
    assert "inferred" in read_status(study.output).text()
    assert not verify(study.output)
    assert run(study, quiet=True).computed == 0


def run_with_kills(study, physics, moments):
    """Run a study to its end, killed each time that it has computed as many cases as `moments` state."""

    def count_down():
        if physics.n_case == end:
            raise Killed

    physics.on_case = count_down
    for n_case in moments:
        end = physics.n_case + n_case
        with pytest.raises(Killed):
            run(study, quiet=True)
    end = -1
    run(study, quiet=True)


@pytest.mark.parametrize("moments", [(1,), (70, 71), (90, 20, 40)])
def test_kills_on_any_level_change_nothing(tmp_path, physics, moments):
    whole = study_of(tmp_path, "whole", keep='["section"]')
    run(whole, quiet=True)
    study = study_of(tmp_path, keep='["section"]')
    run_with_kills(study, physics, moments)
    assert stored_bytes(study.output) == stored_bytes(whole.output)


class Islands(Maps):
    """An island of contact near the edge, and one without contact far from it: the first level meets none."""

    near, far = (6, 4), (14, 14)  # number of speed and friction

    def run_case(self, setup, *, friction, **rest):
        made = super().run_case(setup, friction=friction, **rest)
        here = round(16 * (setup.spin * RATED / SLOWEST - 1.0)), round(20 * friction)
        for regime, (i, j) in (("periodic", self.near), ("no_contact", self.far)):
            if max(abs(here[0] - i), abs(here[1] - j)) <= 1:
                made.measures["regime"] = REGIME.index(regime)
        return made


def test_islands_smaller_than_the_first_step(tmp_path, physics, monkeypatch):
    """An island near an edge is met and complete, one far from all is not, though the run is killed."""
    study, islands = study_of(tmp_path), Islands().put_in(monkeypatch)
    run_with_kills(study, islands, (100, 3))
    store = open_store(study.output)
    found = store.regime.values[:, 0] == REGIME.index("periodic")
    assert (store.status.values[13:16, 0, 13:16] == INFERRED).all()
    edge = store.friction.values > 0.9 - 0.3 * store.spin_speed.values[:, None] / RATED
    edge[5:8, 3:6] = True
    assert (found == edge).all()


def test_a_stop_within_a_level_is_taken_up(tmp_path, physics):
    study = study_of(tmp_path)
    whole = study_of(tmp_path, "whole")
    run(whole, quiet=True)
    n_whole = physics.n_case
    physics.n_case = 0

    stopping = Stopping()

    def stop_after_90():
        if physics.n_case == 90:
            stopping.ask("a test")

    physics.on_case = stop_after_90
    with pytest.raises(StoppedEarly):
        run(study, quiet=True, stopping=stopping)
    status = read_status(study.output)
    assert status.counts[INFERRED] == 0
    assert status.counts[MISSING] > 300
    assert (open_live(study.output).regime == -1).any()
    physics.on_case = lambda: None
    run(study, quiet=True)
    assert physics.n_case <= n_whole + 1
    assert stored_bytes(study.output) == stored_bytes(whole.output)


def test_without_the_table_the_store_is_completed(tmp_path, physics):
    study = study_of(tmp_path)
    run(study, quiet=True)
    n_refined = physics.n_case
    run(replace(study, refine=None), quiet=True)
    assert physics.n_case == 17 * 2 * 17
    assert (Store(study.output).replay().status == DONE).all()
    assert n_refined < physics.n_case
    full = study_of(tmp_path, "full", rest="")
    run(full, quiet=True)
    assert np.array_equal(open_store(full.output).regime, open_store(study.output).regime)
    run(study, quiet=True)  # nothing is taken away
    assert (open_store(study.output).status == DONE).all()


def test_failures_are_surrounded_and_retried(tmp_path, physics):
    def fail(friction, spin):
        if abs(friction - 0.4) < 1e-9 and abs(spin - 1.5) < 0.2:
            raise ValueError("no")

    physics.poison = fail
    study = study_of(tmp_path)
    summary = run(study, quiet=True)
    assert summary.counts[FAILED] > 0
    assert summary.counts[MISSING] == 0
    status = open_store(study.output).status.values
    failed = np.argwhere(status == FAILED)
    for speed, clearance, friction in failed:
        beside = status[max(speed - 1, 0) : speed + 2, clearance, friction]
        assert not (beside == INFERRED).any()
    physics.poison = lambda **_: None
    summary = run(study, quiet=True, retry_failed=True)
    assert summary.counts[FAILED] == 0
    assert summary.counts[MISSING] == 0


def test_a_finer_axis_keeps_what_is_computed(tmp_path, physics):
    study = study_of(tmp_path)
    run(study, quiet=True)
    n_first = physics.n_case
    finer = study_of(tmp_path, friction="{ start = 0.0, stop = 0.8, num = 33 }")
    summary = run(finer, quiet=True)
    assert summary.counts[MISSING] == 0
    assert physics.n_case - n_first < 0.6 * 17 * 2 * 33
    assert not verify(finer.output)


def test_a_packed_store_is_the_same(tmp_path, physics):
    plain = study_of(tmp_path, "plain", keep='["section"]', friction=COARSE_FRICTION)
    run(plain, quiet=True)
    with shards():
        packed = study_of(tmp_path, "packed", keep='["section"]', friction=COARSE_FRICTION)
        run(packed, quiet=True)
        assert not verify(packed.output)
    a, b = open_store(plain.output), open_store(packed.output)
    assert a.drop_vars("wall_time").load().equals(b.drop_vars("wall_time").load())


def test_a_part_is_refused(tmp_path, physics):
    with pytest.raises(InputError, match="the levels of a refined map need the results of all parts"):
        run(study_of(tmp_path), quiet=True, part="1/2")
    assert not study_of(tmp_path).output.exists()
    with pytest.raises(InputError, match="the levels of a refined map need the results of all parts"):
        make_plan(study_of(tmp_path), "1/2")


def test_the_plan_has_a_bound_and_an_estimate(tmp_path, physics):
    study = study_of(tmp_path, rest=REFINE, transient=1)
    plan = make_plan(study)
    assert plan.counts[MISSING] == 17 * 2 * 17
    assert 0 < plan.n_expected < 17 * 2 * 17
    assert f"at most all {17 * 2 * 17} cases, about {plan.n_expected}" in plan.text()
    physics.n_case = 0  # without those that were timed
    run(study, quiet=True)
    after = make_plan(study)
    assert after.n_expected == physics.n_case
    assert after.steps == 0
    assert after.counts[INFERRED] + after.counts[DONE] == 17 * 2 * 17


def slabs_of(folder, name="slabs"):
    """Ten slabs: five speeds and two clearances, of which only the friction is refined."""
    made = write_study(
        folder,
        f"{name}.toml",
        output=folder / f"{name}.zarr",
        speed_ratio="{ start = 1.0, stop = 2.0, num = 5 }",
        friction="{ start = 0.0, stop = 0.8, num = 33 }",
        run='[refine]\naxes = ["friction"]\ncoarse = 8',
        keep='["section"]',
        block=11,
    )
    return read_study(made)


@pytest.fixture
def by_levels(tmp_path, physics, monkeypatch):
    """The map of `slabs_of` as it is computed level by level, and its cases."""
    with monkeypatch.context() as patch:
        patch.setattr(refining, "_SLABS", 10**9)
        study = slabs_of(tmp_path, "levels")
        run(study, quiet=True)
    n_case, physics.n_case = physics.n_case, 0
    physics.speeds.clear()
    return stored_bytes(study.output), n_case


def test_a_slab_is_computed_with_one_set_up_and_as_by_levels(tmp_path, physics, by_levels):
    study = slabs_of(tmp_path)
    run(study, quiet=True)
    assert len(physics.speeds) == 5
    assert physics.n_case < 0.6 * 5 * 2 * 33
    assert (stored_bytes(study.output), physics.n_case) == by_levels


def on_ranks(study, physics, n_rank, duration=lambda _: 1.0):
    """Run a study on ranks whose cases last as long as `duration` says of their friction; what happened."""
    simulation = Simulation(n_rank)
    plain = physics.run_case

    def run_case(setup, *, friction, **rest):
        simulation.last(duration(friction))
        return plain(setup, friction=friction, **rest)

    def work(pool):
        return driver._run_in(
            pool, lambda: study, Stopping(), retry_failed=False, accept_version=False, quiet=True
        )

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(worker, "run_case", run_case)
        simulation.run(work)
    return simulation


def uneven(friction):
    """Seconds of a case: three of the 17 values of the friction take ten times as long."""
    return 10.0 if round(20 * friction) % 7 == 0 else 1.0


@pytest.mark.parametrize(("n_rank", "keep"), [(2, '["section"]'), (8, '["section"]'), (3, "[]")])
def test_no_rank_waits_for_more_than_a_case(tmp_path, physics, n_rank, keep):
    """Where all axes are refined: once a rank has found nothing left no case begins before all have met."""
    whole = study_of(tmp_path, "whole", keep=keep, friction=COARSE_FRICTION)
    run(whole, quiet=True)
    n_case, physics.n_case = physics.n_case, 0
    study = study_of(tmp_path, keep=keep, friction=COARSE_FRICTION)
    happened = on_ranks(study, physics, n_rank, uneven)
    assert physics.n_case == n_case
    assert stored_bytes(study.output) == stored_bytes(whole.output)
    assert all(n_begun == 0 for _, _, n_begun in happened.waits)
    assert max(end - came for came, end, _ in happened.waits) <= 10.0


def test_blocks_found_damaged_are_completed_by_any_ranks(tmp_path, physics):
    """A map is stopped, all its chunks are damaged, and three ranks go on."""
    whole = study_of(tmp_path, "whole", keep='["section"]', friction=COARSE_FRICTION)
    run(whole, quiet=True)
    study, stopping = study_of(tmp_path, keep='["section"]', friction=COARSE_FRICTION), Stopping()
    physics.n_case = 0
    physics.on_case = lambda: stopping.ask("a test") if physics.n_case == 80 else None
    with pytest.raises(StoppedEarly):
        run(study, quiet=True, stopping=stopping)
    physics.on_case = lambda: None
    chunks = [path for path in (study.output / "section_vertical/c").rglob("*") if path.is_file()]
    assert chunks
    for chunk in chunks:
        data = bytearray(chunk.read_bytes())
        data[-1] ^= 0xFF
        chunk.write_bytes(data)
    n_before = physics.n_case
    on_ranks(study, physics, 3, uneven)
    journals = [path.name for path in (study.output / ".rubhpc/journal").iterdir()]
    assert any("rank_0" in name for name in journals)  # lines after those that mark cases as missing
    verify(study.output)  # marks what no rank has touched since
    run(study, quiet=True)
    assert physics.n_case > n_before
    assert not verify(study.output)
    assert stored_bytes(study.output) == stored_bytes(whole.output)


@pytest.mark.parametrize("moments", [(1,), (60, 20, 9)])
def test_kills_within_slabs_change_nothing(tmp_path, physics, by_levels, moments):
    study = slabs_of(tmp_path)
    run_with_kills(study, physics, moments)
    assert stored_bytes(study.output) == by_levels[0]


def test_blocks_of_a_slab_are_written_once_where_cases_are_short(tmp_path, physics, monkeypatch):
    written = []
    write = Store.write_block

    def note(store, start, data):
        written.append(start)
        write(store, start, data)

    monkeypatch.setattr(Store, "write_block", note)
    monkeypatch.setattr(refining, "_PATIENCE", 1e9)
    run(slabs_of(tmp_path), quiet=True)
    assert len(written) == len(set(written)) > 10
    written.clear()
    monkeypatch.setattr(refining, "_PATIENCE", 0.0)
    run(slabs_of(tmp_path, "at_once"), quiet=True)
    assert len(written) > len(set(written))
