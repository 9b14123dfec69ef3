"""A rub against one stator that bends, solved another way: all degrees, short steps, curved gap.

Matrices come from `reference_bodies`. Between steps the motion is the matrix exponential; in a step the
contact force acts as an impulse at its beginning, along the momentary normal, and closes the gap at its end.
Foreshortening is the integral of the squared slope, by quadrature over the shapes of the elements.
"""

from __future__ import annotations

import math

import numpy as np
from exponential import expm
from reference_bodies import set_up


def squared_slope(stator):
    """Matrix (2 e, 2 e) of the integral of the squared slope, 1/m; deflection and rotation from node 2 on."""
    e = stator.elements
    L, nu = stator.length / e, stator.poissons_ratio
    area, second = stator.width * stator.height, stator.width * stator.height**3 / 12
    E = stator.youngs_modulus
    EI, GA = E * second, 10 * (1 + nu) / (12 + 11 * nu) * E / (2 * (1 + nu)) * area
    flexibility = np.array([[L**3 / (3 * EI) + L / GA, L**2 / (2 * EI)], [L**2 / (2 * EI), L / EI]])
    equilibrium = np.array([[-1.0, 0.0], [-L, -1.0], [1.0, 0.0], [0.0, 1.0]])
    loads = np.linalg.solve(flexibility, equilibrium.T)
    element = np.zeros((4, 4))
    for x, weight in zip(*np.polynomial.legendre.leggauss(6), strict=True):
        x, weight = L * (x + 1) / 2, L * weight / 2
        slope = np.array([0, 1, 0, 0]) + loads.T @ [(L * x - x**2 / 2) / EI + 1 / GA, x / EI]
        element += weight * np.outer(slope, slope)
    whole = np.zeros((2 * e + 2, 2 * e + 2))
    for i in range(e):
        rows = slice(2 * i, 2 * i + 4)
        whole[rows, rows] += element
    return whole[2:, 2:]


def solve(rig, spin, clearance, friction, revolutions, samples_per_revolution, longest_step, *, is_round):
    """Samples from rest by their names in the record, and the peak force, N."""
    (stator,) = rig.stator
    bodies = set_up(rig, spin)
    n = len(bodies.mass)
    slope = np.zeros((n, n))
    slope[-2 * stator.elements :, -2 * stator.elements :] = squared_slope(stator)
    interval = 2 * math.pi / abs(spin) / samples_per_revolution
    per_sample = 32 * math.ceil(interval / longest_step / 32)
    h = interval / per_sample
    inverse = np.linalg.inv(bodies.mass)
    rate = np.zeros((2 * n + 2, 2 * n + 2))
    rate[:n, n : 2 * n] = np.eye(n)
    rate[n : 2 * n, : 2 * n] = -inverse @ np.hstack([bodies.stiffness, bodies.damping])
    rate[n : 2 * n, 2 * n :] = inverse @ bodies.unbalance.T
    rate[2 * n, 2 * n + 1], rate[2 * n + 1, 2 * n] = -spin, spin
    propagator = expm(rate * h)
    kicked = propagator[:, n : 2 * n] @ inverse  # state at the end of a step after unit impulses
    v, w, twist, axial, lateral = bodies.rows[0]
    radius, axis = rig.contact_radius(stator), np.exp(1j * stator.angle)
    mu = friction * np.sign(spin)

    def look(state):
        """Gap, its gradient, and generalised forces of a unit normal force, friction included."""
        x = state[:n]
        drawn = slope @ x
        tip = (radius + clearance + x[axial] + 0.5 * x @ drawn + 1j * x[lateral]) * axis
        line = tip - (x[v] + 1j * x[w])
        normal = line / abs(line) if is_round else axis
        gap = (line * normal.conjugate()).real - radius
        gradients = []
        for direction in (normal, normal * (1 + 1j * mu)):
            along = direction * axis.conjugate()
            force = along.real * drawn
            force[v], force[w] = -direction.real, -direction.imag
            force[axial] += along.real
            force[lateral] += along.imag
            gradients.append(force)
        gradients[1][twist] = -mu * radius
        return gap, *gradients

    n_step = revolutions * samples_per_revolution * per_sample
    state = np.zeros(2 * n + 2)
    state[2 * n] = 1.0
    ahead = [propagator]
    while len(ahead) < 6:
        ahead.append(ahead[-1] @ ahead[-1])
    motion, force = np.zeros((n_step + 1, n)), np.zeros(n_step + 1)
    i = 0
    while i < n_step:
        free = propagator @ state
        gap, _, _ = look(free)
        if gap > 1e-6 and i % 32 == 0 and i + 32 <= n_step:  # far from contact, 32 steps at once
            far = ahead[5] @ state
            if min(gap, look(ahead[4] @ state)[0], look(far)[0]) > 5e-6:
                state, i = far, i + 32
                motion[i] = far[:n]
                continue
        if gap < 0.0:
            _, gradient, direction = look(free)
            impulse = 0.0
            for _ in range(20):
                end = free + kicked @ direction * impulse
                gap, gradient, _ = look(end)
                impulse -= gap / (gradient @ (kicked[:n] @ direction))
                if abs(gap) < 1e-15:
                    break
            free, force[i] = free + kicked @ direction * impulse, impulse / h
        state, i = free, i + 1
        motion[i] = state[:n]
    sampled = motion[:-1:per_sample]
    return {
        "vertical": sampled[:, v],
        "horizontal": sampled[:, w],
        "torsion": sampled[:, twist],
        "stator_axial": sampled[:, axial],
        "stator_lateral": sampled[:, lateral],
        "contact_force": force[:-1].reshape(-1, per_sample).mean(axis=1),
        "peak_contact_force": force.max(),
    }
