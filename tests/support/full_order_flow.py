"""A revolution from event to event in all degrees of freedom: a reference for flows and their derivatives.

Matrices are those assembled. Between events the motion is a matrix exponential of the whole system, with the
accelerations of closed gaps held at zero by the contact forces; events are found by Brent's rule.
"""

from __future__ import annotations

import math

import numpy as np
from exponential import expm
from scipy.optimize import brentq

from rubhpc.integrate.packing import degrees_of, whole_system

N_STEP = 2048  # a revolution
AT_ONCE = 1e-6  # s


class FullOrder:
    """A model at a spin (rad/s) with clearances (q,), m, and sliding friction."""

    def __init__(self, model, spin, clearance, friction):
        mass, damping, stiffness, unbalance = whole_system(model, spin)
        n, q = len(mass), len(model.stators)
        self.n, self.turn = n, 2 * math.pi / abs(spin)
        self.inverse = np.linalg.inv(mass)
        self.free = np.zeros((2 * n + 3, 2 * n + 3))  # then cos, sin and 1
        self.free[:n, n : 2 * n] = np.eye(n)
        self.free[n : 2 * n, :n] = -self.inverse @ stiffness
        self.free[n : 2 * n, n : 2 * n] = -self.inverse @ damping
        self.free[n : 2 * n, 2 * n : 2 * n + 2] = self.inverse @ unbalance.T
        self.free[2 * n, 2 * n + 1], self.free[2 * n + 1, 2 * n] = -spin, spin
        self.gap, self.force = np.zeros((q, 2 * n + 3)), np.zeros((n, q))
        for i, (stator, rows) in enumerate(zip(model.stators, degrees_of(model), strict=True)):
            axis, grip = np.exp(1j * stator.angle), friction * np.sign(spin)
            on_disc = -axis * (1 + 1j * grip)  # the rim moves along i axis
            on_tip = -on_disc * axis.conjugate()
            unit = on_disc.real, on_disc.imag, -grip * stator.radius, on_tip.real, on_tip.imag
            seen = -axis.real, -axis.imag, 0.0, 1.0, 0.0
            for row, f, g in zip(rows, unit, seen, strict=True):
                if row >= 0:
                    self.force[row, i], self.gap[i, row] = f, g
            self.gap[i, -1] = clearance[i]
        self._systems = {}

    def system(self, closed):
        """Rate matrix with a set of closed pairs, exponential over a step, and the rows of their forces."""
        if closed not in self._systems:
            rate, n, rows = self.free.copy(), self.n, np.zeros((0, len(self.free)))
            if closed:
                jacobian, force = self.gap[list(closed), :n], self.force[:, list(closed)]
                rows = -np.linalg.solve(jacobian @ self.inverse @ force, jacobian @ rate[n : 2 * n])
                rate[n : 2 * n] += self.inverse @ force @ rows
            self._systems[closed] = rate, expm(rate * self.turn / N_STEP), rows
        return self._systems[closed]

    def watched(self, closed):
        """Rows that are positive while a set lasts: gaps of open pairs, forces of closed ones."""
        rows = self.gap.copy()
        rows[list(closed)] = self.system(closed)[2]
        return rows

    def revolve(self, displacement, velocity, closed):
        """Displacement and velocity after a revolution from angle 0, and the sets of pairs passed through."""
        state = np.concatenate([displacement, velocity, [1.0, 0.0, 1.0]])
        step, time, passed = self.turn / N_STEP, 0.0, [closed]
        while time < self.turn * (1 - 1e-12):
            rate, whole, _ = self.system(closed)
            span = min(step, self.turn - time)
            ahead = whole @ state if span == step else expm(rate * span) @ state
            rows = self.watched(closed)
            crossing = [i for i in range(len(rows)) if rows[i] @ ahead < 0 and rows[i] @ state > 1e-13]
            if not crossing:
                state, time = ahead, time + span
                continue
            roots = [_root(rows[i], rate, state, span) for i in crossing]
            first = crossing[int(np.argmin(roots))]
            state, time = expm(rate * min(roots)) @ state, time + min(roots)
            if first in closed:
                closed = tuple(i for i in closed if i != first)
            else:
                closed = self.impact(state, (*closed, first))
            passed.append(closed)
        n = self.n
        return state[:n], state[n : 2 * n], passed

    def impact(self, state, candidates):
        """Inelastic impact of a set, in place; those of it that are pressed afterwards.

        A pair that parts, but is pressed together again within a microsecond, stays closed.
        """
        n, hit = self.n, list(candidates)
        while True:
            impulse = self.stop(state, hit)
            if (impulse > 0).all():
                break
            hit = [i for i, p in zip(hit, impulse, strict=True) if p > 0]
        state[n : 2 * n] += self.inverse @ self.force[:, hit] @ impulse
        acceleration = self.gap[:, :n] @ (self.free @ state)[n : 2 * n]
        rate = self.gap[:, :n] @ state[n : 2 * n]
        near = [i for i in candidates if i in hit or rate[i] < -AT_ONCE / 2 * acceleration[i]]
        state[n : 2 * n] += self.inverse @ self.force[:, near] @ self.stop(state, near)
        while True:
            force = self.system(tuple(near))[2] @ state
            if (force > 0).all():
                return tuple(near)
            near = [i for i, f in zip(near, force, strict=True) if f > 0]

    def stop(self, state, pairs):
        """Impulses that stop the gaps of some pairs."""
        jacobian = self.gap[pairs, : self.n]
        give = jacobian @ self.inverse @ self.force[:, pairs]
        return -np.linalg.solve(give, jacobian @ state[self.n : 2 * self.n])


def _root(row, rate, state, span):
    """Time within a span at which a row of the state vanishes."""
    return brentq(lambda time: row @ expm(rate * time) @ state, 0.0, span, xtol=1e-16)
