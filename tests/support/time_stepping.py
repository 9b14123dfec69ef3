"""Rubs in all degrees of freedom by time stepping: matrices, steps and contact problem of its own.

Matrices come from `reference_bodies`. A step is the exponential of the whole system, in its eigenvectors,
with the contact forces constant over it. Closing the gap at the step's end would let them alternate from step
to step for ever (the sampled double integrator has its zero at -1); closed is therefore the gap to which the
end's velocities lead half a step later. Friction opposes the slip at the end, or slides steadily, and the
problem of all pairs is solved pair by pair until nothing changes (Moreau's and Jean's non-smooth contact
dynamics).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from reference_bodies import rotor_matrices, set_up

EXACT = 1e-13  # of the largest force, at which the contact problem is solved
STUCK = 1e-10  # m/s


def solve(
    rig,
    spin,
    clearance,
    friction,
    revolutions,
    per_revolution,
    longest_step,
    static_ratio=1.0,
    *,
    is_sliding=False,
):
    """Samples from rest by their names in the record; of each pair peak force, share of stick and contacts.

    Friction obeys Coulomb's law, or slides steadily in the sense of the spin.
    """
    bodies = set_up(rig, spin)
    n, q = len(bodies.mass), len(rig.stator)
    interval = 2 * math.pi / abs(spin) / per_revolution
    per_sample = math.ceil(interval / longest_step)
    h = interval / per_sample
    inverse = np.linalg.inv(bodies.mass)
    system = np.zeros((2 * n, 2 * n))
    system[:n, n:] = np.eye(n)
    system[n:] = -inverse @ np.hstack([bodies.stiffness, bodies.damping])
    exponent, shape = np.linalg.eig(system)
    enter = np.linalg.inv(shape)
    assert np.abs(shape @ np.diag(exponent) @ enter - system).max() < 1e-8 * np.abs(system).max()
    is_kept = exponent.imag >= 0  # the others are their conjugates
    share = np.where(exponent.imag[is_kept] > 0, 2.0, 1.0)

    turning = bodies.stiffness - spin**2 * bodies.mass + 1j * spin * bodies.damping
    whirl = np.linalg.solve(turning, bodies.unbalance[0] - 1j * bodies.unbalance[1])
    whirl = np.concatenate([whirl, 1j * spin * whirl])
    gap, slip = contact_rows(rig, bodies, spin)
    sag, start = at_rest(rig, bodies, gap, clearance)

    watched = np.block([[gap, np.zeros((q, n))], [np.zeros((q, n)), gap], [np.zeros((q, n)), slip]])
    output = np.zeros((3 + 2 * q, 2 * n))
    seen = np.concatenate([bodies.output, *bodies.rows[:, 3:].T])
    output[np.flatnonzero(seen >= 0), seen[seen >= 0]] = 1.0
    force = np.concatenate([np.zeros((n, 2 * q)), inverse @ np.hstack([gap.T, -slip.T])])
    kick = (np.expm1(exponent * h) / exponent)[:, np.newaxis] * (enter @ force)
    answer = ((watched @ shape) @ kick).real
    answer = np.concatenate([answer[:q] + 0.5 * h * answer[q : 2 * q], answer[2 * q :]])
    still = watched @ np.concatenate([sag, np.zeros(n)])
    still[:q] += clearance + np.array([stator.clearance_offset for stator in rig.stator])
    still[2 * q :] += [rig.contact_radius(stator) * abs(spin) for stator in rig.stator]
    z = enter @ (np.concatenate([start - sag, np.zeros(n)]) - whirl.real)
    signals = np.zeros((revolutions * per_revolution, 3 + 2 * q))
    forces = np.zeros((revolutions * per_revolution, q))
    averaged = max(1, round(20e-6 / h))
    peak, stick, contacts = march(
        np.exp(exponent[is_kept] * h),
        z[is_kept],
        (watched @ shape)[:, is_kept] * share,
        watched @ whirl,
        still,
        kick[is_kept],
        answer,
        np.array([h, spin, friction, static_ratio * friction]),
        (output @ shape)[:, is_kept] * share,
        output @ whirl,
        output @ np.concatenate([sag, np.zeros(n)]),
        per_sample,
        averaged,
        is_sliding,
        signals,
        forces,
    )
    return {
        "vertical": signals[:, 0],
        "horizontal": signals[:, 1],
        "torsion": signals[:, 2],
        "stator_axial": signals[:, 3 : 3 + q].T,
        "stator_lateral": signals[:, 3 + q :].T,
        "contact_force": forces.T,
        "peak_contact_force": peak,
        "stick_fraction": stick,
        "contacts": contacts,
    }


def contact_rows(rig, bodies, spin):
    """What gaps and slips are of all degrees, each (q, n); slip in the sense of the spin."""
    gap, slip = np.zeros((2, len(rig.stator), len(bodies.mass)))
    for i, (stator, rows) in enumerate(zip(rig.stator, bodies.rows, strict=True)):
        axis, along = np.exp(1j * stator.angle), 1j * np.exp(1j * stator.angle)
        gap[i, rows[[0, 1, 3]]] = -axis.real, -axis.imag, 1.0
        seen = along.real, along.imag, rig.contact_radius(stator), -1.0
        for row, value in zip(rows[[0, 1, 2, 4]], seen, strict=True):
            if row >= 0:
                slip[i, row] = np.sign(spin) * value
    return gap, slip


def at_rest(rig, bodies, gap, clearance):
    """Sag under gravity, and that of a shaft which rests on its stators without friction, (n,) each."""
    weight = np.zeros(len(bodies.mass))
    mass = rotor_matrices(rig.rotor)[0]
    weight[: len(mass)] = -rig.rotor.gravity * mass[:, ::2].sum(axis=1)
    sag = np.linalg.solve(bodies.stiffness, weight)
    pressed = np.linalg.solve(bodies.stiffness, gap.T)
    compliance, force = gap @ pressed, np.zeros(len(gap))
    for _ in range(10_000):
        for i in range(len(gap)):
            overlap = clearance + gap[i] @ sag + compliance[i] @ force
            force[i] = max(0.0, force[i] - overlap / compliance[i, i])
    return sag, sag + pressed @ force


@njit
def march(
    decay,
    z,
    seen,
    whirl,
    still,
    kick,
    answer,
    given,
    shown,
    shown_whirl,
    sag,
    per_sample,
    averaged,
    is_sliding,
    signals,
    forces,
):
    """Step through all samples; peaks of the mean force, shares of contact in which pairs stick, contacts."""
    h, spin, sliding, static = given
    q, m = forces.shape[1], z.size
    normal, tangent, was_stuck = np.zeros(q), np.zeros(q), np.zeros(q, np.bool_)
    kept, was_closed = np.zeros((averaged, q)), np.zeros(q, np.bool_)
    total, peak, touched, stuck, contacts = np.zeros((5, q))
    free, slip = np.zeros(3 * q), np.zeros(q)
    for k in range(signals.shape[0] * per_sample):
        i_sample = k // per_sample
        if k % per_sample == 0:
            turn = np.exp(1j * spin * h * k)
            for r in range(shown.shape[0]):
                signals[i_sample, r] = (np.sum(shown[r] * z) + shown_whirl[r] * turn).real + sag[r]
        turn = np.exp(1j * spin * h * (k + 1))
        for a in range(m):
            z[a] *= decay[a]
        for r in range(3 * q):
            value = (whirl[r] * turn).real + still[r]
            for a in range(m):
                value += seen[r, a].real * z[a].real - seen[r, a].imag * z[a].imag
            free[r] = value
        is_near = False
        for i in range(q):
            free[i] += 0.5 * h * free[q + i]
            is_near = is_near or free[i] < 0.0
        if not is_near:
            normal[:], tangent[:] = 0.0, 0.0
        change, size = 1.0, 0.0
        while is_near and change > EXACT * size:
            change, size = 0.0, 0.0
            for i in range(q):
                gap, moved = free[i], free[2 * q + i]
                for j in range(q):
                    if j != i:
                        gap += answer[i, j] * normal[j] + answer[i, q + j] * tangent[j]
                        moved += answer[q + i, j] * normal[j] + answer[q + i, q + j] * tangent[j]
                nn, nt = answer[i, i], answer[i, q + i]
                tn, tt = answer[q + i, i], answer[q + i, q + i]
                pressed, held = 0.0, 0.0
                if gap < 0.0:
                    whole = nn * tt - nt * tn
                    pressed, held = (moved * nt - gap * tt) / whole, (gap * tn - moved * nn) / whole
                    if is_sliding:
                        pressed = -gap / (nn + sliding * nt)
                        held = sliding * pressed
                    elif pressed < 0.0 or abs(held) > (static if was_stuck[i] else sliding) * pressed:
                        pressed = -gap / (nn + sliding * nt)
                        held = sliding * pressed
                        if moved + tn * pressed + tt * held < 0.0:
                            pressed = -gap / (nn - sliding * nt)
                            held = -sliding * pressed
                change = max(change, abs(pressed - normal[i]), abs(held - tangent[i]))
                size = max(size, pressed)
                normal[i], tangent[i] = pressed, held
        for i in range(q):
            slip[i] = free[2 * q + i]
            for j in range(q):
                slip[i] += answer[q + i, j] * normal[j] + answer[q + i, q + j] * tangent[j]
        for i in range(q):
            if normal[i] != 0.0:
                for a in range(m):
                    z[a] += kick[a, i] * normal[i] + kick[a, q + i] * tangent[i]
            was_stuck[i] = normal[i] > 0.0 and abs(slip[i]) < STUCK
            touched[i] += normal[i] > 0.0
            contacts[i] += normal[i] > 0.0 and not was_closed[i]
            was_closed[i] = normal[i] > 0.0
            stuck[i] += was_stuck[i]
            forces[i_sample, i] += normal[i] / per_sample
            total[i] += normal[i] - kept[k % averaged, i]
            kept[k % averaged, i] = normal[i]
            peak[i] = max(peak[i], total[i] / averaged)
    return peak, stuck / np.maximum(touched, 1.0), contacts
