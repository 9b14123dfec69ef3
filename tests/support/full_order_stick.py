"""Coulomb's law in all degrees of freedom, from event to event: a reference for flows and their derivatives.

As `full_order_flow`, with a state for each pair: open, sliding either way, or stuck. Which states go on is
found by trying all of them: of impulses at a touch, of accelerations at every event.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from exponential import expm
from full_order_flow import N_STEP, FullOrder, _root
from scipy.optimize import brentq

from rubhpc.integrate.packing import degrees_of

OPEN, AHEAD, BACK, STUCK = 0, 1, -1, 2
NOTHING = 1e-13  # m, N: a smaller gap or force is rounding
SLOW = 1e-9  # m/s: a pair that slips less may stick


class FullOrderStick(FullOrder):
    """A model at a spin (rad/s) with clearances (q,), m, and a coefficient of friction."""

    def __init__(self, model, spin, clearance, friction):
        super().__init__(model, spin, clearance, 0.0)
        q, n, sense = len(model.stators), self.n, np.sign(spin)
        self.friction, self.normal = friction, self.force
        self.slip = np.zeros((q, len(self.free)))
        for i, (stator, rows) in enumerate(zip(model.stators, degrees_of(model), strict=True)):
            along = 1j * np.exp(1j * stator.angle)
            seen = along.real, along.imag, stator.radius, 0.0, -1.0  # of the rim, less that of the tip
            for row, value in zip(rows, seen, strict=True):
                if row >= 0:
                    self.slip[i, n + row] = sense * value
            self.slip[i, -1] = stator.radius * abs(spin)
        self.traction = -self.slip[:, n : 2 * n].T

    def system(self, states):
        """Rate matrix, exponential over a step, and the rows of normal force and friction of every pair."""
        if states not in self._systems:
            rate, n, q = self.free.copy(), self.n, len(states)
            normal, friction = np.zeros((2, q, len(rate)))
            closed = [i for i in range(q) if states[i] != OPEN]
            stuck = [i for i in closed if states[i] == STUCK]
            if closed:
                jacobian = np.concatenate([self.gap[closed, :n], self.slip[stuck, n : 2 * n]])
                sliding = [self.friction * s if (s := states[i]) != STUCK else 0.0 for i in closed]
                pressed = self.normal[:, closed] + sliding * self.traction[:, closed]
                force = np.concatenate([pressed, self.traction[:, stuck]], axis=1)
                rows = -np.linalg.solve(jacobian @ self.inverse @ force, jacobian @ rate[n : 2 * n])
                rate[n : 2 * n] += self.inverse @ force @ rows
                normal[closed] = rows[: len(closed)]
                for i in closed:
                    friction[i] = self.friction * states[i] * normal[i]
                friction[stuck] = rows[len(closed) :]
            self._systems[states] = rate, expm(rate * self.turn / N_STEP), normal, friction
        return self._systems[states]

    def watched(self, states):
        """Rows that are positive while states last, with their pairs and the states of these that follow."""
        _, _, normal, friction = self.system(states)
        found = []
        for i, state in enumerate(states):
            if state == OPEN:
                found.append((self.gap[i], i, STUCK))
                continue
            found.append((normal[i], i, OPEN))
            if state == STUCK:
                found += [(self.friction * normal[i] - way * friction[i], i, way) for way in (AHEAD, BACK)]
            else:
                found.append((state * self.slip[i], i, STUCK))
        return found

    def revolve(self, displacement, velocity, states):
        """Displacement and velocity after a revolution from angle 0, and the states passed through."""
        state = np.concatenate([displacement, velocity, [1.0, 0.0, 1.0]])
        step, time, passed = self.turn / N_STEP, 0.0, [states]
        while time < self.turn * (1 - 1e-12):
            rate, whole, *_ = self.system(states)
            span = min(step, self.turn - time)
            ahead = whole @ state if span == step else expm(rate * span) @ state
            crossing = [
                one
                for one in self.watched(states)
                if one[0] @ ahead < 0 and (one[0] @ state > NOTHING or self.has_parted(one[1], states, state))
            ]
            if not crossing:
                state, time = ahead, time + span
                continue
            roots = [_next_root(row, rate, state, span) for row, *_ in crossing]
            _, first, follows = crossing[int(np.argmin(roots))]
            state, time = expm(rate * min(roots)) @ state, time + min(roots)
            was_open = states[first] == OPEN
            states = (*states[:first], follows, *states[first + 1 :])
            if was_open:
                self.hit(state, [i for i, kind in enumerate(states) if kind != OPEN])
                states = self.going_on(state, states)
            elif follows == STUCK:
                states = self.held(state, states, first)
            passed.append(states)
        n = self.n
        return state[:n], state[n : 2 * n], passed

    def has_parted(self, i, states, state):
        """Whether a pair is open whose gap, nothing as yet, opens: it may close again within the step."""
        return states[i] == OPEN and self.gap[i, : self.n] @ state[self.n : 2 * self.n] > SLOW

    def hit(self, state, pairs):
        """Inelastic impact with Coulomb's law for the impulses, in place."""
        n = self.n
        gap, slip = self.gap[:, :n], self.slip[:, n : 2 * n]
        for kinds in product((OPEN, AHEAD, BACK, STUCK), repeat=len(pairs)):
            closed = [i for i, kind in zip(pairs, kinds, strict=True) if kind != OPEN]
            stuck = [i for i, kind in zip(pairs, kinds, strict=True) if kind == STUCK]
            sliding = [kind * self.friction if kind != STUCK else 0.0 for kind in kinds if kind != OPEN]
            if not closed:
                continue
            rows = np.concatenate([gap[closed], slip[stuck]])
            ways = np.concatenate(
                [self.normal[:, closed] + sliding * self.traction[:, closed], self.traction[:, stuck]], axis=1
            )
            rates = np.concatenate([gap[closed] @ state[n : 2 * n], self.slip[stuck] @ state])
            impulse = -np.linalg.solve(rows @ self.inverse @ ways, rates)
            after = state.copy()
            after[n : 2 * n] += self.inverse @ ways @ impulse
            pushed = dict(zip(closed, impulse, strict=False))
            held = dict(zip(stuck, impulse[len(closed) :], strict=True))
            is_right = all(p >= 0 for p in pushed.values())
            for i, kind in zip(pairs, kinds, strict=True):
                if kind == OPEN:
                    is_right &= gap[i] @ after[n : 2 * n] >= 0
                elif kind == STUCK:
                    is_right &= abs(held[i]) <= self.friction * pushed[i]
                else:
                    is_right &= kind * (self.slip[i] @ after) >= 0
            if is_right:
                state[:] = after
                return
        raise AssertionError("no impulses obey the laws")

    def going_on(self, state, states):
        """States behind an impact: of pairs that part, slip, stick, or part as no force presses them."""
        n, found = self.n, list(states)
        for i in [i for i, kind in enumerate(states) if kind != OPEN]:
            slip = self.slip[i] @ state
            is_parting = self.gap[i, :n] @ state[n : 2 * n] > SLOW
            found[i] = OPEN if is_parting else int(np.sign(slip)) if abs(slip) > SLOW else STUCK
        for i in [i for i, kind in enumerate(found) if kind == STUCK]:
            found = list(self.held(state, tuple(found), i))
        normal = self.system(tuple(found))[2] @ state
        assert all(normal[i] > 0 for i, kind in enumerate(found) if kind != OPEN)
        return tuple(found)

    def held(self, state, states, i):
        """States with a pair stuck, if its friction holds it; else it slips the way that this gives."""
        _, _, normal, friction = self.system(states)
        if abs(friction[i] @ state) <= self.friction * (normal[i] @ state):
            return states
        return (*states[:i], int(np.sign(friction[i] @ state)), *states[i + 1 :])


def _next_root(row, rate, state, span):
    """Time within a span at which a row vanishes, or vanishes again where it begins at nothing."""
    if row @ state > NOTHING:
        return _root(row, rate, state, span)
    turn = brentq(lambda time: row @ rate @ expm(rate * time) @ state, 0.0, span, xtol=1e-16)
    ahead = expm(rate * turn) @ state
    return turn + (_root(row, rate, ahead, span - turn) if row @ ahead > NOTHING else turn)
