"""The paper's integrator: its equations as printed, its conservation laws, its limit and its ways to fail."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from kernel_case import KernelCase
from scipy.linalg import block_diag, eigh

from rubhpc import read_rig
from rubhpc.fem.assemble import assemble
from rubhpc.fem.response import step_limit
from rubhpc.kernels.central_difference import CONTACT_UNSOLVED, DIVERGED, FINISHED
from rubhpc.kernels.contact_pairs import AXIAL, LATERAL, TORSION, V, W
from rubhpc.rig.forces import Unbalance
from rubhpc.rig.parts import Bearing
from rubhpc.rig.reading import with_keys

PACKAGED = read_rig("mokhtar2017")
STATOR = PACKAGED.stator[0]
# What the packaged rig lacks: other stators, unbalances, and bearings that couple the planes.
COUPLED = replace(
    PACKAGED,
    stator=(
        replace(STATOR, angle=0.3),
        replace(STATOR, angle=0.5, lateral=False, youngs_modulus=1e9),
        replace(STATOR, angle=2.4, node=5, radius=0.03, clearance_offset=2e-6),
    ),
    rotor=replace(
        PACKAGED.rotor,
        unbalance=(*PACKAGED.rotor.unbalance, Unbalance(node=4, mass=0.01, radius=0.02, phase=1.0)),
        bearing=(
            Bearing(node=1, kyy=1e6, kzz=2e6, kyz=3e5, kzy=-2e5, cyy=200.0, czz=100.0, cyz=30.0, czy=-10.0),
            Bearing(node=15, stiffness=8e5, damping=50.0),
        ),
    ),
)
RADIUS = 0.06
UNDAMPED = {"rotor.damping.alpha": 0.0, "stator.damping.beta": 0.0, "rotor.unbalance.mass": 0.0}


class PaperScheme:
    """Eqs. 20 to 24 as printed: dense, in displacements of three instants, degrees in the model's order."""

    def __init__(self, model, spin, step, clearance, friction):
        bodies = model.bodies
        M = block_diag(*(body.mass for body in bodies))
        C = block_diag(*(body.damping + spin * body.gyroscopic for body in bodies))
        self.K = block_diag(*(body.stiffness for body in bodies))
        self.M_over_h2, self.C_over_2h = M / step**2, C / (2 * step)
        self.inverse = np.linalg.inv(self.M_over_h2 + self.C_over_2h)
        n = len(M)
        self.cosine, self.sine = np.zeros((2, n))
        self.cosine[: model.rotor.n_dof] = spin**2 * model.unbalance_cosine
        self.sine[: model.rotor.n_dof] = spin**2 * model.unbalance_sine
        q = len(model.stators)
        self.gap_at_rest = clearance + np.array([stator.clearance_offset for stator in model.stators])
        self.G_N, self.G_T = np.zeros((2, q, n))
        first = model.rotor.n_dof
        for i, stator in enumerate(model.stators):
            v, w, thx = (model.rotor.index(stator.node, name) for name in ("v", "w", "thx"))
            cosine, sine = math.cos(stator.angle), math.sin(stator.angle)
            self.G_N[i, [v, w, first + stator.axial]] = -cosine, -sine, 1.0
            # minus the slip of the rim on the tip, t = (-sine, cosine)
            self.G_T[i, [v, w, thx]] = sine, -cosine, -stator.radius
            if stator.lateral >= 0:
                self.G_T[i, first + stator.lateral] = 1.0
            first += stator.body.n_dof
        self.G_NT = self.G_N + math.copysign(friction, spin) * self.G_T

    def step(self, before, now, angle):
        force = self.cosine * math.cos(angle) + self.sine * math.sin(angle)
        free = self.inverse @ (
            force - (self.K - 2 * self.M_over_h2) @ now - (self.M_over_h2 - self.C_over_2h) @ before
        )
        gap = self.gap_at_rest + self.G_N @ free
        if (gap >= 0).all():
            return free, np.zeros(gap.size)
        compliance = self.G_N @ self.inverse @ self.G_NT.T
        for size in range(1, gap.size + 1):
            for chosen in map(list, itertools.combinations(range(gap.size), size)):
                multiplier = np.zeros(gap.size)
                multiplier[chosen] = np.linalg.solve(compliance[np.ix_(chosen, chosen)], gap[chosen])
                if (multiplier <= 0).all() and (gap - compliance @ multiplier >= -1e-15).all():
                    return free - self.inverse @ self.G_NT.T @ multiplier, -multiplier
        raise AssertionError("no set of touching pairs")


