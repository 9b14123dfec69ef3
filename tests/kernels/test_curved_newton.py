"""Newton's method for the loads of a lone pair: its slopes against differences, its moves of linear loads."""

from types import SimpleNamespace

import numpy as np
import pytest
from calling import interpreted
from scipy.optimize import brentq

from rubhpc.kernels.curved_contact import N_NODE
from rubhpc.kernels.curved_loads import LOADS, MISSED
from rubhpc.kernels.curved_newton import factorise, fill_slopes, find_system, move_by_newton, solve

RADIUS, CLEARANCE, ASIDE, FRICTION = 0.05, 1e-4, 2e-5, 0.3
N_STATE = 3


def answer(pair, read, d):
    """h, its rate and the force of what is read of a pair, from the equations alone; and where they hold."""
    u, v, a = read[:d], read[d : 2 * d + 1], read[2 * d + 1 :]
    moved = pair.moved

    def height(m):
        return RADIUS - np.sqrt(RADIUS**2 - (m[1] + ASIDE) ** 2) + 0.5 * m[2:] @ m[2:]

    h = brentq(lambda h: height(u - moved[:d] * h) - h, -1e-3, 1e-3, xtol=1e-18, rtol=1e-15)
    motion = u - moved[:d] * h
    slope = np.array([0.0, (motion[1] + ASIDE) / np.sqrt(RADIUS**2 - (motion[1] + ASIDE) ** 2), *motion[2:]])
    rate = slope @ v[:d] / (1.0 + slope @ moved[:d])
    rates = v - moved * rate
    reach = RADIUS + CLEARANCE + motion[0] + 0.5 * motion[2:] @ motion[2:]
    angle = np.arctan2(motion[1] + ASIDE, reach)
    cosine, sine = np.cos(angle), np.sin(angle)
    jacobian = np.array([cosine, sine, *cosine * motion[2:], 0.0])
    pressing, aslant = cosine - FRICTION * sine, sine + FRICTION * cosine
    direction = np.array([pressing, aslant, *pressing * motion[2:], -FRICTION * RADIUS])
    turning = cosine * rates[1] - sine * (rates[0] + motion[2:] @ rates[2:d])
    bends = cosine * rates[2:d] @ rates[2:d] + turning**2 / np.hypot(reach, motion[1] + ASIDE)
    accelerations = a + pair.accel * h + pair.accel_rate * rate
    force = -(jacobian[:d] @ accelerations + bends) / (jacobian @ pair.gram @ direction)
    found = np.array([h, rate, force])
    return found, motion, rates, accelerations, jacobian, direction, (cosine, sine)


def random_pair(generator, d):
    root = generator.normal(size=(d + 1, d + 1))
    return SimpleNamespace(
        moved=0.3 * generator.normal(size=d + 1),
        accel=1e7 * generator.normal(size=d),
        accel_rate=1e3 * generator.normal(size=d),
        gram=root @ root.T,
    )


