"""A driven machine of discs, stators and a carrier by Dormand and Prince's method, derived by itself.

The absolute angles of all discs and of the driven end are coordinates; each unbalance turns with its own
disc, and the first may tilt. Lagrange's equations of

    T = u' M u' / 2 + sum(I_j a_j'^2 / 2 + a_j' Re[i p_j exp(i a_j)] u') - a_1' u G u' / 2 + D d'^2 / 2

are solved for the accelerations. Penalties act between one disc and its ring of stators; friction slides
steadily.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp


@dataclass
class Machine:
    """Lateral degrees are v and w of disc 1, v and w of disc 2, and so on, then tilts if there are any."""

    mass: np.ndarray  # (n_lateral, n_lateral), of n discs
    damping: np.ndarray
    stiffness: np.ndarray
    polar: np.ndarray  # (n,), kg m^2
    torsion: np.ndarray  # (n, n), N m/rad, of the twist about the driven end
    torsion_damping: np.ndarray
    moment: np.ndarray  # (n,), complex, kg m: unbalance of each disc
    rubbed: int  # disc among the stators
    stators: tuple  # each with angle, mass, stiffness, damping, radius
    clearance: float
    friction: float
    penalty: float
    penalty_damping: float
    drive_inertia: float
    torque: object  # of the speed, N m
    load: np.ndarray | None = None  # (n_lateral,), N
    gyroscopic: np.ndarray | None = None  # (n_lateral, n_lateral), of the first disc
    bearings: object = None  # of the speed: stiffness and damping (n_lateral, n_lateral) besides
    carrier: tuple | None = None  # mass, stiffness and damping, in both directions


def driven_machine(machine, *, start, n_revolution, per_revolution, rtol=1e-6):
    """Samples locked to the mean angle: time, speed, and v, w and twist of the rubbed disc by rows.

    Then the work of friction, J, the torque impulses of drive and friction on rotor and drive, N m s, and
    the work of the drive, J.
    """
    m = machine
    n, q = len(m.mass), len(m.stators)
    n_disc = len(m.polar)
    angles = slice(n, n + n_disc)
    end, tips = n + n_disc, slice(n + n_disc + 1, n + n_disc + 1 + q)
    sides = slice(tips.stop, tips.stop + (q if m.carrier else 0))  # lateral motion of the tips
    base = slice(sides.stop, sides.stop + (2 if m.carrier else 0))
    size = base.stop
    axis = np.array([[math.cos(s.angle), math.sin(s.angle)] for s in m.stators])
    along = np.stack([-axis[:, 1], axis[:, 0]], axis=1)  # the way the rim moves
    tip_mass, tip_spring, tip_damper = (
        np.array([getattr(s, name) for s in m.stators]) for name in ("mass", "stiffness", "damping")
    )
    lateral_spring = np.array([s.lateral_stiffness or 0.0 for s in m.stators])
    gyroscopic = np.zeros((n, n)) if m.gyroscopic is None else m.gyroscopic
    radius = m.stators[0].radius
    total = m.polar.sum() + m.drive_inertia
    rub = slice(2 * m.rubbed, 2 * m.rubbed + 2)
    phasors = np.zeros((n_disc, n), complex)
    for j, moment in enumerate(m.moment):
        phasors[j, 2 * j : 2 * j + 2] = moment * np.array([1.0, -1j])
    inertia = np.zeros((size, size))
    inertia[:n, :n] = m.mass
    inertia[angles, angles] = np.diag(m.polar)
    inertia[end, end] = m.drive_inertia
    inertia[tips, tips] = np.diag(tip_mass)
    if m.carrier:
        inertia[sides, sides] = np.diag(tip_mass)
        inertia[base, base] = m.carrier[0] * np.eye(2)

    def rates(t, y):
        x, v = y[:size], y[size : 2 * size]
        turned = phasors * np.exp(1j * x[angles])[:, None]
        spin = (m.polar @ v[angles] + m.drive_inertia * v[end]) / total
        gap = m.clearance + x[tips] - axis @ x[rub]
        opening = v[tips] - axis @ v[rub]
        pressed = np.maximum(-m.penalty * gap - m.penalty_damping * opening, 0.0) * (gap < 0.0)
        mass = inertia.copy()
        mass[angles, :n] = (1j * turned).real
        mass[n, :n] += 0.5 * gyroscopic @ x[:n]
        mass[:n, angles] = mass[angles, :n].T
        f = np.zeros(size)
        stiffness, damping = m.stiffness, m.damping
        if m.bearings is not None:
            k, c = m.bearings(spin)
            stiffness, damping = stiffness + k, damping + c
        f[:n] = -stiffness @ x[:n] - damping @ v[:n] + (v[angles] ** 2) @ turned.real
        f[:n] -= v[n] * gyroscopic @ v[:n]
        if m.load is not None:
            f[:n] += m.load
        f[rub] -= pressed @ (axis + m.friction * along)
        twist, rate = x[angles] - x[end], v[angles] - v[end]
        back = m.torsion @ twist + m.torsion_damping @ rate
        f[angles] = -back
        braking = m.friction * radius * pressed.sum()
        f[n + m.rubbed] -= braking
        given = m.torque(v[end])
        f[end] = given + back.sum()
        held, held_rate = (axis @ x[base], axis @ v[base]) if m.carrier else (0.0, 0.0)
        sprung = tip_spring * (x[tips] - held) + tip_damper * (v[tips] - held_rate)
        f[tips] = pressed - sprung
        if m.carrier:
            bent = lateral_spring * (x[sides] - along @ x[base])
            f[sides] = m.friction * pressed - bent
            f[base] = sprung @ axis + bent @ along
            f[base] -= m.carrier[1] * x[base] + m.carrier[2] * v[base]
        slip = radius * v[n + m.rubbed] + along @ v[rub] - (v[sides] if m.carrier else 0.0)
        lost = m.friction * pressed @ slip
        return np.concatenate([v, np.linalg.solve(mass, f), [lost, given, braking, given * v[end]]])

    y = np.zeros(2 * size + 4)
    stiffness = m.stiffness if m.bearings is None else m.stiffness + m.bearings(start)[0]
    y[:n] = np.linalg.solve(stiffness, np.zeros(n) if m.load is None else m.load)
    twist = -np.linalg.solve(m.torsion, m.polar) * m.torque(start) / total
    y[end] = -m.polar @ twist / total
    y[angles] = y[end] + twist
    y[size + n : size + end + 1] = start

    def mean(state, first):
        return (m.polar @ state[first + n : first + end] + m.drive_inertia * state[first + end]) / total

    def reached(t, state):
        return mean(state, 0) - 2.0 * math.pi * n_revolution - 1e-9

    reached.terminal = True
    part = solve_ivp(
        rates,
        (0.0, 20.0 * math.pi * n_revolution / start),
        y,
        method="DOP853",
        rtol=rtol,
        atol=1e-12,
        events=reached,
        dense_output=True,
        max_step=1e-3,
    )
    wanted = 2.0 * math.pi * np.arange(n_revolution * per_revolution) / per_revolution
    times = np.interp(wanted, mean(part.y, 0), part.t)
    for _ in range(6):
        at = part.sol(times)
        times = times - (mean(at, 0) - wanted) / mean(at, size)
    at = part.sol(times)
    rows = np.array([*at[rub], at[n + m.rubbed] - at[end]])
    return times, mean(at, size), rows, part.y[-4:, -1]
