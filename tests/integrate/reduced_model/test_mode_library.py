"""Closed-form motion with contacts held closed, against the equations of motion and matrix exponentials."""

from types import SimpleNamespace

import numpy as np
import pytest
from calling import called
from scipy.linalg import expm
from set_ups import prepared
from trial_rig import trial_rig

from rubhpc.fem.assemble import assemble
from rubhpc.integrate.reduced_model import mode_library
from rubhpc.integrate.reduced_model.contact_mode import solve_contact_mode
from rubhpc.integrate.reduced_model.mode_library import ModeLibrary
from rubhpc.integrate.reduced_model.reduction import directions, reduce_model
from rubhpc.kernels.closed_form.measuring import energies_gained
from rubhpc.kernels.contact_modes import (
    LANES,
    LATERAL_RATE,
    LATERAL_ROW,
    N_ROTOR_ROW,
    SAMPLES_AT_ONCE,
    TWIST_ACCELERATION_ROW,
    enter,
    event_free_interval,
    find_mode,
)
from rubhpc.kernels.coordinate_steps import floor_log2

energies_gained = called(energies_gained)
enter = called(enter)
event_free_interval = called(event_free_interval)
find_mode = called(find_mode)
floor_log2 = called(floor_log2)

CLEARANCE = np.array([80e-6, 95e-6])
FRICTION = 0.3
TICK, SAMPLE_LEVEL, N_LEVEL = 1e-7, 9, 12
MASKS = (0, 1, 2, 3)


@pytest.fixture(scope="module", params=[180.0, -260.0])
def case(request):
    """Every mode kept, so that nothing but rounding parts the tables from the full equations."""
    spin = request.param
    model = assemble(trial_rig(2, cross=1e5))
    reduced = reduce_model(model, spin, 1e-30)
    gap_jacobian, force_direction, _ = directions(reduced, model, FRICTION)
    opened = solve_contact_mode(reduced, gap_jacobian, force_direction, 0)
    settings = {"tick": TICK, "sample_level": SAMPLE_LEVEL, "n_level": N_LEVEL}
    library = ModeLibrary(reduced, model, FRICTION, opened=opened, **settings)
    for mask in MASKS[1:]:
        assert library.add(mask)
    return SimpleNamespace(spin=spin, model=model, reduced=reduced, library=library, tables=library.tables())


def closed_pairs(mask):
    return [i for i in range(len(CLEARANCE)) if mask >> i & 1]


def applied(case, cosine, sine):
    return case.reduced.force[0] * cosine + case.reduced.force[1] * sine


def admissible(case, mask, rng):
    """A motion (2 n,) whose closed gaps are zero and stay so, of 0.1 mm and 0.05 m/s."""
    n = len(case.reduced.stiffness)
    x, v = 1e-4 * rng.normal(size=n), 0.05 * rng.normal(size=n)
    closed = closed_pairs(mask)
    if closed:
        gap_jacobian = case.library.gap_jacobian[closed]
        x -= np.linalg.pinv(gap_jacobian) @ (gap_jacobian @ x + CLEARANCE[closed])
        v -= np.linalg.pinv(gap_jacobian) @ (gap_jacobian @ v)
    return np.concatenate([x, v])


def constrained(case, mask, x, v, cosine, sine):
    """Acceleration and forces that keep the closed gaps shut: [1 -P; Q 0] [x''; N] = [f - K x - C v; 0]."""
    closed, n, q = closed_pairs(mask), len(x), len(CLEARANCE)
    free = applied(case, cosine, sine) - case.reduced.stiffness @ x - case.reduced.damping @ v
    gap_jacobian, force_direction = case.library.gap_jacobian[closed], case.library.force_direction[closed]
    saddle = np.block([[np.eye(n), -force_direction.T], [gap_jacobian, np.zeros((len(closed),) * 2)]])
    solution = np.linalg.solve(saddle, np.concatenate([free, np.zeros(len(closed))]))
    force = np.zeros(q)
    force[closed] = solution[n:]
    return solution[:n], force


def entered(case, mask, motion, angle):
    """Modal coordinates as complex numbers."""
    p = find_mode(case.tables.mask, mask)
    z = np.zeros((2, case.tables.switch_re.shape[2]))
    enter(case.tables, p, CLEARANCE, np.cos(angle), np.sin(angle), motion, z)
    return p, z[0] + 1j * z[1]


def joined(tables, name, p):
    return getattr(tables, f"{name}_re")[p] + 1j * getattr(tables, f"{name}_im")[p]


def exponents(tables, p):
    """From what the tables hold: the ratio of rate and value, wherever the value is not zero."""
    power = joined(tables, "power", p)[0]
    return np.log(np.where(power == 0, 1.0, power)) / TICK


