"""Contact pairs: forces, gaps and their directions in the complex plane, and the solution of a step."""

import math

import numpy as np
import pytest
from calling import called, interpreted
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import root

from rubhpc.integrate.marches.workspace import workspace
from rubhpc.kernels.central_difference.contact_forces import fill_residual
from rubhpc.kernels.central_difference.contact_forces import solve_contact as compiled_solve_contact
from rubhpc.kernels.complementarity import UNSOLVED
from rubhpc.kernels.contact_pairs import (
    AXIAL,
    LATERAL,
    N_DEGREE,
    TORSION,
    Pairs,
    V,
    W,
    fill_directions,
    force_on_disc,
    is_any_closed,
    normal_and_gap,
)
from rubhpc.kernels.laws import COULOMB as COULOMB_LAW
from rubhpc.kernels.laws import MULTIPLIER

fill_residual = called(fill_residual)
force_on_disc = called(force_on_disc)
is_any_closed = called(is_any_closed)

solve_contact = interpreted(
    compiled_solve_contact
)  # motions have it compiled; alone it takes 12 s to compile
COULOMB = MULTIPLIER._replace(friction_law=COULOMB_LAW)
RADIUS, CLEARANCE = 0.06, 1e-4
STEP, SPIN = 1e-6, 150.0  # s, rad/s
angles = st.floats(0.0, 2 * math.pi)
displacements = st.lists(st.floats(-5e-3, 5e-3), min_size=N_DEGREE, max_size=N_DEGREE).map(np.array)


def make_pairs(angle, friction=0.3, *, is_updated=False, compliance=None, aside=0.0, law=MULTIPLIER):
    """Pairs at the angles (q,), their degrees in rows 0 to 5 q."""
    axis = np.exp(1j * np.atleast_1d(angle))
    q = axis.size
    rows = np.arange(q * N_DEGREE).reshape(q, N_DEGREE)
    return Pairs(
        row=rows,
        block=np.zeros_like(rows),
        axis_y=axis.real.copy(),
        axis_z=axis.imag.copy(),
        radius=np.full(q, RADIUS),
        clearance=np.full(q, CLEARANCE),
        aside=np.full(q, aside),
        friction=np.full(q, friction),
        compliance=np.zeros((q, N_DEGREE, q, N_DEGREE)) if compliance is None else compliance,
        is_updated=is_updated,
        law=law,
    )


def line_of_centres(axis, at, aside=0.0):
    """From disc centre to tip, m, in the plane y + i z."""
    tip = (RADIUS + CLEARANCE + at[AXIAL] + 1j * (at[LATERAL] + aside)) * axis
    return tip - (at[V] + 1j * at[W])


@pytest.mark.parametrize("whirl", np.linspace(0, 2 * np.pi, 13))
@pytest.mark.parametrize("friction", [0.3, -0.3])  # the second when the spin is negative
def test_friction_opposes_the_rim_at_every_whirl_angle(whirl, friction):
    n = np.exp(1j * whirl)  # the plane as complex numbers: t = i n
    fy, fz, mx = force_on_disc(n.real, n.imag, 100.0, friction, 0.06)
    assert complex(fy, fz) == pytest.approx(-100.0 * n * (1 + 1j * friction))
    assert mx == pytest.approx(-friction * 100.0 * 0.06)


@given(angles, displacements, st.floats(-1e-3, 1e-3))
def test_gap_is_the_distance_of_centre_and_tip_less_the_radius(angle, at, aside):
    axis = np.exp(1j * angle)
    line = line_of_centres(axis, at, aside)
    ny, nz, gap = normal_and_gap(axis.real, axis.imag, RADIUS, CLEARANCE, aside, True, at)
    assert complex(ny, nz) == pytest.approx(line / abs(line))
    assert gap == pytest.approx(abs(line) - RADIUS, abs=1e-15)
    ny, nz, gap = normal_and_gap(axis.real, axis.imag, RADIUS, CLEARANCE, aside, False, at)
    assert complex(ny, nz) == axis
    assert gap == pytest.approx((line * axis.conjugate()).real - RADIUS, abs=1e-15)


@given(angles, displacements, st.booleans(), st.sampled_from([0.0, 5e-4]))
def test_push_is_the_change_of_the_gap(angle, at, is_updated, aside):
    pairs = make_pairs(angle, is_updated=is_updated, aside=aside)
    axis = (pairs.axis_y[0], pairs.axis_z[0])

    def gap(moved):
        return normal_and_gap(*axis, RADIUS, CLEARANCE, aside, is_updated, moved)[2]

    ny, nz, _ = normal_and_gap(*axis, RADIUS, CLEARANCE, aside, is_updated, at)
    force_direction, gap_jacobian = np.zeros((2, N_DEGREE))
    fill_directions(pairs, 0, ny, nz, force_direction, gap_jacobian)
    delta = 1e-6
    for a in range(N_DEGREE):
        nudge = np.eye(N_DEGREE)[a] * delta
        slope = (gap(at + nudge) - gap(at - nudge)) / (2 * delta)
        assert gap_jacobian[a] == pytest.approx(slope, abs=1e-8)


