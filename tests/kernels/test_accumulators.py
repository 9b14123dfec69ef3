"""What is gathered while a case runs, against a recount from every step's state."""

from dataclasses import replace

import numpy as np
import pytest
from calling import called
from closed_form import read_rig
from kernel_case import KernelCase

from rubhpc.kernels.accumulators import (
    DAMPING_LOSS,
    DRIVE_WORK,
    FRICTION_LOSS,
    HORIZONTAL,
    IMPACT_LOSS,
    TWIST,
    TWIST_ACCELERATION,
    UNBALANCE_WORK,
    VERTICAL,
    observe_contact,
)
from rubhpc.kernels.central_difference.march import FINISHED
from rubhpc.kernels.contact_pairs import AXIAL, LATERAL, TORSION
from rubhpc.rig.parts import Bearing

observe_contact = called(observe_contact)

PACKAGED = read_rig("mokhtar2017")
RIG = replace(
    PACKAGED,
    stator=tuple(
        replace(PACKAGED.stator[0], angle=angle, lateral=lateral)
        for angle, lateral in ((0.2, True), (0.5, True), (2.5, False))
    ),
    rotor=replace(
        PACKAGED.rotor,
        bearing=(
            Bearing(node=1, kyy=1e6, kzz=2e6, kyz=3e5, kzy=-2e5, cyy=200.0, czz=100.0, cyz=30.0, czy=-10.0),
            Bearing(node=15, stiffness=8e5, damping=50.0),
        ),
    ),
)
FRICTION, CLEARANCE, RADIUS, N_STEP = 0.3, 1e-5, 0.06, 12_000


class Watched:
    """A case advanced step by step, all of its states kept: displacements, centred velocities, (n, n_dof)."""

    def __init__(self, spin, is_updated):
        per_revolution = round(2 * np.pi / abs(spin) / 2e-6)
        self.case = case = KernelCase.of(
            RIG,
            spin,
            per_revolution,
            clearance=CLEARANCE,
            friction=FRICTION,
            is_updated=is_updated,
            n_sample=N_STEP,
        )
        thrown = {"v": 0.5, "w": 0.2, "thx": 2.0}
        velocity = np.array([thrown.get(name, 0.0) for _, name in case.model.rotor.degrees])
        row = case.packed.row[: velocity.size]
        case.state[1, row[row >= 0]] = velocity[row >= 0]
        states, forces, free = [case.state.copy()], [], []
        for i in range(N_STEP):
            assert case.advance(i, i + 1, is_recorded=True) == FINISHED
            states.append(case.state.copy())
            forces.append(case.work.force.copy())
            free.append(case.work.at.copy())
        states = np.array(states)
        self.displacement = states[:-1, 0]
        self.velocity = (states[:-1, 1] + states[1:, 1]) / 2
        self.acceleration = (states[1:, 1] - states[:-1, 1]) / case.step
        self.force = np.array(forces)
        self.is_updated, self.spin = is_updated, spin
        self.axis = case.pairs.axis_y + 1j * case.pairs.axis_z
        self.free = np.array(free)  # (n, q, 5), pairs' degrees at the end of the step had nothing touched

    def degree(self, values, a):
        """A degree of each pair, (n, q); zero where it is held."""
        rows = self.case.pairs.row[:, a]
        return np.where(rows >= 0, values[:, rows], 0.0)

    def apart(self, degrees):
        """From disc to tip of each pair as complex numbers y + i z, (n, q), with degrees (n, q, 5)."""
        v, w, _, axial, lateral = np.moveaxis(degrees, 2, 0)
        return (axial + 1j * lateral) * self.axis - (v + 1j * w)

    def rates(self):
        """Opening of the gap and slip of the rim, (n, q), m/s."""
        line = (RADIUS + CLEARANCE) * self.axis + self.apart(self.free)
        n = line / abs(line) if self.is_updated else self.axis
        apart = self.apart(np.stack([self.degree(self.velocity, a) for a in range(5)], axis=2))
        opening = (apart * n.conj()).real
        twist = self.degree(self.velocity, TORSION)
        slip = RADIUS * (self.spin + twist) - (apart * (1j * n).conj()).real
        return opening, np.sign(self.spin) * slip


@pytest.fixture(scope="module", params=[(900.0, False), (-900.0, False), (900.0, True)], ids=str)
def watched(request):
    return Watched(*request.param)


