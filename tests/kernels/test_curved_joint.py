"""Newton's method for several closed pairs: its slopes against differences, its moves of linear loads."""

from types import SimpleNamespace

import numpy as np
import pytest
from calling import interpreted
from scipy.optimize import fsolve

from rubhpc.kernels.curved_contact import ALL, N_NODE, curved_work, is_closed
from rubhpc.kernels.curved_joint import find_joint_system, move_jointly
from rubhpc.kernels.curved_loads import LOADS, MISSED, MOVE
from rubhpc.kernels.curved_slopes import fill_answers

RADIUS, CLEARANCE, ASIDE, FRICTION = 0.05, 1e-4, 2e-5, 0.3
CLOSED = (0, 2)  # of three pairs
MASK = sum(1 << i for i in CLOSED)
N_STATE = 3


class Pairs:
    """Three pairs whose motions are the coordinates themselves, and their states by the equations alone."""

    def __init__(self, n_bending, is_round):
        generator = np.random.default_rng(3)
        self.d, self.is_round = 2 + n_bending, is_round
        d, n = self.d, len(CLOSED)
        root = generator.normal(size=(3 * (d + 1), 3 * (d + 1)))
        self.gram = (root @ root.T).reshape(3, d + 1, 3, d + 1)
        self.moved = 0.2 * generator.normal(size=(3, d + 1, 3))
        self.accel = 1e7 * generator.normal(size=(3, d, 3))
        self.accel_rate = 1e3 * generator.normal(size=(3, d, 3))
        bends = [5e-3] * n_bending
        size = [1e-4, 2e-3, *bends, 0.1, 0.4, *[1.0] * n_bending, 1.0, 2e3, 1e3, *[1e3] * n_bending]
        self.size = np.tile(size, (n, 1))
        self.read = self.size * generator.normal(size=self.size.shape)

    def height(self, m):
        rim = RADIUS - np.sqrt(RADIUS**2 - (m[1] + ASIDE) ** 2) if self.is_round else 0.0
        return rim + 0.5 * m[2:] @ m[2:]

    def found(self, read):
        """h, its rate and the force of the closed pairs, and where they hold."""
        d, at = self.d, np.ix_(CLOSED, range(self.d), CLOSED)
        u, v, a = read[:, :d], read[:, d : 2 * d + 1], read[:, 2 * d + 1 :]
        moved = self.moved[np.ix_(CLOSED, range(d + 1), CLOSED)]

        def missed(h):
            motion = u - moved[:, :d] @ (1e-4 * h)
            return h - [1e4 * self.height(m) for m in motion]

        h = 1e-4 * fsolve(missed, np.zeros(len(CLOSED)), xtol=1e-14)
        motion = u - moved[:, :d] @ h
        across = motion[:, 1] + ASIDE
        slope = motion.copy()
        slope[:, 0] = 0.0
        slope[:, 1] = across / np.sqrt(RADIUS**2 - across**2) if self.is_round else 0.0
        follows = np.eye(len(CLOSED)) + np.einsum("ij,ijk->ik", slope, moved[:, :d])
        rate = np.linalg.solve(follows, np.sum(slope * v[:, :d], axis=1))
        rates = v - moved @ rate
        reach = RADIUS + CLEARANCE + motion[:, 0] + 0.5 * np.sum(motion[:, 2:] ** 2, axis=1)
        angle = np.arctan2(across, reach) * self.is_round
        cosine, sine = np.cos(angle), np.sin(angle)
        nothing = np.zeros((len(CLOSED), 1))
        jacobian = np.hstack([np.stack([cosine, sine], 1), cosine[:, None] * motion[:, 2:], nothing])
        pressing, aslant = cosine - FRICTION * sine, sine + FRICTION * cosine
        twist = nothing - FRICTION * RADIUS
        direction = np.hstack([np.stack([pressing, aslant], 1), pressing[:, None] * motion[:, 2:], twist])
        bending = np.sum(motion[:, 2:] * rates[:, 2:d], axis=1)
        turning = cosine * rates[:, 1] - sine * (rates[:, 0] + bending)
        bends = cosine * np.sum(rates[:, 2:d] ** 2, axis=1)
        bends += turning**2 / np.hypot(reach, across) * self.is_round
        accelerations = a + self.accel[at] @ h + self.accel_rate[at] @ rate
        gram = self.gram[np.ix_(CLOSED, range(d + 1), CLOSED, range(d + 1))]
        matrix = np.einsum("ia,iakb,kb->ik", jacobian, gram, direction)
        force = -np.linalg.solve(matrix, np.sum(jacobian[:, :d] * accelerations, axis=1) + bends)
        states = np.stack([h, rate, force], 1)  # of a pair after the other
        return states, (motion, rates, accelerations, jacobian, direction, cosine, sine)

    def kernel_pairs(self):
        same = {"radius": RADIUS, "clearance": CLEARANCE, "aside": ASIDE, "friction": FRICTION}
        fields = {name: np.full(3, value) for name, value in same.items()}
        return SimpleNamespace(gram=self.gram, is_round=self.is_round, **fields)


