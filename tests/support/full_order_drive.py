"""A driven rotor of matrices by Dormand and Prince's method, derived by itself.

The unbalance turns with the disc, whose absolute angle is a coordinate, as is that of the driven end;
Lagrange's equations of

    T = u' M u' / 2 + J a'^2 / 2 + D d'^2 / 2 + a' (Re[i p exp(i a)] u' - u G u' / 2)

are solved for the accelerations. A penalty acts between disc and one stator; friction slides steadily.
"""

import math

import numpy as np
from scipy.integrate import solve_ivp


def driven_motion(
    mass,
    damping,
    stiffness,
    gyroscopic,
    unbalance,
    *,
    drive_inertia,
    torque,
    start,
    n_revolution,
    per_revolution,
    stator=None,
    clearance=1.0,
    friction=0.0,
    penalty=0.0,
    penalty_damping=0.0,
    load=None,
    rtol=1e-9,
):
    """Samples locked to the mean angle: time, speed, and (v, w, twist) by rows; energies at the end.

    The matrices are of rows v, w, thy, thz, thx, the twist last; `unbalance` is a complex kg m.
    """
    n = 4
    lateral = np.ix_(range(n), range(n))
    disc, spring, drag = mass[4, 4], stiffness[4, 4], damping[4, 4]
    pull = np.zeros(n) if load is None else load[:n]
    tip_mass = 1.0 if stator is None else stator.mass
    total = disc + drive_inertia
    phasor = np.zeros(n, complex)
    phasor[:2] = unbalance * np.array([1.0, -1j])

    def contact(q, rate):
        if stator is None:
            return 0.0
        gap = clearance + q[6] - q[0]
        opening = rate[6] - rate[0]
        if gap >= 0.0:
            return 0.0
        return max(-penalty * gap - penalty_damping * opening, 0.0)

    def rates(t, y):
        q, rate = y[:7], y[7:14]
        u, moved, angle, spin = q[:n], rate[:n], q[4], rate[4]
        turned = phasor * np.exp(1j * angle)
        carried = (1j * turned).real + 0.5 * gyroscopic[lateral] @ u
        force = contact(q, rate)
        inertia = np.zeros((7, 7))
        inertia[lateral] = mass[lateral]
        inertia[4, 4], inertia[5, 5], inertia[6, 6] = disc, drive_inertia, tip_mass
        inertia[:n, 4] = inertia[4, :n] = carried
        twisting = spring * (q[4] - q[5]) + drag * (rate[4] - rate[5])
        f = np.zeros(7)
        f[:n] = -damping[lateral] @ moved - stiffness[lateral] @ u + pull
        f[:n] += spin**2 * turned.real - spin * gyroscopic[lateral] @ moved
        f[0] -= force
        f[1] -= friction * force
        radius = 0.0 if stator is None else stator.radius
        f[4] = -twisting - friction * force * radius
        f[5] = torque(rate[5]) + twisting
        if stator is not None:
            f[6] = force - stator.stiffness * q[6] - stator.damping * rate[6]
        slip = radius * spin + rate[1]
        lost = moved @ damping[lateral] @ moved + drag * (rate[4] - rate[5]) ** 2
        lost += friction * force * slip
        return np.concatenate([rate, np.linalg.solve(inertia, f), [torque(rate[5]) * rate[5], lost]])

    def reached(t, y):
        return (disc * y[4] + drive_inertia * y[5]) / total - 2.0 * math.pi * n_revolution - 1e-9

    reached.terminal = True
    y = np.zeros(16)
    y[:n] = np.linalg.solve(stiffness[lateral], pull)
    y[11], y[12] = start, start
    twist = -torque(start) * disc / total / spring
    y[4], y[5] = twist * drive_inertia / total, -twist * disc / total
    longest = 20.0 * math.pi * n_revolution / start
    part = solve_ivp(
        rates, (0.0, longest), y, method="DOP853", rtol=rtol, atol=1e-13, events=reached, dense_output=True
    )
    wanted = 2.0 * math.pi * np.arange(n_revolution * per_revolution) / per_revolution
    mean = (disc * part.y[4] + drive_inertia * part.y[5]) / total
    times = np.interp(wanted, mean, part.t)
    for _ in range(6):
        at = part.sol(times)
        angle = (disc * at[4] + drive_inertia * at[5]) / total
        times = times - (angle - wanted) / ((disc * at[11] + drive_inertia * at[12]) / total)
    at = part.sol(times)
    speed = (disc * at[11] + drive_inertia * at[12]) / total
    return times, speed, np.array([at[0], at[1], at[4] - at[5]]), part.y[14:, -1]
