"""Parts of the collocation integrator: polynomials, phi functions, tables, gaps, slopes, impulses, roots."""

import math

import numpy as np
import pytest
from calling import interpreted
from scipy.integrate import quad
from scipy.linalg import expm
from set_ups import prepared
from trial_rig import trial_rig

from rubhpc import State
from rubhpc.integrate.marches.collocation import CollocationMarch
from rubhpc.kernels.collocation import equations, events, gaps, impacts, motions, newton, tables
from rubhpc.kernels.collocation.structures import (
    ACROSS,
    BACKWARD,
    BENDING,
    FORWARD,
    FRICTION,
    MATRIX,
    OPEN,
    RATE,
    SLIP,
    STICKING,
    TWIST,
    lobatto_nodes,
)

SPEED, CLEARANCE, FRICTION_RATIO = 170.0, 40e-6, 0.3
EVERY_S = pytest.mark.parametrize("s", [4, 5])
STICKY = {"friction_law": "coulomb", "static_friction_ratio": 1.2}
STRIBECK = {"friction_law": "stribeck", "static_friction_ratio": 1.4, "stribeck_speed": 2.0}
TABLE = {"friction_law": "table", "slip_speed": (0.0, 5.0, 40.0), "friction_ratio": (1.2, 1.0, 0.5)}
SPRINGS = {"law": "penalty", "stiffness": 1e7}
DAMPED = SPRINGS | {"damping": 300.0}
HERTZ = {"law": "hertz", "stiffness": 1e9, "damping": 2.0}


def march_of(n_stator=1, *, geometry="linear", accuracy=1e-3, **contact):
    """A march at rest, and its pairs."""
    setup = prepared(trial_rig(n_stator, geometry=geometry, cross=1e5), SPEED, accuracy=accuracy, **contact)
    march = CollocationMarch(setup, CLEARANCE, FRICTION_RATIO, State.at_rest(setup.model), None)
    return march, march._contacts


@EVERY_S
def test_nodes_are_lobattos(s):
    """Both ends, and between them the extremes of Legendre's polynomial; exact up to the degree 2 s - 3."""
    nodes, inner = lobatto_nodes(s), {4: [math.sqrt(1 / 5)], 5: [0.0, math.sqrt(3 / 7)]}[s]
    known = np.unique(np.concatenate([[-1.0, 1.0], inner, np.negative(inner)]))
    assert 2.0 * nodes.at - 1.0 == pytest.approx(known, abs=1e-15)
    for degree in range(2 * s - 2):
        assert nodes.integral[-1] @ nodes.at**degree == pytest.approx(1.0 / (degree + 1), rel=1e-13)


@EVERY_S
def test_polynomials_on_nodes_are_those_of_numpy(s):
    nodes, rng = lobatto_nodes(s), np.random.default_rng(s)
    known = np.polynomial.Polynomial(rng.normal(size=s))
    values, x = known(nodes.at), np.linspace(0.0, 1.0, 7)
    assert nodes.power.T @ values == pytest.approx(known.coef, abs=1e-11)
    assert nodes.integral @ values == pytest.approx(known.integ()(nodes.at), abs=1e-12)
    assert nodes.end_slope @ values == pytest.approx(known.deriv()(1.0), abs=1e-11)
    series = np.polynomial.Legendre(nodes.legendre @ values, domain=[0.0, 1.0])
    assert series(x) == pytest.approx(known(x), abs=1e-12)
    k = np.arange(s)
    bernstein = [math.comb(s - 1, i) * x**i * (1.0 - x) ** (s - 1 - i) for i in k]
    assert (nodes.bernstein @ values) @ bernstein == pytest.approx(known(x), abs=1e-11)
    longer = np.polynomial.Polynomial(rng.normal(size=s + 2))
    seen = np.concatenate([longer(nodes.at), longer.deriv()([0.0, 1.0])])
    assert nodes.hermite @ seen == pytest.approx(longer.coef, abs=1e-10)


SMALL = [0.0, 1e-300, 1e-9, -1e-6j, 0.1j, -0.3 + 0.4j, -1.499, 1.06j + 1.06]
LARGE = [-1.501, 1.07j + 1.07, -20.0, 3.0 - 7.0j, -400.0 + 900.0j, -1e6, 1e5j]


