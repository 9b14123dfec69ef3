"""A case solved another way, as a reference for the product.

What differs on purpose: the matrices (`reference_bodies`), motion between contact forces is the exact matrix
exponential with the force constant over a step, geometry lives in the complex plane, and the touching pairs
are found by trying every set of them.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
from exponential import expm
from reference_bodies import PER_PAIR, set_up

N_AHEAD = 64  # steps looked ahead while nothing touches
CLOSED = 1e-14  # m


def solve(rig, spin, clearance, friction, normal, revolutions, samples_per_revolution, longest_step):
    """Samples from rest by their names in the record; peak force (N) and number of contacts of each pair.

    Forces are constant over a step. Closing the gap at the step's end would let them alternate from step to
    step for ever (the sampled double integrator has its zero at -1); closed is therefore the gap to which the
    end's velocities lead half a step later. While touching both are the same, as the gap's rate is zero.
    """
    bodies = set_up(rig, spin)
    n, q = len(bodies.mass), len(rig.stator)
    n_state, n_degree = 2 * n + 2, PER_PAIR * q  # the last two states are cos(spin t) and sin(spin t)
    interval = 2 * math.pi / abs(spin) / samples_per_revolution
    per_sample = math.ceil(interval / longest_step)
    h = interval / per_sample
    watched = np.concatenate([bodies.rows.ravel(), bodies.output])
    reading = np.zeros((watched.size, n_state))
    reading[watched >= 0, watched[watched >= 0]] = 1.0

    inverse = np.linalg.inv(bodies.mass)
    rate = np.zeros((n_state + n_degree, n_state + n_degree))  # behind the states stand the constant forces
    rate[:n, n : 2 * n] = np.eye(n)
    rate[n : 2 * n, : 2 * n] = -inverse @ np.hstack([bodies.stiffness, bodies.damping])
    rate[n : 2 * n, 2 * n : n_state] = inverse @ bodies.unbalance.T
    rate[n : 2 * n, n_state:] = inverse @ reading[:n_degree, :n].T
    rate[2 * n, 2 * n + 1], rate[2 * n + 1, 2 * n] = -spin, spin
    whole = expm(rate * h)
    propagator, held = whole[:n_state, :n_state], whole[:n_state, n_state:]
    doublings = [propagator]
    while 2 ** len(doublings) <= N_AHEAD:
        doublings.append(doublings[-1] @ doublings[-1])
    half_later = reading.copy()
    half_later[:, n : 2 * n] = h / 2 * reading[:, :n]
    ahead, motion_ahead = powers(half_later, propagator), powers(reading, propagator)

    pairs = Pairs(rig, clearance, friction * np.sign(spin), normal == "updated", half_later[:n_degree] @ held)
    state = np.zeros(n_state)
    state[2 * n] = 1.0
    n_step = revolutions * samples_per_revolution * per_sample
    motion, force = np.zeros((n_step + 1, watched.size)), np.zeros((n_step + 1, q))
    i = 0
    while i < n_step:
        is_closed = (pairs.gap(ahead[:, :n_degree] @ state) < 0).any(axis=1)
        n_free = min(int(is_closed.argmax()) if is_closed.any() else N_AHEAD, n_step - i)
        motion[i + 1 : i + 1 + n_free] = motion_ahead[:n_free] @ state
        for power, matrix in enumerate(doublings):
            if n_free >> power & 1:
                state = matrix @ state
        i += n_free
        while i < n_step:  # step by step for as long as something touches
            free = ahead[0, :n_degree] @ state
            if not (pairs.gap(free) < 0).any():
                break
            force[i], load = pairs.solve(free)
            state = propagator @ state + held @ load
            i += 1
            motion[i] = reading @ state
    sampled = motion[:-1:per_sample]
    vertical, horizontal, torsion = sampled[:, n_degree:].T
    return {
        "vertical": vertical,
        "horizontal": horizontal,
        "torsion": torsion,
        "stator_axial": sampled[:, 3:n_degree:PER_PAIR].T,
        "stator_lateral": sampled[:, 4:n_degree:PER_PAIR].T,
        "contact_force": force[:-1].reshape(-1, per_sample, q).mean(axis=1).T,
        "peak_contact_force": force.max(axis=0),
        "contacts": ((force[1:] > 0) & (force[:-1] == 0)).sum(axis=0),
        "overlap": float(((force > 0).sum(axis=1) > 1).mean()),
    }


def powers(reading, propagator):
    """What is read after 1 to N_AHEAD steps, (N_AHEAD, n_read, n_state)."""
    rows = [reading @ propagator]
    for _ in range(N_AHEAD - 1):
        rows.append(rows[-1] @ propagator)
    return np.array(rows)


class Pairs:
    """Contact pairs in the complex plane y + i z.

    `moved` (5 q, 5 q) is what unit forces on their degrees do to these in a step.
    """

    def __init__(self, rig, clearance, friction, is_updated, moved):
        self.axis = np.exp(1j * np.array([stator.angle for stator in rig.stator]))
        self.radius = np.array([rig.contact_radius(stator) for stator in rig.stator])
        self.reach = self.radius + clearance + np.array([stator.clearance_offset for stator in rig.stator])
        self.friction, self.is_updated, self.moved = friction, is_updated, moved
        self.touching = (0,)  # the set that was right last time is tried first
        if not is_updated:
            self.force_direction, self.compliance = self.directions(self.axis)

    def line(self, at):
        """From disc centre to tip, (..., q), with the degrees `at` (..., 5 q)."""
        v, w, axial, lateral = (at[..., k::PER_PAIR] for k in (0, 1, 3, 4))
        return (self.reach + axial + 1j * lateral) * self.axis - (v + 1j * w)

    def gap(self, at):
        line = self.line(at)
        return (abs(line) if self.is_updated else (line * self.axis.conj()).real) - self.radius

    def directions(self, n):
        """Forces on the degrees, (5 q, q), for unit normal forces along n (q,), and the compliance (q, q)."""
        on_disc = -n * (1 + 1j * self.friction)  # the rim moves along i n
        on_tip = -on_disc * self.axis.conj()
        along = n * self.axis.conj()
        force_direction, gap_jacobian = np.zeros((2, PER_PAIR * n.size, n.size))
        for j in range(n.size):
            rows = slice(PER_PAIR * j, PER_PAIR * (j + 1))
            twist = -self.friction * self.radius[j]
            force_direction[rows, j] = on_disc[j].real, on_disc[j].imag, twist, on_tip[j].real, on_tip[j].imag
            gap_jacobian[rows, j] = -n[j].real, -n[j].imag, 0.0, along[j].real, along[j].imag
        return force_direction, gap_jacobian.T @ self.moved @ force_direction

    def solve(self, free):
        """Normal forces (q,) >= 0 that leave no gap negative, and the forces on all degrees (5 q,)."""
        q = self.radius.size
        if self.is_updated:
            line = self.line(free)
            self.force_direction, self.compliance = self.directions(line / abs(line))
        sets = (c for size in range(1, q + 1) for c in itertools.combinations(range(q), size))
        for touching in itertools.chain([self.touching], sets):
            chosen = list(touching)
            force = np.zeros(q)
            gap = self.gap(free)
            flexible = self.compliance[np.ix_(chosen, chosen)]
            for _ in range(20):  # the gap of the updated normal is all but linear
                force[chosen] -= np.linalg.solve(flexible, gap[chosen])
                gap = self.gap(free + self.moved @ (self.force_direction @ force))
                if abs(gap[chosen]).max() < CLOSED:
                    break
            if (force >= 0).all() and (gap > -CLOSED).all():
                self.touching = touching
                return force, self.force_direction @ force
        raise AssertionError("no set of touching pairs closes the gaps")
