"""Closed-form motion with contacts held closed, against the equations of motion and matrix exponentials."""

import gc
import weakref
from types import SimpleNamespace

import numpy as np
import pytest
from calling import called
from closed_form import Contact
from scipy.linalg import expm
from trial_rig import trial_rig

from rubhpc.fem.assemble import assemble
from rubhpc.integrate.reduced_model import mode_library
from rubhpc.integrate.reduced_model.contact_mode import confine, solve_contact_mode
from rubhpc.integrate.reduced_model.mode_library import ModeLibrary
from rubhpc.integrate.reduced_model.mode_tables import bytes_ahead
from rubhpc.integrate.reduced_model.reduction import directions, reduce_model
from rubhpc.integrate.reduced_model.system_modes import solve_parts
from rubhpc.integrate.setup import prepare
from rubhpc.kernels.contact_modes import (
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
from rubhpc.kernels.measuring import energies_gained
from rubhpc.study.study import Integrator

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
    n = len(reduced.stiffness)
    known = solve_parts(confine(reduced, np.zeros((0, n)), np.zeros((n, 0)))[2])
    settings = {"known": known, "tick": TICK, "sample_level": SAMPLE_LEVEL, "n_level": N_LEVEL}
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
def test_motion_comes_back_from_its_modal_coordinates(case, mask):
    rng = np.random.default_rng(mask)
    for angle in (0.0, 0.7, 4.0):
        motion = admissible(case, mask, rng)
        p, z = entered(case, mask, motion, angle)
        back = (joined(case.tables, "motion", p) @ z).real
        n = len(motion) // 2
        for part in (slice(0, n), slice(n, None)):
            assert back[part] == pytest.approx(motion[part], abs=1e-8 * abs(motion[part]).max())


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


def test_modes_of_a_ring_are_solved_when_first_met():
    """Their tables have room for all of them."""
    setup = prepare(
        trial_rig(3), 150.0, contact=Contact(), integrator=Integrator(), samples_per_revolution=64
    )
    library = setup.library(FRICTION)
    assert library.masks == [0]
    assert all(library.add(mask) for mask in range(1, 8))


@pytest.mark.parametrize("count", [1, 2, 3, 4, 7, 8, 1023, 1024, 2**40 - 1])
def test_longest_step_within_a_count_of_ticks(count):
    level = floor_log2(count)
    assert 2**level <= count < 2 ** (level + 1)


def test_large_modes_are_solved_once_for_both_tables(monkeypatch):
    """What the tables hold that a motion is followed with those of its record take over, bit for bit."""
    monkeypatch.setattr(mode_library, "MOST_BYTES", 2**20)
    monkeypatch.setattr(mode_library, "FEW_PAIRS", 2)

    def library():
        setup = prepare(
            trial_rig(3),
            180.0,
            contact=Contact(),
            integrator=Integrator(),
            samples_per_revolution=64,
        )
        return setup, setup.library(0.2)

    setup, both = library()
    _, alone = library()
    for mask in (1, 3, 5):
        assert both.followed.add(mask)
        assert both.add(mask)
        assert alone.add(mask)
    assert setup.n_solved(0.2) == 3
    for name, taken, solved in zip(both.tables()._fields, both.tables(), alone.tables(), strict=True):
        assert taken.tobytes() == solved.tobytes(), name
    assert both.tables().output.shape[2] < SAMPLES_AT_ONCE * (N_ROTOR_ROW + 9)
    assert both.followed.tables().slip_re.shape[1] == 0


def test_large_modes_are_freed_as_soon_as_they_are_forgotten(monkeypatch):
    """Both tables, gigabytes of a ring of 32, without a search for objects that hold each other."""
    monkeypatch.setattr(mode_library, "MOST_BYTES", 2**20)
    setup = prepare(
        trial_rig(3), 180.0, contact=Contact(), integrator=Integrator(), samples_per_revolution=64
    )
    held = [weakref.ref(setup.library(0.2)), weakref.ref(setup.library(0.2).followed)]
    assert held[0]() is not held[1]()
    gc.disable()
    try:
        setup.forget(0.2)
        assert [library() for library in held] == [None, None]
    finally:
        gc.enable()


def test_modes_that_were_given_up_are_counted_again():
    """A plan has to know what contact modes cost, not how many there are."""
    setup = prepare(
        trial_rig(3), 180.0, contact=Contact(), integrator=Integrator(), samples_per_revolution=64
    )
    library = setup.library(0.2)
    for mask in (1, 2):
        library.add(mask)
    library.forget()
    library.add(2)
    assert len(library.masks) == 2
    assert setup.n_solved(0.2) == 3


def test_more_room_keeps_no_motion_in_closed_form_for_longer(monkeypatch):
    """Tables with which a motion is followed hold a third more modes than it is judged by."""
    monkeypatch.setattr(mode_library, "MOST_BYTES", 2**20)
    monkeypatch.setattr(mode_library, "FEW_PAIRS", 2)
    setup = prepare(
        trial_rig(3), 180.0, contact=Contact(), integrator=Integrator(), samples_per_revolution=64
    )
    both = setup.library(0.2)
    n_byte = both.followed._tables.n_byte_of_one
    assert both.followed.n_most == 2 * 2**20 // n_byte > 4
    assert both.followed.n_usual == 3 * 2**19 // n_byte
    assert both.n_usual == both.n_most


def test_memory_with_more_samples_ahead_is_predicted(case):
    """From tables of one sample, as those of a large ring, to those that the library holds."""
    library, held = case.library, case.library._tables_of(case.library._opened, case.reduced)
    more = library._n_ahead, library._n_level
    library._n_ahead, library._n_level = 1, SAMPLE_LEVEL + 1
    few = library._tables_of(library._opened, case.reduced)
    library._n_ahead, library._n_level = more
    sizes = [sum(field.nbytes for field in tables) for tables in (few, held)]
    assert sizes[0] < sizes[1] == bytes_ahead(few, case.reduced, *more)