@pytest.mark.parametrize("x", SMALL + LARGE)
def test_phi_functions_are_the_integrals_that_define_them(x):
    """phi_k = int_0^1 exp(x (1 - t)) t^(k - 1) dt / (k - 1)!; large ones by their recurrence from above."""
    phi = np.zeros(6, complex)
    interpreted(tables.fill_phi)(complex(x), phi)
    assert phi[0] == pytest.approx(np.exp(x), rel=1e-14)
    for k in range(1, 6):
        if abs(x) > 100.0:  # phi_k = 1/k! + x phi_(k+1)
            known = -sum(x ** (j - k) / math.factorial(j) for j in range(k)) + np.exp(x) * x**-k
        else:
            real, imaginary = (
                quad(
                    lambda t, k=k, part=part: part(np.exp(x * (1.0 - t)) * t ** (k - 1)),
                    *(0.0, 1.0), epsabs=1e-14, limit=200,
                )[0] / math.factorial(k - 1)
                for part in (np.real, np.imag)
            )  # fmt: skip
            known = complex(real, imaginary)
        assert phi[k] == pytest.approx(known, rel=1e-11)


@pytest.mark.parametrize("contact", [{}, DAMPED], ids=["4 nodes", "5 nodes"])
def test_a_step_is_the_motion_under_loads_that_are_polynomials(contact):
    """Against the matrix exponential of the reduced equations with the loads' derivatives as unknowns."""
    march, bodies = march_of(2, geometry="second_order", **contact)
    modes, reduced, rng = march._modes, march._setup.reduced, np.random.default_rng(3)
    n, s, slot = len(reduced.stiffness), modes.nodes.at.size, modes.tables.is_filled.size - 1
    n_row = len(modes.local)
    interpreted(tables.fill_step)(bodies, modes.nodes, modes.tables, slot)
    step = modes.tables.tick * 2.0 ** (modes.tables.first_level + slot)
    load = rng.normal(size=(s, n_row))
    motion = rng.normal(size=2 * n) * np.repeat([1e-5, 1e-5 * SPEED], n)
    x = modes.coordinates(motion)
    assert modes.motion @ x == pytest.approx(motion, abs=1e-9 * np.abs(motion).max())
    y = modes.tables.free[slot] @ x + modes.tables.forced[slot].T @ load.ravel()
    after = np.zeros_like(x)
    interpreted(tables.end_of_step)(bodies, modes.tables, slot, x, load.ravel(), after)

    power = (modes.nodes.power.T @ load) * np.array([math.factorial(m) / step**m for m in range(s)])[:, None]
    size = 2 * n + 2 + s
    rate = np.zeros((size, size))  # motion, cosine and sine of the shaft's angle, derivatives of the load
    rate[:n, n : 2 * n] = np.eye(n)
    rate[n : 2 * n, :n], rate[n : 2 * n, n : 2 * n] = -reduced.stiffness, -reduced.damping
    rate[n : 2 * n, 2 * n : 2 * n + 2] = reduced.force.T
    rate[2 * n, 2 * n + 1], rate[2 * n + 1, 2 * n] = -SPEED, SPEED
    moved = np.zeros((n_row, s + 1, 2 * n))
    rate[2 * n + 2 : -1, 2 * n + 3 :] = np.eye(s - 1)
    for r in range(n_row):
        rate[n : 2 * n, 2 * n + 2] = modes.local[r]
        for i, at in enumerate(modes.nodes.at[1:], 1):
            start = np.zeros(size)
            start[2 * n + 2 :] = power[:, r]
            moved[r, i] = (expm(rate * step * at) @ start)[: 2 * n]
    free = np.concatenate([motion, [1.0, 0.0]])
    for i, at in enumerate(modes.nodes.at[1:], 1):
        known = (expm(rate[: 2 * n + 2, : 2 * n + 2] * step * at) @ free)[: 2 * n] + moved[:, i].sum(axis=0)
        place, going = modes.local @ known[:n], modes.local @ known[n:]
        for kind, those in enumerate((place, going)):
            rows = [interpreted(tables.row_of)(s, bodies.n_local, r, kind, i) for r in range(n_row)]
            assert y[rows] == pytest.approx(those, abs=1e-8 * np.abs(those).max())
    assert modes.motion @ after == pytest.approx(known, abs=1e-8 * np.abs(known).max())


def local_motions(rng, bodies, rows):
    """Random local motions (rows, R): micrometres along the axis, bends of a twentieth of a millimetre."""
    place = rng.normal(scale=1e-4, size=(rows, bodies.load.shape[0])).reshape(rows, -1, bodies.n_local)
    place[..., ACROSS] *= 10.0
    place[..., BENDING:] *= 30.0
    return place.reshape(rows, -1)