@given(angles, angles, st.floats(-0.6, 0.6))
def test_pair_of_forces_is_in_balance(angle, whirl, friction):
    """Action is reaction, normal force works on the gap alone, and friction on the slip alone."""
    pairs = make_pairs(angle, friction)
    force_direction, gap_jacobian = np.zeros((2, N_DEGREE))
    n = np.exp(1j * whirl)
    fill_directions(pairs, 0, n.real, n.imag, force_direction, gap_jacobian)
    axis = complex(pairs.axis_y[0], pairs.axis_z[0])
    on_disc, on_tip = (
        complex(force_direction[V], force_direction[W]),
        complex(force_direction[AXIAL], force_direction[LATERAL]) * axis,
    )
    assert on_disc + on_tip == pytest.approx(0.0, abs=1e-14)
    velocity = np.array([0.3, -0.2, 5.0, 0.1, 0.7])
    disc, tip = complex(*velocity[:2]), complex(*velocity[3:]) * axis
    slip = RADIUS * velocity[TORSION] + ((disc - tip) * (1j * n).conjugate()).real
    assert force_direction @ velocity == pytest.approx(gap_jacobian @ velocity - friction * slip, abs=1e-12)


def closed(pairs, displacement):
    """The workspace when the free update leads to `displacement` (5 q,)."""
    work = workspace(pairs, STEP)
    is_closed = is_any_closed(
        pairs.row,
        pairs.axis_y,
        pairs.axis_z,
        pairs.radius,
        pairs.clearance,
        pairs.aside,
        pairs.is_updated,
        displacement,
        work.at,
        work.gap,
    )
    return work, is_closed


def test_held_degrees_stand_still():
    pairs = make_pairs(0.4)
    pairs.row[0, LATERAL] = pairs.row[0, W] = -1
    work, is_closed = closed(pairs, np.full(N_DEGREE, 2e-4))
    assert work.at[0].tolist() == [2e-4, 0.0, 2e-4, 2e-4, 0.0]
    gap = line_of_centres(np.exp(0.4j), work.at[0])
    assert work.gap[0] == pytest.approx((gap * np.exp(-0.4j)).real - RADIUS)
    assert is_closed == (work.gap[0] < 0)


def flexible(rng, q):
    """Compliance of q pairs over a step, (q, 5, q, 5), m/N: symmetric, positive, coupled."""
    root_of = rng.normal(size=(5 * q, 5 * q))
    return (1e-9 * (root_of @ root_of.T / (5 * q) + np.eye(5 * q))).reshape(q, 5, q, 5)


@pytest.mark.parametrize("is_updated", [False, True])
@pytest.mark.parametrize("seed", range(8))
def test_forces_close_the_gaps_of_those_that_touch(seed, is_updated):
    rng = np.random.default_rng(seed)
    q = 1 + seed % 3
    pairs = make_pairs(
        rng.uniform(0, 2 * math.pi, q), 0.3, is_updated=is_updated, compliance=flexible(rng, q)
    )
    at = rng.normal(scale=2e-4, size=5 * q)
    at[AXIAL] -= 5e-4  # the first penetrates
    work, is_closed = closed(pairs, at)
    assert is_closed
    free = at.reshape(q, 5)
    n_touching = solve_contact(pairs, work, STEP, SPIN)
    assert n_touching == np.count_nonzero(work.force)
    assert n_touching > 0
    assert work.force.min() >= 0.0
    moved = free + np.einsum("iajb,jb,j->ia", pairs.compliance, work.force_direction, work.force)
    for i in range(q):
        axis = complex(pairs.axis_y[i], pairs.axis_z[i])
        line = line_of_centres(axis, moved[i])
        gap = (abs(line) if is_updated else (line * axis.conjugate()).real) - RADIUS
        assert gap >= -1e-12
        assert work.force[i] * abs(gap) <= 1e-12 * work.force.max()
        n = line_of_centres(axis, free[i])
        n = n / abs(n) if is_updated else axis
        assert complex(work.force_direction[i, V], work.force_direction[i, W]) == pytest.approx(
            -n * (1 + 0.3j)
        )


@pytest.mark.parametrize("seed", range(4))
def test_curved_gap_is_closed_as_by_a_general_solver(seed):
    """Two pairs in contact, strongly bent sideways: the forces of scipy's root finder."""
    rng = np.random.default_rng(seed)
    pairs = make_pairs([0.2, 0.9], 0.2, is_updated=True, compliance=flexible(rng, 2))
    at = rng.normal(scale=1e-5, size=(2, 5))
    at[:, AXIAL] -= 4e-4
    at[:, LATERAL] = [2e-3, -1e-3]
    work, _ = closed(pairs, at.ravel())
    assert solve_contact(pairs, work, STEP, SPIN) == 2
    axis = pairs.axis_y + 1j * pairs.axis_z
    normals = np.array([line_of_centres(axis[i], at[i]) for i in range(2)])
    normals /= abs(normals)
    on_disc = -normals * (1 + 0.2j)
    on_tip = -on_disc * axis.conj()
    twist = np.full(2, -0.2 * RADIUS)
    unit = np.stack([on_disc.real, on_disc.imag, twist, on_tip.real, on_tip.imag], axis=1)

    def gaps(force):
        moved = at + np.einsum("iajb,jb,j->ia", pairs.compliance, unit, force)
        return [1e6 * (abs(line_of_centres(axis[i], moved[i])) - RADIUS) for i in range(2)]

    expected = root(gaps, [1e5, 1e5], tol=1e-13)
    assert expected.success
    assert work.force == pytest.approx(expected.x, rel=1e-6)