@pytest.mark.parametrize("n_bending", [0, 3])
def test_slopes_are_those_of_the_equations(n_bending):
    generator, d = np.random.default_rng(3), 2 + n_bending
    pair = random_pair(generator, d)
    size = np.array(
        [1e-4, 2e-3, *[5e-3] * n_bending, 0.1, 0.4, *[1.0] * n_bending, 1.0, 2e3, 1e3, *[1e3] * n_bending]
    )
    read = size * generator.normal(size=size.size)
    found, motion, rates, _, jacobian, direction, normal = answer(pair, read, d)
    work = SimpleNamespace(
        motion=np.zeros((3, 1, d + 1)),
        jacobian=jacobian[None],
        direction=direction[None],
        force=np.full((N_NODE, 1), found[2]),
        h=np.full((N_NODE, 1), found[0]),
        rate=np.full((N_NODE, 1), found[1]),
        normal=np.array(normal)[:, None],
        part=np.zeros((6, d + 1)),
        slope=np.zeros((N_NODE - 1, N_STATE, 3 * d + 1)),
        lever=np.zeros((N_NODE - 1, d)),
    )
    work.motion[0, 0, :d], work.motion[1, 0], work.motion[2, 0, :d] = motion, rates, read[2 * d + 1 :]
    pairs = SimpleNamespace(
        radius=[RADIUS],
        clearance=[CLEARANCE],
        aside=[ASIDE],
        friction=[FRICTION],
        gram=pair.gram[None, :, None, :],
        is_round=True,
    )
    tables = SimpleNamespace(
        bound=np.zeros((1, 1, d, 1)),
        moved=pair.moved.reshape(1, 1, d + 1, 1),
        accel=pair.accel.reshape(1, 1, d, 1),
        accel_rate=pair.accel_rate.reshape(1, 1, d, 1),
    )
    interpreted(fill_slopes)(pairs, tables, 0, 1, work)
    for j, step in enumerate(1e-5 * size):
        beside = [answer(pair, read + sign * step * np.eye(size.size)[j], d)[0] for sign in (1, -1)]
        expected = (beside[0] - beside[1]) / (2.0 * step)
        scale = np.abs(found) / size[j]
        assert work.slope[0, :, j] == pytest.approx(expected, rel=1e-6, abs=1e-10 * scale.max()), j
    assert work.lever[0] == pytest.approx([direction[0] - 1.0, direction[1] - FRICTION, *direction[2:d]])


def test_one_move_finds_loads_that_answer_linearly():
    """Loads that depend on h, its rate and the force alone, and these linearly on what loads do."""
    generator, d = np.random.default_rng(5), 5
    n_load, n_read, n_node = d + 2, 3 * d + 1, N_NODE - 1
    n = n_node * n_load
    reached = generator.normal(size=(n_node * n_read, n))
    work = SimpleNamespace(
        load=np.zeros((N_NODE, 1, n_load)),
        slope=0.1 * generator.normal(size=(n_node, N_STATE, n_read)),
        lever=generator.normal(size=(n_node, d)),
        answer=np.zeros((N_STATE * n_node, n)),
        system=np.zeros((N_STATE * n_node, N_STATE * n_node)),
        order=np.zeros(N_STATE * n_node, dtype=np.int64),
        unknown=np.zeros(N_STATE * n_node),
        point=np.zeros((7, n)),
    )
    states = np.zeros((N_STATE * n_node, n))
    loads = np.zeros((n, N_STATE * n_node))
    for node in range(n_node):
        own = slice(N_STATE * node, N_STATE * (node + 1))
        states[own] = work.slope[node] @ reached[n_read * node : n_read * (node + 1)]
        block = loads[n_load * node : n_load * (node + 1), own]
        block[0, 0] = block[1, 1] = 1.0
        block[2:, 2] = work.lever[node]
    offset = generator.normal(size=n)

    def answered(x):
        return offset + loads @ (states @ x)

    assert interpreted(find_system)(SimpleNamespace(reached=reached[None, None]), 0, 0, work)
    start = generator.normal(size=n)
    work.point[LOADS], work.point[MISSED] = start, answered(start) - start
    interpreted(move_by_newton)(work)
    assert np.abs(work.point[MISSED]).max() > 1.0
    assert answered(work.point[LOADS]) == pytest.approx(work.point[LOADS], rel=1e-9, abs=1e-9)


def test_systems_are_solved_with_rows_exchanged():
    generator = np.random.default_rng(7)
    matrix = generator.normal(size=(12, 12))
    matrix[0, 0] = 0.0
    factors, order, value = matrix.copy(), np.zeros(12, dtype=np.int64), generator.normal(size=12)
    expected = np.linalg.solve(matrix, value)
    assert interpreted(factorise)(factors, order)
    interpreted(solve)(factors, order, value)
    assert value == pytest.approx(expected, rel=1e-10)
    assert not interpreted(factorise)(np.zeros((12, 12)), order)