@pytest.mark.parametrize("normal", ["fixed", "updated"])
def test_gaps_are_distances_and_their_slopes_and_curvatures_derivatives(normal):
    march, bodies = march_of(1, geometry="second_order", normal=normal)
    solution, rng = march._solution, np.random.default_rng(5)
    n_local, tip = bodies.n_local, bodies.radius[0] + CLEARANCE
    see, bend = interpreted(gaps.see_gap), interpreted(gaps.see_bend)

    def seen(q):
        see(bodies, 0, q, 0, 0, solution)
        return solution.gap[0], solution.normal[0].copy(), solution.tangent[0].copy()

    for q in local_motions(rng, bodies, 8):
        line = complex(tip + q[0] + 0.5 * np.sum(q[BENDING:] ** 2), bodies.aside[0] + q[ACROSS])
        gap, slope, tangent = seen(q)
        known = (abs(line) if normal == "updated" else line.real) - bodies.radius[0]
        assert gap == pytest.approx(known, abs=1e-16)
        assert interpreted(gaps.gap_of)(bodies, 0, q, 0) == gap
        unit = line / abs(line) if normal == "updated" else 1.0
        assert complex(*slope[:2]) == pytest.approx(unit)
        assert complex(*tangent[:2]) == pytest.approx(1j * unit)
        assert tangent[TWIST] == -1.0
        bend(bodies, 0, solution)
        for a in range(n_local):
            by = 1e-7 * np.eye(n_local)[a]
            (one, n_one, t_one), (two, n_two, t_two) = seen(q + by), seen(q - by)
            assert (one - two) / 2e-7 == pytest.approx(slope[a], abs=1e-7)
            scale = 1.0 if a >= BENDING else 10.0
            assert (n_one - n_two) / 2e-7 == pytest.approx(solution.normal_bend[:, a], abs=1e-6 * scale)
            assert (t_one - t_two) / 2e-7 == pytest.approx(solution.tangent_bend[:, a], abs=1e-6 * scale)


class Step:
    """The equations of a step at random forces and displacements, in the order of the matrix."""

    def __init__(self, march, bodies, state, slot, seed=7):
        self.bodies, self.nodes, self.tables = bodies, march._modes.nodes, march._modes.tables
        self.solution, self.state, self.slot = march._solution, np.array(state), slot
        rng, s, n_local = np.random.default_rng(seed), self.nodes.at.size, bodies.n_local
        interpreted(tables.fill_step)(bodies, self.nodes, self.tables, slot)
        n_row, self.has_place = bodies.load.shape[0], not bodies.is_straight
        self.x = march._modes.coordinates(march._motion + 1e-4 * rng.normal(size=march._motion.size))
        interpreted(motions.see_start)(bodies, self.x, self.solution)
        self.n_closed, self.n_pushed, self.n = interpreted(motions.list_closed)(
            bodies, self.nodes, self.state, self.solution
        )
        interpreted(newton.use_matrix)(bodies, self.tables, slot, self.state, self.solution)
        self.solution.y_free[:] = self.tables.free[slot] @ self.x
        self.force = 5.0 + rng.normal(size=(len(self.state), 2, s))
        self.force[:, FRICTION] *= 0.2
        self.solution.place[:] = local_motions(rng, bodies, s)
        self.solution.place[0] = self.solution.start[:n_row]
        self.unknown, self.size = [], []
        for i in np.flatnonzero(self.state):
            n_force = interpreted(motions.n_force)(bodies, self.state[i])
            self.unknown += [(self.force, (i, f, k)) for f in range(n_force) for k in range(s)]
        self.size += [1.0] * len(self.unknown)
        for i in np.flatnonzero(self.state) if self.has_place else []:
            columns = [i * n_local + a for a in range(n_local) if a != TWIST]
            self.unknown += [(self.solution.place, (k, a)) for k in range(1, s) for a in columns]
        self.size += [1e-5] * (len(self.unknown) - len(self.size))

    def residual(self):
        """All residuals."""
        s, n_local, solution = self.nodes.at.size, self.bodies.n_local, self.solution
        given = self.bodies, self.nodes, self.state, self.force, self.n_closed, solution
        for i in np.flatnonzero(self.state):
            for k in range(s):
                interpreted(gaps.see_gap)(self.bodies, i, solution.place[k], i * n_local, i * s + k, solution)
        interpreted(motions.push_closed)(*given)
        blocks, pairs = (0, 2 * s - 1), (0, self.n_closed)
        interpreted(motions.respond)(
            self.bodies,
            s,
            self.tables.forced[self.slot],
            self.n_closed,
            blocks,
            pairs,
            solution.load,
            solution,
        )
        if not self.has_place:
            interpreted(motions.follow_loads)(self.bodies, self.nodes, self.n_closed, solution)
            interpreted(motions.see_gaps)(self.bodies, self.nodes, self.n_closed, solution)
        is_lean = False
        interpreted(equations.fill_residual)(
            *given[:2], self.tables, self.slot, *given[2:5], is_lean, solution
        )
        return self.solution.residual[: self.n].copy()

    def by_differences(self):
        """Slopes (n, n) of the residuals in the unknowns, over the sizes of these."""
        columns = []
        for (array, place), size in zip(self.unknown, self.size, strict=True):
            kept, ends = array[place], []
            for by in (1e-3 * size, -1e-3 * size):
                array[place] = kept + by
                ends.append(self.residual())
            array[place] = kept
            columns.append((ends[0] - ends[1]) / 2e-3)
        return np.array(columns).T

    def matrix(self):
        """The same by `fill_matrix`, from its inverse."""
        self.residual()
        given = self.bodies, self.nodes, self.tables, self.slot, self.state, self.force
        blocks = 0, 2 * self.nodes.at.size - 1
        assert interpreted(newton.fill_matrix)(*given, self.n_closed, blocks, self.solution)
        inverse = self.solution.matrix[self.solution.used[MATRIX], : self.n, : self.n]
        found = np.linalg.inv(inverse).T
        return found * self.size