@pytest.mark.parametrize("spin", [400.0, -400.0])
def test_steps_are_those_of_the_paper(spin):
    """The disc thrown between two stators; both touch, at times together."""
    clearance, friction, n_step = 20e-6, 0.4, 400
    case = KernelCase.of(COUPLED, spin, 31_000, clearance=clearance, friction=friction, n_sample=n_step)
    scheme = PaperScheme(case.model, spin, case.step, clearance, friction)
    row = case.packed.row
    velocity = np.zeros(len(row))
    for i, (_, name) in enumerate(case.model.rotor.degrees):
        velocity[i] = {"v": 0.9, "w": 0.4, "thx": 3.0}.get(name, 0.0)
    case.state[1, row[row >= 0]] = velocity[row >= 0]
    before, now = -case.step * velocity, np.zeros(len(row))
    forces = []
    for i in range(n_step):
        angle = math.copysign(2 * math.pi * i / 31_000, spin)
        after, force = scheme.step(before, now, angle)
        before, now = now, after
        forces.append(force)
        assert case.advance(i, i + 1, is_recorded=True) == FINISHED
        assert case.work.force == pytest.approx(force, rel=1e-6, abs=1e-6)
    seen = row >= 0
    assert case.state[0, row[seen]] == pytest.approx(now[seen], rel=1e-7, abs=1e-12)
    assert not now[~seen].any()  # what the kernel leaves out stays at rest
    forces = np.array(forces)
    assert (forces[:, :2].max(axis=0) > 10.0).all()
    assert ((forces > 0).sum(axis=1) == 2).any()
    assert case.samples.force == pytest.approx(forces.T, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("spin", [300.0, -300.0])
@pytest.mark.parametrize("quarter", range(4))
def test_unbalance_pulls_along_its_angle(spin, quarter):
    phase = 0.7
    rig = with_keys(PACKAGED, {"rotor.unbalance.phase": phase})
    case = KernelCase.of(rig, spin, 40_000)
    case.advance(quarter * 10_000, quarter * 10_000 + 1)
    force = (case.packed.mass + case.step / 2 * case.packed.damping) @ case.state[1] / case.step
    v, w, _ = case.packed.output_row
    angle = math.copysign(quarter * math.pi / 2, spin)
    expected = 0.008 * 0.045 * spin**2 * np.exp(1j * (angle + phase))
    assert complex(force[v], force[w]) == pytest.approx(expected)


@pytest.mark.parametrize("spin", [300.0, -300.0])
@pytest.mark.parametrize("angle", np.linspace(0, 2 * math.pi, 7))
def test_contact_force_keeps_to_coulombs_law_at_every_whirl_angle(angle, spin):
    """Taken from the equations of motion, with and without the stator in reach, far off the stator's axis."""
    friction, sense = 0.35, math.copysign(1.0, spin)
    rig = with_keys(PACKAGED, {"stator.angle": angle})
    touching, free = (
        KernelCase.of(rig, spin, 40_000, clearance=clearance, friction=friction, is_updated=True)
        for clearance in (1e-3, 1.0)
    )
    row = touching.pairs.row[0]
    axis = np.exp(1j * angle)
    for case in (touching, free):
        case.state[0, row[AXIAL]] = -12e-3
        case.state[0, row[LATERAL]] = 0.03
        assert case.advance(0, 1) == FINISHED
    force = touching.work.force[0]
    assert force > 0
    assert free.work.force[0] == 0
    effective = touching.packed.mass + touching.step / 2 * touching.packed.damping
    added = effective @ (touching.state[1] - free.state[1]) / touching.step
    at_contact = free.state[0]
    tip = (RADIUS + 1e-3 + at_contact[row[AXIAL]] + 1j * at_contact[row[LATERAL]]) * axis
    line = tip - complex(at_contact[row[V]], at_contact[row[W]])
    n = line / abs(line)
    assert abs(np.angle(n / axis)) > 0.4  # far off indeed
    on_disc = -force * n * (1 + 1j * friction * sense)
    assert complex(added[row[V]], added[row[W]]) == pytest.approx(on_disc, rel=1e-6)
    assert added[row[TORSION]] == pytest.approx(-sense * friction * force * RADIUS, rel=1e-6)
    assert complex(added[row[AXIAL]], added[row[LATERAL]]) * axis == pytest.approx(-on_disc, rel=1e-6)
    others = np.setdiff1d(np.arange(len(added)), row)
    assert abs(added[others]).max() < 1e-6 * force


def thrown(rig, spin, per_revolution, **changed):
    """A case that starts with random velocities, the same for every call."""
    case = KernelCase.of(rig, spin, per_revolution, **changed)
    case.state[1] = np.random.default_rng(5).normal(scale=0.1, size=case.state.shape[1])
    return case


def test_pieces_of_a_run_are_the_run():
    n_sample = 3000
    whole, pieces = (
        thrown(COUPLED, 500.0, 26_000, clearance=3e-5, is_updated=True, n_sample=n_sample) for _ in range(2)
    )
    assert whole.advance(0, n_sample, is_recorded=True) == FINISHED
    for first, last in itertools.pairwise([0, 1, 2, 800, 1999, 2000, n_sample]):
        assert pieces.advance(first, last, is_recorded=True) == FINISHED
    assert np.array_equal(whole.state, pieces.state)
    for name in whole.samples._fields:
        assert np.array_equal(getattr(whole.samples, name), getattr(pieces.samples, name)), name
    assert np.count_nonzero(whole.samples.force) > 100
    for name in whole.accumulator._fields:
        assert np.array_equal(getattr(whole.accumulator, name), getattr(pieces.accumulator, name)), name


def longest_stable_step(case):
    """2 / omega_max, from the packed matrices."""
    return 2 / math.sqrt(eigh(case.packed.stiffness, case.packed.mass, eigvals_only=True).max())


# A step this share above the limit: a damped mode grows slowly there.
@pytest.mark.parametrize(("changed", "excess"), [(UNDAMPED, 5e-4), ({"rotor.damping.beta": 1e-6}, 5e-3)])
def test_step_is_stable_up_to_its_limit(changed, excess):
    rig = with_keys(PACKAGED, changed)
    limit = longest_stable_step(KernelCase.of(rig, 300.0, 10_000))
    assert limit == pytest.approx(step_limit(assemble(rig)), rel=1e-6)
    below, above = (
        thrown(rig, 2 * math.pi / (10_000 * share * limit), 10_000) for share in (1 - excess, 1 + excess)
    )
    assert below.advance(0, 20_000) == FINISHED
    assert abs(below.state[0]).max() < 0.1
    assert above.advance(0, 20_000) == DIVERGED


def discrete_energy(case):
    """Twice the energy that the scheme conserves: velocity between, product of, successive displacements."""
    displacement, velocity = case.state
    before = displacement - case.step * velocity
    return velocity @ case.packed.mass @ velocity + before @ case.packed.stiffness @ displacement


def test_free_motion_without_damping_keeps_its_energy():
    """Spinning: the gyroscopic force does no work, and neither does the scheme."""
    case = thrown(with_keys(PACKAGED, UNDAMPED), 2000.0, 1600)
    energy = discrete_energy(case)
    assert case.advance(0, 5000) == FINISHED
    assert discrete_energy(case) == pytest.approx(energy, rel=1e-11)


def test_contact_never_adds_energy():
    """Without friction, damping and unbalance every impact takes energy, and nothing gives any."""
    rig = with_keys(PACKAGED, UNDAMPED)
    case = thrown(rig, 300.0, 42_000, clearance=1e-5, friction=0.0)
    energies = []
    n_contact = 0
    for i in range(3000):
        assert case.advance(i, i + 1) == FINISHED
        n_contact += case.work.force[0] > 0
        energies.append(discrete_energy(case))
    assert n_contact > 20
    assert np.diff(energies).max() < 1e-12 * energies[0]
    assert energies[-1] < 0.9999 * energies[0]


def test_motion_that_has_died_away_is_zero():
    """Subnormal numbers would slow a step tenfold."""
    case = KernelCase.of(with_keys(PACKAGED, {"rotor.unbalance.mass": 0.0}), 300.0, 42_000)
    case.state[:] = 1e-165
    assert case.advance(0, 1) == FINISHED
    assert not case.state.any()
    case.state[0] = 1e-140
    assert case.advance(0, 1) == FINISHED
    assert case.state[0].all()


@pytest.mark.parametrize("value", [0.2, math.nan, math.inf])
@pytest.mark.parametrize("degree", ["output", "rim"])
def test_runaway_motion_is_noticed(value, degree):
    case = KernelCase.of(PACKAGED, 300.0, 42_000, clearance=10.0)
    row = case.packed.output_row[1] if degree == "output" else case.pairs.row[0, V]
    case.state[0, row] = value
    assert case.advance(0, 1, limit=0.1) == DIVERGED


def test_contact_without_solution_is_reported():
    case = KernelCase.of(PACKAGED, 300.0, 42_000, clearance=-1e-6)
    case.work.matrix[:] = -1e-9  # the force would close the gap
    assert case.advance(0, 1) == CONTACT_UNSOLVED
