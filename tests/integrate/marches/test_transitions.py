"""Transitions from contact mode to contact mode, against leaving the one and entering the other."""

from dataclasses import replace

import numpy as np
import pytest
from calling import called
from trial_rig import trial_rig

from rubhpc import State
from rubhpc.integrate.marches.friction import FrictionMarch
from rubhpc.integrate.measuring.samples import empty_samples, new_accumulator
from rubhpc.integrate.reduced_model import transitions
from rubhpc.integrate.reduced_model.transitions import MetTransitions, TransitionRoom
from rubhpc.integrate.setup import prepare
from rubhpc.integrate.tangent_motion import TangentMotion
from rubhpc.kernels.contact_modes import SAMPLES_AT_ONCE
from rubhpc.kernels.friction_coordinates import energies_gained, used_width
from rubhpc.kernels.friction_spans import AT_ONCE, new_spans, whole_rows
from rubhpc.kernels.friction_work import still_rub
from rubhpc.kernels.product_forms import forms_gained
from rubhpc.kernels.span_samples import read_rows
from rubhpc.kernels.transitions import UNKNOWN, WORTH_A_TABLE, add_impulses, pass_over, see
from rubhpc.study.study import Contact, Integrator, Recording

add_impulses = called(add_impulses)
energies_gained = called(energies_gained)
forms_gained = called(forms_gained)
pass_over = called(pass_over)
read_rows = called(read_rows)
still_rub = called(still_rub)

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


def tables_of(march, before, after):
    """All of a transition, whatever a case has passed."""
    met = MetTransitions(TransitionRoom())
    met._entry[before, after] = UNKNOWN - WORTH_A_TABLE
    assert met.is_due(before, after, is_counted=True)
    modes = [march._tables_of(mask) for mask in (before, after)]
    growing = march.exponents(before), march.exponents(after)
    met.tabulate(*modes, growing, march.bodies, march._friction)
    return met.among(march.tables)


def nodes_of(length):
    """Nodes and weights on a span (s): Gauss's on parts that grow from a nanosecond."""
    x, w = np.polynomial.legendre.leggauss(20)
    ends = np.concatenate([[0.0], np.geomspace(1e-9, length, 40)])
    half = 0.5 * np.diff(ends)[:, None]
    return ((ends[:-1, None] + half) + half * x).ravel(), (half * w).ravel()


def pairs_of_modes(march):
    masks = [mask for mask in march.tables.mask.tolist() if mask >= 0]
    return [(a, b) for a in masks for b in masks if a != b]


def entered(march, mode, motion, angle):
    stands = march._z.copy()
    march._enter_at(mode, march._entered_with, np.cos(angle), np.sin(angle), motion)
    found = march._z.copy()
    march._z[:] = stands
    return found


def test_a_transition_is_leaving_and_entering(settled):
    rng, march = np.random.default_rng(1), settled
    masks = march.tables.mask.tolist()
    for before, after in pairs_of_modes(march):
        transitions = tables_of(march, before, after)
        here, there = masks.index(before), masks.index(after)
        z = entered(march, here, rng.standard_normal(march._motion.size), 0.3)
        first, m = march.tables.n_eigenmode[there], z.shape[1]
        wanted = entered(march, there, march._motion_in(here, z), 0.3)
        found = np.zeros_like(z)
        pass_over(transitions, transitions.entry[here, there], m, z, found)
        found[:, first : first + 2 + march.bodies.radius.size] = wanted[
            :, first : first + 2 + march.bodies.radius.size
        ]
        for seen in (march._motion_in(there, found), march.forces(there, found)):
            expected = march._motion_in(there, wanted), march.forces(there, wanted)
            known = expected[0] if seen.size == expected[0].size else expected[1]
            np.testing.assert_allclose(seen, known, rtol=1e-9, atol=1e-9 * np.abs(known).max())


def test_what_an_event_sees_and_gives(settled):
    rng, march = np.random.default_rng(2), settled
    bodies, n = march.bodies, march.bodies.stiffness.shape[0]
    q = bodies.radius.size
    before, after = next(pair for pair in pairs_of_modes(march) if pair[0] == 0)
    transitions = tables_of(march, before, after)
    mode = march.tables.mask.tolist().index(before)
    z = entered(march, mode, rng.standard_normal(2 * n), 0.0)
    motion, m = march._motion_in(mode, z), z.shape[1]
    for i in range(q):
        rows = np.stack(
            [
                np.concatenate([np.zeros(n), bodies.gap_jacobian[i]]),
                np.concatenate([np.zeros(n), bodies.slip[i]]),
                *march._friction.pull[[i, q + i]],
            ]
        )
        known = rows @ motion
        size = np.abs(rows) @ np.abs(motion)
        assert np.all(
            np.abs(see.py_func(transitions, mode, m, i, m, z) - known) < 1e-9 * size
        )  # closed gaps cancel
    given = rng.standard_normal((2, q))
    struck = z.copy()
    add_impulses(transitions, mode, q, m, given, struck)
    change = march._motion_in(mode, struck) - motion
    kicked = motion.copy()
    kicked[n:] += given[0] @ bodies.gap_jacobian - given[1] @ bodies.slip
    wanted = march._motion_in(mode, entered(march, mode, kicked, 0.0))
    wanted -= march._motion_in(mode, entered(march, mode, motion, 0.0))
    np.testing.assert_allclose(change, wanted, rtol=0.0, atol=1e-9 * np.abs(wanted).max())