@pytest.mark.parametrize("normal", ["fixed", "updated"])
@pytest.mark.parametrize("geometry", ["linear", "second_order"])
@pytest.mark.parametrize(
    ("contact", "state"),
    [
        ({}, (FORWARD, FORWARD)),
        (STICKY, (BACKWARD, STICKING)),
        (STRIBECK, (FORWARD, STICKING)),
        (TABLE, (STICKING, BACKWARD)),
        (SPRINGS, (FORWARD, OPEN)),
        (DAMPED | STICKY, (STICKING, FORWARD)),
        (DAMPED | STRIBECK, (FORWARD, STICKING)),
        (HERTZ | STICKY, (STICKING, FORWARD)),
    ],
    ids=["hard", "stick", "stribeck", "table", "spring", "damped stick", "damped stribeck", "hertz stick"],
)
def test_the_matrix_has_the_slopes_of_the_residuals(contact, state, geometry, normal):
    march, bodies = march_of(2, geometry=geometry, normal=normal, accuracy=0.1, **contact)
    step = Step(march, bodies, state, slot=march._modes.tables.is_filled.size - 2)
    known, found = step.by_differences(), step.matrix()
    scale = np.abs(known).max(axis=1, keepdims=True)
    error = np.abs(found - known) / scale
    assert error.max() < 2e-6