@pytest.mark.parametrize("mask", MASKS)
def test_motion_obeys_the_equations_with_the_gaps_held(case, mask):
    """M x'' + C x' + K x = f + P N at random states and angles, N the force that the constraint needs."""
    rng = np.random.default_rng(10 + mask)
    mode = case.library._solved(mask)
    closed = closed_pairs(mask)
    for angle in (0.0, 1.0, 3.5):
        motion = admissible(case, mask, rng)
        p, z = entered(case, mask, motion, angle)
        z = z[: mode.exponent.size]
        x, v = np.split((mode.motion @ z).real, 2)
        drift, acceleration = np.split((mode.motion @ (mode.exponent * z)).real, 2)
        expected, force = constrained(case, mask, x, v, np.cos(angle), np.sin(angle))
        assert drift == pytest.approx(v, abs=1e-8 * abs(v).max())
        # Stiffness times displacement is 1e6 times the rest and more: its rounding is what is left.
        assert acceleration == pytest.approx(expected, abs=1e-7 * abs(case.reduced.stiffness @ x).max())
        switch = (mode.switch @ z).real
        gap = case.library.gap_jacobian @ x + CLEARANCE
        assert gap[closed] == pytest.approx(0.0, abs=1e-15)
        opened = [i for i in range(len(CLEARANCE)) if i not in closed]
        assert switch[opened] == pytest.approx(gap[opened], abs=1e-14)
        assert switch[closed] == pytest.approx(force[closed], rel=1e-6, abs=1e-6 * abs(force).max(initial=0))
        tabulated = (joined(case.tables, "switch", p)[:, : z.size] @ z).real
        assert tabulated == pytest.approx(switch, rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("mask", MASKS)
@pytest.mark.parametrize("level", [0, 5, 11])
def test_steps_of_doubling_length_are_matrix_exponentials(case, mask, level):
    """Of the first-order form, with the shaft's cosine and sine and a one as further states."""
    rng = np.random.default_rng(100 + mask)
    n, spin = len(case.reduced.stiffness), case.spin
    closed = closed_pairs(mask)
    gap_jacobian, force_direction = case.library.gap_jacobian[closed], case.library.force_direction[closed]
    hold = (
        np.eye(n) - force_direction.T @ np.linalg.inv(gap_jacobian @ force_direction.T) @ gap_jacobian
        if closed
        else np.eye(n)
    )
    rate = np.zeros((2 * n + 2, 2 * n + 2))
    rate[:n, n : 2 * n] = np.eye(n)
    rate[n : 2 * n, :n] = -hold @ case.reduced.stiffness
    rate[n : 2 * n, n : 2 * n] = -hold @ case.reduced.damping
    rate[n : 2 * n, 2 * n :] = hold @ case.reduced.force.T
    rate[2 * n, 2 * n + 1], rate[2 * n + 1, 2 * n] = -spin, spin
    angle, time = 0.9, TICK * 2**level
    motion = admissible(case, mask, rng)
    expected = (expm(rate * time) @ np.concatenate([motion, [np.cos(angle), np.sin(angle)]]))[:-2]
    p, z = entered(case, mask, motion, angle)
    moved = z * joined(case.tables, "power", p)[level]
    found = (joined(case.tables, "motion", p) @ moved).real
    for part in (slice(0, n), slice(n, None)):
        assert found[part] == pytest.approx(expected[part], abs=1e-7 * abs(expected[part]).max())
    gap = case.library.gap_jacobian @ found[:n] + CLEARANCE
    assert gap[closed] == pytest.approx(0.0, abs=1e-14)


@pytest.mark.parametrize("mask", MASKS)
def test_rows_of_the_tables_are_read_off_the_motion(case, mask):
    rng = np.random.default_rng(200 + mask)
    motion = admissible(case, mask, rng)
    angle = 2.2
    p, z = entered(case, mask, motion, angle)
    x, v = np.split(motion, 2)
    reduced, tables = case.reduced, case.tables
    acceleration, _ = constrained(case, mask, x, v, np.cos(angle), np.sin(angle))
    table = tables.output[p].reshape(2, z.size, SAMPLES_AT_ONCE, -1)
    found = read(table[:, :, 0], z)
    expected = np.empty_like(found)
    expected[:3], expected[3:6] = reduced.output @ x, reduced.output @ v
    expected[TWIST_ACCELERATION_ROW] = reduced.output[2] @ acceleration
    tips = expected[N_ROTOR_ROW:].reshape(-1, 3)
    tips[:, 0], tips[:, LATERAL_ROW] = reduced.degree[:, 3] @ x, reduced.degree[:, 4] @ x
    tips[:, LATERAL_RATE] = reduced.degree[:, 4] @ v
    tight = np.arange(found.size) != TWIST_ACCELERATION_ROW
    assert found[tight] == pytest.approx(expected[tight], rel=1e-7, abs=1e-11)
    assert found[~tight] == pytest.approx(expected[~tight], rel=1e-5)
    assert (joined(tables, "slip", p) @ z).real == pytest.approx(case.library.slip @ v)
    for i in range(SAMPLES_AT_ONCE):  # those at later samples
        later = z * np.exp(exponents(tables, p) * TICK * 2**SAMPLE_LEVEL * i)
        assert read(table[:, :, i], z)[tight] == pytest.approx(
            read(table[:, :, 0], later)[tight], rel=1e-6, abs=1e-11
        )


def read(table, z):
    """Output rows from a table (2, m, rows) of real and imaginary parts."""
    return table[0].T @ z.real + table[1].T @ z.imag


@pytest.mark.parametrize("mask", MASKS)
def test_forms_grow_by_the_energy_lost_and_given(case, mask):
    """Powers of damping (with cross-coupled bearings), friction and unbalance, by Gauss's rule on a motion.

    Normal forces are those that keep the closed gaps from accelerating.
    """
    rng = np.random.default_rng(400 + mask)
    tables, reduced = case.tables, case.reduced
    skew = 0.5 * (reduced.stiffness - reduced.stiffness.T)
    angle, duration = 1.3, 2e-3
    p, z = entered(case, mask, admissible(case, mask, rng), angle)
    real, imaginary = case.library.exponents(mask)
    exponent = real + 1j * imaginary
    node, weight = np.polynomial.legendre.leggauss(20)
    panels = np.linspace(0, duration, 401)
    time = (0.5 * (panels[1:] + panels[:-1])[:, None] + 0.5 * np.diff(panels)[:, None] * node).ravel()
    weight = (0.5 * np.diff(panels)[:, None] * weight).ravel()
    x, v = np.split((joined(tables, "motion", p) @ (z[:, None] * np.exp(np.outer(exponent, time)))).real, 2)
    lost = weight @ np.einsum("it,it->t", v, reduced.damping @ v + skew @ x)
    turn = angle + case.spin * time
    load = np.outer(reduced.force[0], np.cos(turn)) + np.outer(reduced.force[1], np.sin(turn))
    given = weight @ np.einsum("it,it->t", v, load)
    closed = [i for i in range(len(case.library.gap_jacobian)) if mask >> i & 1]
    rate, along = case.library.gap_jacobian[closed], case.library.force_direction[closed].T
    force = np.linalg.solve(rate @ along, rate @ (reduced.stiffness @ x + reduced.damping @ v - load))
    lost -= weight @ np.einsum("it,it->t", v, (along - rate.T) @ force)
    later, grown = z * np.exp(exponent * duration), np.empty(2)
    energies_gained(tables, p, *(np.stack([at.real, at.imag]) for at in (z, later)), grown)
    grown += tables.steady_power[p] * duration
    assert grown == pytest.approx([lost, given], rel=1e-6)


@pytest.mark.parametrize("mask", MASKS)
def test_no_switch_function_vanishes_in_the_time_proved(case, mask):
    """Sampled finely; and the proof is of use: it grants a fair part of the time to the first zero."""
    rng = np.random.default_rng(300 + mask)
    granted = []
    for _ in range(40):
        motion = 0.3 * admissible(case, 0, rng) if mask == 0 else admissible(case, mask, rng)
        p, z = entered(case, mask, motion, rng.uniform(0, 6))
        tables = case.tables
        proved = event_free_interval(
            tables.switch_re,
            tables.switch_im,
            tables.rate_re,
            tables.rate_im,
            tables.bound,
            p,
            z.real.copy(),
            z.imag.copy(),
        )
        switch = joined(tables, "switch", p)
        if (switch @ z).real.min() <= 0.0:
            assert proved == 0.0
            continue
        assert proved > 0.0
        time = np.linspace(0, min(proved, TICK * 2 ** (N_LEVEL - 1)), 200)
        later = (switch @ (z[:, np.newaxis] * np.exp(np.outer(exponents(tables, p), time)))).real
        assert later[:, :-1].min() > 0.0
        granted.append(proved)
    assert len(granted) > 5


@pytest.mark.parametrize("count", [1, 2, 3, 4, 7, 8, 1023, 1024, 2**40 - 1])
def test_longest_step_within_a_count_of_ticks(count):
    level = floor_log2(count)
    assert 2**level <= count < 2 ** (level + 1)


def test_modes_that_were_given_up_are_counted_again():
    """A plan has to know what contact modes cost, not how many there are."""
    setup = prepared(trial_rig(3), 180.0)
    library = setup.library(0.2)
    for mask in (1, 2):
        library.add(mask)
    library.forget()
    library.add(2)
    assert len(library.masks) == 2
    assert setup.n_solved(0.2) == 3


def test_tables_of_many_pairs_hold_one_sample(monkeypatch):
    """No step passes a sample then: those of several would be a third of the memory of a large ring."""
    monkeypatch.setattr(mode_library, "FEW_PAIRS", 2)
    setup = prepared(trial_rig(3), 180.0)
    tables = setup.library(0.2).tables()
    assert tables.output.shape[2] == -(-(N_ROTOR_ROW + 9) // LANES) * LANES
    assert tables.power_re.shape[1] == setup.sample_level + 1
