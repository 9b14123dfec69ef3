"""Motion with pairs that slide or stick: held to the equations of motion and to quadrature."""

import numpy as np
import pytest
from scipy.integrate import simpson

from rubhpc.integrate.reduced_model.friction_mode import (
    FrictionPairs,
    mask_of,
    solve_friction_mode,
    states_of,
)
from rubhpc.integrate.reduced_model.mode_tables import energies_of, tabulate
from rubhpc.integrate.reduced_model.reduction import ReducedModel
from rubhpc.kernels.friction_states import BACKWARD, FORWARD, OPEN, STUCK

N, Q, SPIN, ANGLE, WIDTH = 7, 3, 90.0, 0.6, 32
FRICTION, STATIC = 0.3, 1.4
CLEARANCE = np.array([1e-3, 2e-3, -1e-3])


@pytest.fixture(scope="module")
def bodies():
    """Seven degrees of unit mass with a stiffness that is not symmetric, and three pairs."""
    rng = np.random.default_rng(5)
    root, skew = rng.normal(size=(2, N, N))
    reduced = ReducedModel(
        spin=SPIN,
        basis=np.eye(N),
        mass=np.eye(N),
        stiffness=4e4 * (root @ root.T + np.eye(N)) + 2e3 * (skew - skew.T),
        damping=3.0 * np.eye(N) + 2.0 * (root - root.T),
        force=rng.normal(size=(2, N)),
        degree=rng.normal(size=(Q, 5, N)),
        output=rng.normal(size=(3, N)),
        carrier=np.zeros((0, 2, N)),
        probe=np.zeros((3, 0, N)),
    )
    pairs = FrictionPairs(
        gap_jacobian=rng.normal(size=(Q, N)),
        friction_direction=rng.normal(size=(Q, N)),
        friction=FRICTION,
        static_ratio=STATIC,
        rim_speed=np.array([0.7, 1.1, 0.4]),
    )
    return reduced, pairs


def entered(mode, motion):
    """Coordinates at the shaft's angle ANGLE."""
    clear = np.append(CLEARANCE, 1.0)
    z = mode.enter @ motion - mode.take_off[0] * np.cos(ANGLE) - mode.take_off[1] * np.sin(ANGLE)
    z = z - clear @ mode.take_off[2:]
    m = mode.n_eigenmode
    z[m], z[m + 1 : m + 2 + Q] = np.exp(1j * ANGLE), clear
    return z


def at(mode, z, time):
    return z * np.exp(mode.exponent * time) + mode.growth * time


SETS = [
    (OPEN, OPEN, OPEN),
    (FORWARD, OPEN, BACKWARD),
    (STUCK, OPEN, OPEN),
    (STUCK, BACKWARD, OPEN),
    (STUCK, OPEN, STUCK),
    (FORWARD, STUCK, STUCK),
]


@pytest.mark.parametrize("states", SETS)
def test_motion_obeys_constraints_and_equations(bodies, states):
    reduced, pairs = bodies
    mode = solve_friction_mode(reduced, pairs, mask_of(states))
    assert states_of(mode.mask, Q) == list(states)
    z = entered(mode, np.random.default_rng(2).normal(size=2 * N))
    for time in (0.0, 3e-3):
        now = at(mode, z, time)
        x, v = (mode.motion @ now).real.reshape(2, N)
        slope = mode.exponent * now
        slope[mode.n_eigenmode + 1 + Q] = 0.0
        rate = mode.motion @ (slope + mode.growth)
        assert v == pytest.approx(rate.real[:N], rel=1e-9, abs=1e-9 * abs(v).max())
        value = (mode.switch @ now).real.reshape(Q, 2)
        angle = ANGLE + SPIN * time
        force = reduced.force[0] * np.cos(angle) + reduced.force[1] * np.sin(angle)
        gap, slip = CLEARANCE + pairs.gap_jacobian @ x, pairs.rim_speed - pairs.friction_direction @ v
        for i, state in enumerate(states):
            if state == OPEN:
                assert value[i] == pytest.approx([gap[i], 1.0], rel=1e-9)
                continue
            assert gap[i] == pytest.approx(0.0, abs=1e-10)
            normal, traction = value[i, 0], FRICTION * value[i, 0]
            if state == STUCK:
                assert slip[i] == pytest.approx(0.0, abs=1e-9)
                normal = value[i].sum() / (2 * STATIC * FRICTION)
                traction = (value[i, 1] - value[i, 0]) / 2
            else:
                sense = 1.0 if state == FORWARD else -1.0
                assert value[i, 1] == pytest.approx(sense * slip[i], rel=1e-9)
                traction *= sense
            force = force + normal * pairs.gap_jacobian[i] + traction * pairs.friction_direction[i]
        pull = reduced.stiffness @ x + reduced.damping @ v
        assert rate.real[N:] + pull == pytest.approx(force, rel=1e-8, abs=1e-8 * abs(pull).max())


@pytest.mark.parametrize("states", SETS)
def test_tables_hold_rates_and_the_work_of_damping_and_unbalance(bodies, states):
    reduced, pairs = bodies
    mode = solve_friction_mode(reduced, pairs, mask_of(states))
    levels = {"tick": 1e-9, "sample_level": 10, "n_level": 12}
    energies = energies_of(mode, reduced, None, WIDTH)
    tables = tabulate(mode, reduced, np.zeros((0, N)), energies=energies, width=WIDTH, **levels)
    z = entered(mode, np.random.default_rng(3).normal(size=2 * N))
    skew = 0.5 * (reduced.stiffness - reduced.stiffness.T)

    def padded(time):
        full = np.zeros(WIDTH, dtype=complex)
        full[: z.size] = at(mode, z, time)
        return full

    def powers(time):
        x, v = (mode.motion @ at(mode, z, time)).real.reshape(2, N)
        angle = ANGLE + SPIN * time
        force = reduced.force[0] * np.cos(angle) + reduced.force[1] * np.sin(angle)
        return v @ (reduced.damping @ v + skew @ x), v @ force

    def forms(time):
        full = padded(time)
        both = np.concatenate([full.real, full.imag])
        turn = full[mode.n_eigenmode]
        work = tables.work_re[0] + 1j * tables.work_im[0]
        return both @ tables.loss[0] @ both, (turn * (work[0] @ full) + turn.conj() * (work[1] @ full)).real

    end = 5e-3
    times = np.linspace(0.0, end, 20_001)
    loss, gain = simpson(np.array([powers(time) for time in times]).T, x=times)
    found = np.subtract(forms(end), forms(0.0)) + tables.steady_power[0] * end
    assert found == pytest.approx([loss, gain], rel=1e-6, abs=1e-9 * abs(loss))
    later, step = padded(2e-3), 1e-7
    rate = ((tables.rate_re[0] + 1j * tables.rate_im[0]) @ later).real
    switch = tables.switch_re[0] + 1j * tables.switch_im[0]
    slope = (switch @ (padded(2e-3 + step) - padded(2e-3 - step))).real / (2 * step)
    assert rate == pytest.approx(slope, rel=1e-5, abs=1e-6 * abs(rate).max())
