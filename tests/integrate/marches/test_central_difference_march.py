"""The paper's integrator: its equations as printed, motion that dies away, and its ways to fail."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import read_rig
from kernel_case import KernelCase
from scipy.linalg import block_diag

from rubhpc.kernels.central_difference.march import CONTACT_UNSOLVED, DIVERGED, FINISHED
from rubhpc.kernels.contact_pairs import V
from rubhpc.rig.parts import Bearing
from rubhpc.rig.reading import with_keys
from rubhpc.rig.rotors import Unbalance

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


def test_arrays_are_contiguous_whatever_the_bearings():
    """Kernels are compiled for each layout: other strides would take 16 s."""
    linear = KernelCase.of(COUPLED, 400.0, 31_000).packed.linear
    arrays = {name: values for name, values in linear._asdict().items() if values.size > 1}
    assert "circulation_row" in arrays
    assert [name for name, values in arrays.items() if not values.flags.c_contiguous] == []


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
