"""Transitions from contact mode to contact mode, against leaving the one and entering the other."""

from dataclasses import replace

import numpy as np
import pytest
from trial_rig import trial_rig

from rubhpc import State
from rubhpc.integrate.marches.friction import FrictionMarch
from rubhpc.integrate.measuring.samples import empty_samples, new_accumulator
from rubhpc.integrate.reduced_model import transitions
from rubhpc.integrate.setup import prepare
from rubhpc.integrate.tangent_motion import TangentMotion
from rubhpc.study.study import Contact, Integrator, Recording

PER_REVOLUTION = 64
LAW = {
    "contact": Contact(friction_law="coulomb"),
    "integrator": Integrator(),
    "samples_per_revolution": PER_REVOLUTION,
}


def whip(setup=None, n_stator=3):
    setup = setup or prepare(trial_rig(n_stator), 120.0, **LAW)
    return FrictionMarch(setup, 20e-6, 0.6, State.at_rest(setup.model), None)


def advance(march, n_revolution):
    nothing = empty_samples(march.n_place, 0), new_accumulator(march.touching().size)
    first = -n_revolution * PER_REVOLUTION
    assert march.advance(first, 0, *nothing, is_recorded=False) is None
    return march.motion()


@pytest.fixture(scope="module")
def settled():
    march = whip()
    advance(march, 60)
    return march


def test_a_record_measures_alike_with_tables_and_without(settled):
    state, found = settled.final(), []
    for met in (settled._met, None):
        march = whip(settled.setup)
        march._met = met
        march.start_again(state)
        samples, accumulator = empty_samples(march.n_place, 2 * PER_REVOLUTION), new_accumulator(3)
        assert march.advance(0, 2 * PER_REVOLUTION, samples, accumulator, is_recorded=True) is None
        found.append((samples, accumulator))
    (samples, sums), (plain, known) = found
    assert known.friction_work.all()
    assert sums.friction_work == pytest.approx(known.friction_work, rel=1e-5)
    assert sums.energy == pytest.approx(known.energy, rel=1e-5)
    for name in ("impulse", "contact_time", "stick_time", "peak_force", "highest", "lowest", "peak_lateral"):
        assert getattr(sums, name) == pytest.approx(getattr(known, name), rel=1e-7), name
    assert sums.least_slip == pytest.approx(known.least_slip, abs=1e-6)
    size = np.abs(plain.whole).max(axis=1, keepdims=True)
    assert np.all(np.abs(samples.whole - plain.whole) <= 1e-7 * size)


def test_a_case_goes_on_alike_with_tables_and_without(settled):
    assert (settled.transitions.entry >= 0).sum() > 5
    plain, other = whip(), whip(settled.setup)
    other._met = settled._met
    state, motions = settled.final(), []
    for march in (plain, other):
        march.start_again(state)
        motions.append(advance(march, 1))
    assert (plain.transitions.entry < 0).all()
    np.testing.assert_allclose(*motions, rtol=0.0, atol=1e-9 * np.abs(motions[0]).max())


def test_the_tangent_goes_alike_with_tables_and_without(settled):
    state, grown = settled.final(), []
    recording = Recording(transient=0, revolutions=1, samples_per_revolution=PER_REVOLUTION, keep=())
    for met in (settled._met, None):
        march = whip(settled.setup)
        march._met = met
        tangent = TangentMotion(lambda state: whip(), state, settled.setup, recording, march=march)
        grown.append([tangent.part(1) for _ in range(2)])
    assert grown[0] == pytest.approx(grown[1], abs=1e-8)


def test_a_case_does_not_depend_on_tables_that_others_have_made(settled):
    alone, after_another = whip(), whip(settled.setup)
    assert not alone.library.transitions
    assert after_another.library.transitions
    assert advance(alone, 10).tobytes() == advance(after_another, 10).tobytes()


def test_a_case_that_finds_the_room_full_begins_another(settled, monkeypatch):
    """The one that is under way keeps its places."""
    march, before = whip(), settled.library.transitions
    monkeypatch.setattr(transitions, "MOST_SHARED", 0)
    others = whip(settled.setup)
    assert settled._met._room is before
    assert others._met._room is settled.library.transitions is not before
    assert advance(others, 10).tobytes() == advance(march, 10).tobytes()
    settled.library.transitions = before


def test_rings_whose_modes_may_be_given_up_have_no_tables():
    assert whip(n_stator=2).library.transitions is not None
    assert whip(n_stator=1).library.transitions is None
    rig = trial_rig(3)
    ring = replace(rig, stator=rig.stator + tuple(replace(one, angle=one.angle + 3.0) for one in rig.stator))
    assert whip(prepare(ring, 120.0, **LAW)).library.transitions is None


def test_passages_count_alike_where_the_library_lacks_a_mode(settled):
    """Large tables are of two kinds, and a mode may be given up: what others have left decides nothing."""
    counts = []
    for forgets in (False, True):
        march = whip()
        advance(march, 3)
        state = march.final()
        if forgets:
            march.library.forget()
        march.start_again(state)
        advance(march, 3)
        march._met._note_passages()
        counts.append(march._met._entry)
    assert counts[0] == counts[1]