@pytest.mark.parametrize("normal", ["fixed", "updated"])
@pytest.mark.parametrize("geometry", ["linear", "second_order"])
def test_open_pairs_that_touch_in_a_step_are_near(geometry, normal):
    """Under random loads of a closed pair, of every size: some are near and stay open, none is missed."""
    march, bodies = march_of(3, geometry=geometry, normal=normal, accuracy=0.1)
    modes, solution, rng = march._modes, march._solution, np.random.default_rng(11)
    s, n_local, n_row = modes.nodes.at.size, bodies.n_local, bodies.load.shape[0]
    slot, state = modes.tables.is_filled.size - 1, np.array([FORWARD, OPEN, OPEN])
    interpreted(tables.fill_step)(bodies, modes.nodes, modes.tables, slot)
    step = modes.tables.tick * 2.0 ** (modes.tables.first_level + slot)
    listed, touched = 0, 0
    for size in np.repeat(np.geomspace(1e-8, 1e2, 13), 4):
        x = modes.coordinates(march._motion + size * 1e-4 * rng.normal(size=march._motion.size))
        interpreted(motions.see_start)(bodies, x, solution)
        solution.load[:] = 0.0
        solution.load.reshape(s, n_row)[:, :n_local] = size * rng.normal(size=(s, n_local))
        solution.closed[0] = 0
        n = interpreted(motions.list_near)(bodies, modes.nodes, step, x, state, 1, solution)
        near = set(solution.closed[1:n].tolist())
        begun = solution.start[:n_row].copy()
        y = modes.tables.free[slot] @ x + modes.tables.forced[slot].T @ solution.load
        for i in range(1, 3):
            places = [begun[i * n_local : (i + 1) * n_local]]
            first = [interpreted(tables.place_row)(s, n_local, i, k) for k in range(1, s)]
            places += [y[row : row + n_local] for row in first]
            touches = min(interpreted(gaps.gap_of)(bodies, i, q, 0) for q in places) <= 0.0
            assert not touches or i in near
            touched += touches
        listed += len(near)
    assert 0 < touched < listed < 2 * 52


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("restitution", [0.0, 0.6])
def test_impulses_obey_newton_and_coulomb(seed, restitution):
    """Two pairs that touch at once: rates come back by the restitution, slips stop or keep their sense."""
    march, bodies = march_of(2, restitution=restitution, **STICKY)
    solution, rng, s = march._solution, np.random.default_rng(seed), march._modes.nodes.at.size
    n_row = bodies.load.shape[0]
    root = rng.normal(size=(n_row, n_row))
    bodies = bodies._replace(compliance=root @ root.T + np.eye(n_row))
    solution.start[:] = 0.0
    solution.start[n_row : 2 * n_row] = rng.normal(size=n_row)
    touching, none = np.ones(2, bool), np.zeros(2, bool)
    interpreted(impacts.find_impulses)(bodies, s, touching, none, none, 0.0, solution)
    impulse, before = solution.impulse.copy(), [solution.seen[i * s].copy() for i in range(2)]
    n, t = impulse.T[:, :, None]
    load = n * solution.normal[::s] + t * solution.tangent[::s]
    solution.start[n_row : 2 * n_row] += bodies.compliance @ load.ravel()
    for i in range(2):
        interpreted(impacts.see_rates)(bodies, s, i, solution)
        rate, slip = solution.seen[i * s, RATE], solution.seen[i * s, SLIP]
        n, t = impulse[i]
        wanted = -restitution * min(before[i][RATE], 0.0)
        assert n >= 0.0
        assert rate >= wanted - 1e-9
        assert n * (rate - wanted) == pytest.approx(0.0, abs=1e-9)
        assert abs(t) <= FRICTION_RATIO * n * (1 + 1e-9)
        if abs(t) < FRICTION_RATIO * n * (1 - 1e-9):
            assert slip == pytest.approx(0.0, abs=1e-9)
        else:
            assert t * slip >= -1e-9


@EVERY_S
def test_first_roots_are_those_of_numpy(s):
    nodes, rng, n_found = lobatto_nodes(s), np.random.default_rng(2), 0
    first = interpreted(events.first_root)
    for _ in range(60):
        known = np.polynomial.Polynomial.fromroots(rng.uniform(-1.0, 2.0, s - 1))
        known = known if known(0.0) > 0.0 else -known
        roots = np.sort(known.roots().real)
        apart = np.diff(np.clip(roots, -0.1, 1.1))
        if ((apart > 0.0) & (apart < 0.07)).any():  # a pair within a sixteenth of a step may be missed
            continue
        inside = roots[(roots > 0.0) & (roots < 1.0)]
        expected = inside[0] if inside.size else 2.0
        n_found += inside.size > 0
        assert first(nodes, known(nodes.at), 0.0) == pytest.approx(expected, abs=1e-10)
    assert n_found > 10


@pytest.mark.parametrize(("speed", "jerk"), [(2e-3, 0.0), (3e-3, 4e5), (1e-4, -2e5)])
def test_gap_that_opens_comes_back_where_its_cubic_does(speed, jerk):
    """Of v t - a t^2 / 2 + j t^3 / 6, whose acceleration fades or grows."""
    span, acceleration = 1.0, 1.0e-2
    jerk *= 1e-8
    roots = np.roots([jerk / 6, -acceleration / 2, speed]).real if jerk else [2 * speed / acceleration]
    expected = min(root for root in roots if root > 0.0)
    assert expected < span
    mean = speed - acceleration / 2 + jerk / 6
    comes = speed - acceleration + jerk / 2
    assert interpreted(events.return_place)(speed, comes, mean) == pytest.approx(expected, rel=1e-12)
    assert interpreted(events.return_place)(-speed, comes, mean) == 0.0
