"""A plane cantilever whose tip follows a rim, by two models: of exact geometry, and of second order.

The exact beam is Reissner's, in quadratic elements with reduced integration; its displacements and rotation
are as large as they like. The beam of second order is linear but for its tip, which draws back by half the
integral of the squared slope, with the matrices of the product. Both press against a rim that drives the tip
towards the root by a given distance, and that drags it sideways with a share of the normal force. Both are
damped in proportion to their strain rates. The constraint is met in the accelerations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(2)


@dataclass(frozen=True)
class Beam:
    """A prismatic cantilever of rectangular section; SI units."""

    length: float = 0.04
    width: float = 0.005
    height: float = 0.002  # along the lateral motion
    youngs_modulus: float = 3e9
    poissons_ratio: float = 0.3
    density: float = 1157.0
    damping: float = 2e-5  # s

    @property
    def area(self):
        return self.width * self.height

    @property
    def second_moment(self):
        return self.width * self.height**3 / 12

    @property
    def rigidities(self):
        """Of stretch and shear, N, and bending, N m2."""
        nu = self.poissons_ratio
        shear = 10 * (1 + nu) / (12 + 11 * nu) / (2 * (1 + nu))
        ea = self.youngs_modulus * self.area
        return ea, shear * ea, self.youngs_modulus * self.second_moment


@dataclass(frozen=True)
class Rim:
    """A rim that drives the tip by `depth` (m) and back in `time` (s), with friction."""

    depth: float
    time: float
    friction: float

    def drive(self, t):
        """How far it has driven the tip, m, at what speed, and with what acceleration."""
        turn = np.pi / self.time  # depth sin^4: smooth where it begins
        s, c = np.sin(turn * t), np.cos(turn * t)
        return (
            self.depth * s**4,
            4 * self.depth * turn * s**3 * c,
            4 * self.depth * turn**2 * (3 * s**2 * c**2 - s**4),
        )


class History(NamedTuple):
    """At equal times: normal force, N (below 0: the rim pulls), and how far the tip is moved sideways, m."""

    force: np.ndarray
    lateral: np.ndarray


def exact(beam: Beam, rim: Rim, *, elements=4, samples=65) -> History:
    """Return the history of the exact beam."""
    n_node, size = 2 * elements + 1, beam.length / elements
    nodes = 2 * np.arange(elements)[:, None] + np.arange(3)  # (e, 3)
    s = POINTS[:, None]
    shape = np.hstack([s * (s - 1) / 2, 1 - s**2, s * (s + 1) / 2])  # (point, 3)
    slope = np.hstack([s - 0.5, -2 * s, s + 0.5]) * 2 / size
    weight = WEIGHTS[:, None] * size / 2
    ea, ga, ei = beam.rigidities

    # Consistent mass, by three points; x, y, rotation of each node.
    point, share = np.polynomial.legendre.leggauss(3)
    full = np.stack([point * (point - 1) / 2, 1 - point**2, point * (point + 1) / 2], axis=1)
    local = beam.density * (full.T * share) @ full * size / 2
    line = np.zeros((n_node, n_node))
    for those in nodes:
        line[np.ix_(those, those)] += local
    mass = np.zeros((3 * n_node, 3 * n_node))
    for i, inertia in enumerate((beam.area, beam.area, beam.second_moment)):
        mass[i::3, i::3] = inertia * line
    mass = mass[3:, 3:]  # the root is held
    inverse = np.linalg.inv(mass)
    tip_x, tip_y = mass.shape[0] - 3, mass.shape[0] - 2

    def inner(q, v):
        """Internal forces, damping included."""
        x, y, angle = (np.concatenate([[0.0], q[i::3]]) for i in range(3))
        dx, dy, turn = (np.concatenate([[0.0], v[i::3]]) for i in range(3))
        xs, ys, bend = (a[nodes] @ slope.T for a in (x, y, angle))  # (e, point)
        dxs, dys, dbend = (a[nodes] @ slope.T for a in (dx, dy, turn))
        t, dt = angle[nodes] @ shape.T, turn[nodes] @ shape.T
        c, sn = np.cos(t), np.sin(t)
        stretch = xs * c + ys * sn - 2.0 * np.sin(t / 2) ** 2  # x counts displacements
        shear = ys * c - (1.0 + xs) * sn
        dstretch = dxs * c + dys * sn + shear * dt
        dshear = dys * c - dxs * sn - (1.0 + stretch) * dt
        n1, n2 = ea * (stretch + beam.damping * dstretch), ga * (shear + beam.damping * dshear)
        m = ei * (bend + beam.damping * dbend)
        along = (n1 * c - n2 * sn) * weight.T
        aside = (n1 * sn + n2 * c) * weight.T
        couple = (n1 * shear - n2 * (1.0 + stretch)) * weight.T
        force = np.zeros((n_node, 3))
        np.add.at(force[:, 0], nodes, along @ slope)
        np.add.at(force[:, 1], nodes, aside @ slope)
        np.add.at(force[:, 2], nodes, (m * weight.T) @ slope + couple @ shape)
        return force.ravel()[3:]

    gradient = np.zeros(len(mass))
    gradient[tip_x] = -1.0  # how far the tip is driven
    direction = gradient.copy()
    direction[tip_y] = rim.friction
    reach = inverse @ direction

    def solve(t, state):
        q, v = state.reshape(2, -1)
        free = -inverse @ inner(q, v)
        return v, free, (rim.drive(t)[2] - gradient @ free) / (gradient @ reach)

    def rate(t, state):
        v, free, force = solve(t, state)
        return np.concatenate([v, free + reach * force])

    found, times = _integrate(rate, 2 * len(mass), rim, samples)
    force = [solve(t, state)[2] for t, state in zip(times, found.T, strict=True)]
    return History(np.array(force), found[tip_y])


def second_order(model, beam: Beam, rim: Rim, *, is_bent=True, samples=65) -> History:
    """Return the history of a stator of the product (`StatorModel`); without `is_bent` its gap is linear."""
    body = model.body
    names = [name for _, name in body.degrees]
    mass, stiffness = body.mass, body.stiffness
    damping = beam.damping * stiffness
    slope = model.squared_slope if is_bent else np.zeros_like(stiffness)
    inverse = np.linalg.inv(mass)
    axial, lateral = model.axial, model.lateral
    assert names[axial] == "axial"

    def solve(t, state):
        q, v = state.reshape(2, -1)
        gradient = slope @ q
        gradient[axial] += 1.0
        direction = gradient.copy()
        direction[lateral] += rim.friction
        free = -inverse @ (stiffness @ q + damping @ v)
        reach = inverse @ direction
        wanted = rim.drive(t)[2] - v @ slope @ v
        return v, free, reach, (wanted - gradient @ free) / (gradient @ reach)

    def rate(t, state):
        v, free, reach, force = solve(t, state)
        return np.concatenate([v, free + reach * force])

    found, times = _integrate(rate, 2 * len(mass), rim, samples)
    force = [solve(t, state)[3] for t, state in zip(times, found.T, strict=True)]
    return History(np.array(force), found[lateral])


def _integrate(rate, size, rim, samples):
    times = np.linspace(0.0, rim.time, samples)
    found = solve_ivp(rate, (0.0, rim.time), np.zeros(size), "Radau", times, rtol=1e-6, atol=1e-10)
    assert found.success
    return found.y, found.t