def test_samples_are_the_states_at_their_instants(watched):
    samples, rows = watched.case.samples, watched.case.packed.output_row
    for k, row in zip((VERTICAL, HORIZONTAL, TWIST), rows, strict=True):
        assert np.array_equal(samples.rotor[k], watched.displacement[:, row])
    assert np.array_equal(samples.rotor[TWIST_ACCELERATION], watched.acceleration[:, rows[2]])
    assert np.array_equal(samples.axial.T, watched.degree(watched.displacement, AXIAL))
    assert np.array_equal(samples.lateral.T, watched.degree(watched.displacement, LATERAL))
    assert not samples.lateral[2].any()  # the stator without lateral freedom
    assert np.array_equal(samples.force.T, watched.force)


def test_extrema_are_those_of_all_steps(watched):
    accumulator, motion = watched.case.accumulator, watched.displacement[:, watched.case.packed.output_row]
    assert np.array_equal(accumulator.highest, motion.max(axis=0))
    assert np.array_equal(accumulator.lowest, motion.min(axis=0))
    lateral = watched.degree(watched.displacement, LATERAL)
    assert np.array_equal(accumulator.peak_lateral, abs(lateral).max(axis=0))


def test_a_peak_force_is_a_mean():
    """Over 20 us: what a step of 1 us adds is a twentieth of its force."""
    case = KernelCase.of(RIG, 900.0, 3000, clearance=CLEARANCE, friction=FRICTION, n_sample=1)
    still = np.zeros(case.state.shape[1])
    steps = ((500.0, 25.0), (0.0, 25.0), (300.0, 40.0), (20.0, 41.0), *[(0.0, 41.0)] * 30, (90.0, 41.0))
    for n, (force, peak) in enumerate(steps):
        case.work.force[1] = force
        observe_contact(case.pairs, case.work, 900.0, 1e-6 * n, 1e-6, still, still, case.accumulator)
        assert case.accumulator.peak_force == pytest.approx([0.0, peak, 0.0])
    assert case.accumulator.impulse[1] == pytest.approx(910e-6)


def test_contacts_are_counted_where_they_begin(watched):
    accumulator, is_touching = watched.case.accumulator, watched.force > 0
    begins = is_touching & ~np.vstack([np.zeros((1, 3), bool), is_touching[:-1]])
    assert np.array_equal(accumulator.n_contact, begins.sum(axis=0))
    assert accumulator.contact_time == pytest.approx(is_touching.sum(axis=0) * watched.case.step)
    assert accumulator.n_contact.min() >= 1
    assert accumulator.n_contact.max() > 1
    assert (is_touching.sum(axis=1) > 1).any()
    assert np.array_equal(accumulator.is_touching, is_touching[-1])


def test_impulse_slip_and_friction_work_add_up(watched):
    accumulator, force, step = watched.case.accumulator, watched.force, watched.case.step
    _, slip = watched.rates()
    assert accumulator.impulse == pytest.approx(force.sum(axis=0) * step)
    assert accumulator.friction_work == pytest.approx(FRICTION * (force * slip).sum(axis=0) * step, rel=1e-6)
    assert accumulator.least_slip == pytest.approx(np.where(force > 0, slip, np.inf).min(axis=0), rel=1e-6)


def test_energies_are_work_along_the_path(watched):
    case, energy, step, velocity = (
        watched.case,
        watched.case.accumulator.energy,
        watched.case.step,
        watched.velocity,
    )
    opening, slip = watched.rates()
    assert energy[DRIVE_WORK] == pytest.approx(FRICTION * RADIUS * 900.0 * watched.force.sum() * step)
    assert energy[FRICTION_LOSS] == pytest.approx(FRICTION * (watched.force * slip).sum() * step, rel=1e-6)
    through = (watched.force * abs(opening)).sum() * step
    assert energy[IMPACT_LOSS] == pytest.approx(-(watched.force * opening).sum() * step, abs=1e-7 * through)
    if not watched.is_updated:  # a normal that turns within a step does a little work of its own
        assert energy[IMPACT_LOSS] > 0
    turned = np.exp(1j * watched.spin * step * np.arange(N_STEP))
    v, w = case.packed.output_row[:2]
    pull = 0.008 * 0.045 * watched.spin**2 * turned
    work = (pull.real * velocity[:, v] + pull.imag * velocity[:, w]).sum() * step
    assert energy[UNBALANCE_WORK] == pytest.approx(work, rel=1e-6)
    # Taken with velocities half a step earlier, which differs by a share of the first and last step's loss.
    skew = (case.packed.stiffness - case.packed.stiffness.T) / 2
    loss = np.einsum("ni,ij,nj->", velocity, case.packed.damping, velocity)
    loss += np.einsum("ni,ij,nj->", velocity, skew, watched.displacement)
    assert energy[DAMPING_LOSS] == pytest.approx(loss * step, rel=1e-3)