@pytest.mark.parametrize(("n_bending", "is_round"), [(0, True), (2, True), (2, False)])
def test_slopes_are_those_of_the_equations(n_bending, is_round):
    pairs = Pairs(n_bending, is_round)
    d, n_read = pairs.d, 3 * pairs.d + 1
    m = len(CLOSED) * n_read
    states, (motion, rates, accelerations, jacobian, direction, cosine, sine) = pairs.found(pairs.read)
    work = curved_work(3, d + 1, 1, m, 0, 1)
    node = 1
    for c, i in enumerate(CLOSED):
        work.motion[0, i, :d], work.motion[1, i] = motion[c], rates[c]
        work.motion[2, i, :d] = accelerations[c]
        work.jacobian[i], work.direction[i] = jacobian[c], direction[c]
        work.normal[:, i] = cosine[c], sine[c]
        work.h[node, i], work.rate[node, i], work.force[node, i] = states[c]
    read = np.zeros((1, 3, n_read, m))
    for c, i in enumerate(CLOSED):
        read[0, i, :, c * n_read : (c + 1) * n_read] = np.eye(n_read)
    tables = SimpleNamespace(
        bound=np.zeros((1, 3, d, m)),
        read_re=read,
        read_im=2.0 * read,
        moved=pairs.moved[None],
        accel=pairs.accel[None],
        accel_rate=pairs.accel_rate[None],
        load_re=np.random.default_rng(4).normal(size=(1, 3, d + 2, m)),
        load_im=np.zeros((1, 3, d + 2, m)),
    )
    assert interpreted(fill_answers)(pairs.kernel_pairs(), tables, 0, MASK, node, work)
    slopes = work.follow[node - 1, : N_STATE * len(CLOSED)]
    assert slopes[:, 1] == pytest.approx(2.0 * slopes[:, 0])
    scale = np.abs(states).max(axis=0)
    for j, size in enumerate(pairs.size.ravel()):
        change = np.zeros(m)
        change[j] = 1e-5 * size
        change = change.reshape(pairs.read.shape)
        beside = [pairs.found(pairs.read + sign * change)[0] for sign in (1, -1)]
        expected = (beside[0] - beside[1]) / (2e-5 * size)
        found = slopes[:, 0, j].reshape(len(CLOSED), N_STATE)
        assert np.all(np.abs(found - expected) * size <= 1e-6 * np.abs(expected) * size + 1e-8 * scale), j
    for c, i in enumerate(CLOSED):
        lever = np.array([direction[c, 0] - 1.0, direction[c, 1] - FRICTION, *direction[c, 2:d]])
        assert work.levers[node - 1, c] == pytest.approx(lever)
        assert work.push[node - 1, c, 0] == pytest.approx(lever @ tables.load_re[0, i, 2:])


def test_one_move_finds_loads_that_answer_linearly():
    """Loads that depend on h, its rate and the force alone, and these linearly on what loads do."""
    generator, d, m, level = np.random.default_rng(5), 4, 6, 1
    n_load, n_node, p = d + 2, N_NODE - 1, len(CLOSED)
    work = curved_work(3, d + 1, 1, m, 0, 2)
    n_state = N_STATE * p
    work.follow[:, :n_state] = generator.normal(size=(n_node, n_state, 2, m))
    work.levers[:, :p] = generator.normal(size=(n_node, p, d))
    shape = {"weight": (1, 2, n_node, N_NODE, m), "load": (1, 3, n_load, m)}
    parts = {name: [0.3 * generator.normal(size=size) for _ in range(2)] for name, size in shape.items()}
    tables = SimpleNamespace(
        **{f"{name}_{part}": parts[name][k] for name in shape for k, part in enumerate(("re", "im"))}
    )
    load, weight = (parts[name][0] + 1j * parts[name][1] for name in ("load", "weight"))
    for node in range(n_node):
        for c, i in enumerate(CLOSED):
            push = work.levers[node, c] @ load[0, i, 2:]
            work.push[node, c, 0], work.push[node, c, 1] = push.real, push.imag
    row = work.follow[:, :n_state, 0] + 1j * work.follow[:, :n_state, 1]
    offset = generator.normal(size=p * n_node * n_load)

    def answered(x):
        loads = x.reshape(p, n_node, n_load)
        driven = np.einsum("cnl,clm->nm", loads, load[0, list(CLOSED)])
        reached = np.einsum("anm,nm->am", weight[0, level, :, 1:], driven)
        state = np.einsum("asm,am->as", row, reached).real.reshape(n_node, p, N_STATE)
        image = np.zeros_like(loads)
        for c in range(p):
            image[c, :, :2] = state[:, c, :2]
            image[c, :, 2:] = state[:, c, 2:] * work.levers[:, c]
        return offset + image.ravel()

    assert interpreted(find_joint_system)(tables, 0, level, MASK, work)
    start = generator.normal(size=offset.size)
    work.point[LOADS, : start.size] = start
    work.point[MISSED, : start.size] = answered(start) - start
    interpreted(move_jointly)(tables, 0, level, MASK, work)
    loads = work.point[LOADS, : start.size]
    assert np.abs(work.point[MOVE]).max() > 1.0
    assert answered(loads) == pytest.approx(loads, rel=1e-8, abs=1e-8)


def test_a_set_of_all_pairs_has_every_pair():
    assert all(interpreted(is_closed)(ALL, i) for i in (0, 5, 31))