def test_pair_that_no_force_can_part_is_reported():
    pairs = make_pairs(0.0)  # nothing yields: compliance zero
    work, is_closed = closed(pairs, np.array([5e-4, 0.0, 0.0, 0.0, 0.0]))
    assert is_closed
    assert solve_contact(pairs, work, STEP, SPIN) == UNSOLVED


@st.composite
def thrown_pairs(draw):
    """Pairs at any angles, with any symmetric compliance, some of which penetrate in the step."""
    q = draw(st.integers(1, 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    pairs = make_pairs(
        rng.uniform(0, 2 * math.pi, q),
        draw(st.sampled_from([0.0, 0.1, 0.4])) * draw(st.sampled_from([1.0, -1.0])),
        is_updated=draw(st.booleans()),
        compliance=flexible(rng, q),
        law=COULOMB,
    )
    end = rng.normal(scale=2e-4, size=(q, 5))
    # Slips of a step, of either sense, from what friction can stop to what it cannot.
    start = end - rng.normal(scale=draw(st.sampled_from([1e-7, 1e-6, 1e-5])), size=(q, 5))
    spin = draw(st.sampled_from([0.0, SPIN, -SPIN]))
    return pairs, start, end, spin


def gaps(pairs, at):
    """Gaps (q,) with the degrees `at` (q, 5), and the unit vectors from disc to tip in the plane y + i z."""
    axis = pairs.axis_y + 1j * pairs.axis_z
    line = (pairs.radius + pairs.clearance + at[:, 3] + 1j * at[:, 4]) * axis - (at[:, 0] + 1j * at[:, 1])
    if pairs.is_updated:
        return abs(line) - pairs.radius, line / abs(line)
    return (line * axis.conj()).real - pairs.radius, axis


def slips(pairs, normal, moved, spin):
    """Way of the rim over the tips (q,) for motions `moved` (q, 5) of their degrees in a step."""
    axis = pairs.axis_y + 1j * pairs.axis_z
    apart = moved[:, 0] + 1j * moved[:, 1] - (moved[:, 3] + 1j * moved[:, 4]) * axis
    return pairs.radius * (moved[:, 2] + STEP * spin) + (apart * (1j * normal).conj()).real


@settings(max_examples=300, deadline=None)
@given(thrown_pairs())
def test_forces_keep_to_coulombs_law(problem):
    pairs, start, end, spin = problem
    work = workspace(pairs, STEP)
    free, normal = gaps(pairs, end)
    work.at[:], work.now[:], work.gap[:] = end, start, free
    work.rate[:] = (end - start) / STEP  # slips turn round in the step only where the forces turn them
    assert solve_contact(pairs, work, STEP, spin) == np.count_nonzero(work.force)
    pivots, residual, moved = work.solution
    assert residual <= 1e-9 * moved + 1e-13
    assert (pivots > 0) == work.force.any()
    force, friction = work.force, work.traction
    along = -normal * force - 1j * normal * friction  # on the disc
    on_tip = -along * (pairs.axis_y - 1j * pairs.axis_z)
    loads = np.stack([along.real, along.imag, -RADIUS * friction, on_tip.real, on_tip.imag], axis=1)
    at = end + np.einsum("iajb,jb->ia", pairs.compliance, loads)
    gap, slip = gaps(pairs, at)[0], slips(pairs, normal, at - start, spin)
    before = slips(pairs, normal, end - start, spin)
    assert (force >= 0.0).all()
    assert gap.min() >= -2e-13
    assert abs(gap * force).max() <= 2e-13 * max(force.max(), 1.0)
    bound = abs(pairs.friction) * force
    assert (abs(friction) <= bound * (1 + 1e-9)).all()
    for i in np.flatnonzero(bound > 0.0):
        tiny = 1e-10 * (abs(before).max() + abs(slip).max())
        if friction[i] * (before[i] + slip[i]) < -1e-9 * bound[i] * abs(before).max():
            raise AssertionError("friction feeds energy in")
        if abs(friction[i]) < bound[i] * (1 - 1e-9):
            turned = before[i] * (before[i] + slip[i]) < 0 or friction[i] == 0.0
            assert abs(slip[i]) <= tiny or turned
        else:
            assert slip[i] * friction[i] >= -tiny * bound[i]
    if bound.any():  # a friction that is not the law's shows
        i = int(bound.argmax())
        friction[i] -= 0.1 * math.copysign(bound[i], friction[i])
        fill_residual(pairs, work)
        give = np.abs(work.tangential[1]).diagonal()[i]
        assert work.solution[1] >= 0.05 * give * bound[i]