def growths(transitions, place, begun, ended):
    """Growth of a form in spans between coordinates (n, 2, m), read together."""
    count, m = len(begun), begun.shape[2]
    spans = new_spans(m, 3, 0)
    spans.begun[:count], spans.ended[:count] = begun, ended
    spans.alike[:count] = np.arange(count)
    forms_gained(transitions, place, spans, spans.alike, count, m, spans.gained)
    return spans.gained[:count]


@pytest.mark.parametrize("count", [1, 3, AT_ONCE])
def test_losses_by_blocks_are_those_of_the_whole_form(settled, count):
    rng, march = np.random.default_rng(3), settled
    for before, after in pairs_of_modes(march)[:6]:
        transitions = tables_of(march, before, after)
        for mask in (before, after):
            mode = march.tables.mask.tolist().index(mask)
            used = used_width.py_func(march.tables, mode)
            first, second = np.zeros((2, count, 2, march._z.shape[1]))
            first[..., :used], second[..., :used] = rng.standard_normal((2, count, 2, used))
            found = growths(transitions, transitions.energy[mode], first, second)
            for begun, ended, gained in zip(first, second, found, strict=True):
                known, form = np.zeros(2), march.tables.loss[mode]
                energies_gained(march.tables, mode, begun, ended, known)
                size = np.abs(ended.ravel()) @ np.abs(form) @ np.abs(ended.ravel())
                assert abs(known[0] - gained) < 1e-12 * size


def test_a_form_gives_force_times_slip(settled):
    """Against Gauss's quadrature on parts that grow from a nanosecond."""
    rng, march = np.random.default_rng(5), settled
    masks, n_form = march.tables.mask.tolist(), 0
    for before, after in pairs_of_modes(march):
        transitions = tables_of(march, before, after)
        mode = masks.index(after)
        for i in np.flatnonzero(transitions.rub[mode] >= 0).tolist():
            begun = entered(march, mode, march._motion * rng.uniform(0.5, 1.5, march._motion.size), 0.7)
            (real, imaginary), drift = march.exponents(after)
            length = 10.0 ** rng.uniform(-5.0, -3.0)
            time, weight = nodes_of(length)
            times = np.append(time, length)
            z = (begun[0] + 1j * begun[1])[:, None] * np.exp((real + 1j * imaginary)[:, None] * times)
            z += drift[:, None] * times
            rows = march.tables.switch_re[mode] + 1j * march.tables.switch_im[mode]
            force, slip = ((rows[k] @ z).real[:-1] for k in (2 * i, 2 * i + 1))
            ended = np.stack([z[:, -1].real, z[:, -1].imag])
            found = growths(transitions, transitions.rub[mode, i], begun[None], ended[None])[0]
            found += still_rub(march.tables, mode, i, length, begun, ended)
            assert abs(found - weight @ (force * slip)) < 1e-9 * (weight @ np.abs(force * slip))
            n_form += 1
    assert n_form > 5


def test_rows_give_the_outputs(settled):
    rng, march = np.random.default_rng(6), settled
    before, after = pairs_of_modes(march)[0]
    transitions, mode = tables_of(march, before, after), march.tables.mask.tolist().index(after)
    used, m = used_width.py_func(march.tables, mode), march._z.shape[1]
    n_row = march.tables.output.shape[2] // SAMPLES_AT_ONCE
    width, point = whole_rows(n_row), np.zeros((SAMPLES_AT_ONCE, 2, m))
    point[..., :used] = rng.standard_normal((SAMPLES_AT_ONCE, 2, used))
    known = point.reshape(SAMPLES_AT_ONCE, -1) @ march.tables.output[mode, :, :n_row]
    for count in (1, 2, 7, 8):
        value = np.full((SAMPLES_AT_ONCE, width), np.nan)
        read_rows(transitions.value[transitions.output[mode] :], width, used, m, point, count, value.ravel())
        found = value[:count, :n_row]
        np.testing.assert_allclose(found, known[:count], rtol=0.0, atol=1e-12 * np.abs(known).max())


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
