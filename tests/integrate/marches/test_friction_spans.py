"""What is measured of spans between events, by quadrature of the closed form, and by other samples."""

from dataclasses import replace

import numpy as np
import pytest
from closed_form import Contact, simulate
from trial_rig import trial_rig

from rubhpc import LumpedStator, State
from rubhpc.integrate.marches.friction import FrictionMarch
from rubhpc.integrate.measuring.samples import empty_samples, new_accumulator
from rubhpc.integrate.reduced_model.friction_mode import states_of
from rubhpc.integrate.setup import prepare
from rubhpc.kernels.friction_states import OPEN, STUCK
from rubhpc.study.study import Integrator

PER_REVOLUTION, N_REVOLUTION = 64, 3
CASE = {"speed": 120.0, "clearance": "20 um", "friction": 0.6, "friction_law": "coulomb"}


@pytest.fixture(scope="module")
def recorded():
    """A whip of three stators that stick and slide in turns, its record and its trail."""
    contact = Contact(friction_law="coulomb")
    setup = prepare(
        trial_rig(3), 120.0, contact=contact, integrator=Integrator(), samples_per_revolution=PER_REVOLUTION
    )
    march = FrictionMarch(setup, 20e-6, 0.6, State.at_rest(setup.model), None)
    trail, n_sample = march.new_trail(), N_REVOLUTION * PER_REVOLUTION
    march.keep(trail)
    accumulator = new_accumulator(3)
    samples = empty_samples(march.n_place, n_sample)
    assert march.advance(0, n_sample, samples, accumulator, is_recorded=True) is None
    return march, trail, samples, accumulator


def nodes_of(length):
    """Nodes and weights on a span (s): Gauss's on parts that grow from a nanosecond."""
    x, w = np.polynomial.legendre.leggauss(20)
    ends = np.concatenate([[0.0], np.geomspace(min(1e-9, 0.5 * length), length, 40)])
    half = 0.5 * np.diff(ends)[:, None]
    return ((ends[:-1, None] + half) + half * x).ravel(), (half * w).ravel()


def test_impulses_and_works_are_those_of_a_quadrature(recorded):
    march, trail, samples, accumulator = recorded
    n_event, tick, rim_speed = int(trail.n_event[0]), march.clock.tick, march.bodies.rim_speed
    assert n_event > 50
    ends = np.append(trail.tick[:n_event], N_REVOLUTION * PER_REVOLUTION << march.clock.sample_level)
    impulse, work, stuck = trail.given[:n_event, 0].sum(axis=0), np.zeros(3), np.zeros(3)
    begin = 0
    for k, end in enumerate(ends):
        mask = int(trail.states[k])
        march.find(mask)
        tables, place = march.tables, march.tables.mask.tolist().index(mask)
        (real, imaginary), drift = march.exponents(mask)
        length = (end - begin) * tick
        time, weight = nodes_of(length)
        z = (trail.begun[k, 0] + 1j * trail.begun[k, 1])[:, None]
        z = z * np.exp((real + 1j * imaginary)[:, None] * time) + drift[:, None] * time
        rows = (tables.switch_re[place] + 1j * tables.switch_im[place]) @ z
        for i, state in enumerate(states_of(mask, 3)):
            first, second = rows[2 * i].real, rows[2 * i + 1].real
            if state == STUCK:
                impulse[i] += weight @ (first + second) / (2.0 * 0.6)
                stuck[i] += length
            elif state != OPEN:
                impulse[i] += weight @ first
                work[i] += 0.6 * weight @ (first * second)
        if k < n_event and trail.given[k].any():  # with the mean of the slips before and after
            n = march.bodies.stiffness.shape[0]
            decayed = np.exp((real + 1j * imaginary) * length)
            now = (trail.begun[k, 0] + 1j * trail.begun[k, 1]) * decayed + drift * length
            motion = ((tables.motion_re[place] + 1j * tables.motion_im[place]) @ now).real
            before = rim_speed + march.bodies.slip @ motion[n:]
            struck = trail.given[k, 0] != 0.0
            work[struck] += (trail.given[k, 1] * 0.5 * (before + trail.rate[k, 1]))[struck]
        begin = end
    assert accumulator.impulse == pytest.approx(impulse, rel=1e-8)
    assert accumulator.friction_work == pytest.approx(work, rel=2e-5)
    assert accumulator.stick_time == pytest.approx(stuck, rel=1e-9)
    assert (stuck > 0.0).all()
    sampled = samples.force.sum(axis=1) * tick * 2.0**march.clock.sample_level
    assert sampled == pytest.approx(accumulator.impulse, rel=1e-12)


@pytest.mark.parametrize("per_revolution", [8192, 65536])
def test_a_record_of_many_samples_is_that_of_few(per_revolution):
    """Flights of thousands of samples are spans of their own."""
    given = CASE | {"friction": 0.2, "transient": 0, "revolutions": 2}
    given["keep"] = ("waveform",)
    few = simulate(trial_rig(1), **given, samples_per_revolution=64)
    many = simulate(trial_rig(1), **given, samples_per_revolution=per_revolution)
    every = per_revolution // 64
    assert few.contact_impulse[0] > 0.0
    assert many.contact_impulse == pytest.approx(few.contact_impulse, rel=1e-6)
    assert many.peak_contact_force == pytest.approx(few.peak_contact_force, rel=1e-4)
    scale = np.abs(few.vertical).max()
    np.testing.assert_allclose(many.vertical[::every], few.vertical, atol=1e-6 * scale)
    means = many.contact_force[0].reshape(-1, every).mean(axis=1)
    np.testing.assert_allclose(means, few.contact_force[0], atol=1e-6 * few.contact_force.max())


def test_peaks_of_walls_are_those_of_steady_sliding():
    """A wall gives an impulse and then a force that grows within the averaging time; slips never reverse."""
    walls = tuple(LumpedStator(node=3, rigid=True, angle=0.3 + 0.5 * np.pi * i) for i in range(4))
    rig, case = replace(trial_rig(1), stator=walls), CASE | {"friction": 0.2, "clearance": "40 um"}
    case |= {"speed": 300.0, "transient": 0, "revolutions": 2, "samples_per_revolution": 64}
    set_valued, steady = (simulate(rig, **case | {"friction_law": law}) for law in ("coulomb", "sliding"))
    assert set_valued.minimum_slip_speed.min() > 0.0
    assert set_valued.peak_contact_force == pytest.approx(steady.peak_contact_force, rel=2e-6)
