"""Synchronous full annular rub of a ring of stators in closed form: the limit of many stators.

H. F. Black, Interaction of a whirling rotor with a vibrating stator across a clearance annulus, J. Mech. Eng.
Sci. 10 (1968) 1-12, here for a ring of many independent stators; docs/theory/annular.md.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from rubhpc.errors import InputError
from rubhpc.fem.response import steady_response

if TYPE_CHECKING:
    from rubhpc.fem.model import Model, StatorModel

_LEAST = 1.001  # lowest orbit radius of the search, over the clearance
_MOST = 10.0  # highest, over the radius of the contact-free orbit


@dataclass(frozen=True, kw_only=True)
class AnnularRub:
    """A circular orbit in contact with an arc of the ring; the arc rotates with the orbit.

    Attributes
    ----------
    radius : float
        Radius of the disc's orbit, m.
    phase : float
        Angle of the deflection at shaft angle zero, from straight up in the sense of the spin, rad.
    normal_force : float
        Sum of the normal forces at any instant, N.
    arc : tuple of (rear, front)
        Angles at which contact ends and begins, from the deflection in the sense of the spin, rad.
    """

    radius: float
    phase: float
    normal_force: float
    arc: tuple[float, float]


def annular_rub(model: Model, spin: float, clearance: float, friction: float) -> AnnularRub:
    """Return the synchronous full annular rub of an isotropic rotor in a continuous ring.

    Parameters
    ----------
    model : Model
        With equal stators at one node, evenly spaced all around: a ring made with `count`.
    spin : float
        rad/s.
    clearance : float
        m.
    friction : float
        Coefficient of steadily sliding friction.

    Returns
    -------
    AnnularRub
        The orbit with the smallest radius. It may be unstable.

    Raises
    ------
    InputError
        When the contact-free orbit does not reach the ring, no circular orbit balances the forces, or a
        carrier couples the stators.
    """
    if model.carriers:
        raise InputError(
            "the stators of a full annular rub in closed form stand on the ground; remove the carrier"
        )
    rotor, stator = model.rotor.at(spin), model.stators[0]
    rows = [rotor.index(stator.node, name) for name in ("v", "w")]
    sense = math.copysign(1.0, spin)
    free = steady_response(model, spin)[rows[0]]
    if abs(free) <= clearance:
        problem = (
            f"the contact-free orbit of {abs(free):.4g} m does not reach a clearance of {clearance:.4g} m"
        )
        raise InputError(f"annular rub: {problem}; use a smaller clearance")
    turning = np.zeros(rotor.n_dof, dtype=np.complex128)
    turning[rows] = 1.0, -1j
    dynamic = rotor.dynamic_stiffness(spin, spin)
    lateral = [row for row in range(rotor.n_dof) if rotor.part[row] in rotor.part[rows]]
    receptance = np.linalg.solve(dynamic[np.ix_(lateral, lateral)], turning[lateral])[lateral.index(rows[0])]
    if spin < 0.0:  # mirror image
        free, receptance = free.conjugate(), receptance.conjugate()
    static, moving = (1.0 / _tip_receptance(stator, frequency) for frequency in (0.0, abs(spin)))
    density = len(model.stators) / (2.0 * math.pi)

    def arc(radius: float) -> tuple[float, float]:
        front = math.acos(clearance / radius)
        return float(brentq(lambda psi: normal(radius, psi), -front - 1.0, 0.0)), front

    def normal(radius: float, psi: float) -> float:
        """Normal force of a stator at the angle psi from the line of the deflection, N."""
        pressed = moving.real * math.cos(psi) + moving.imag * math.sin(psi)
        return float(radius * pressed - static.real * clearance)

    def force(radius: float) -> complex:
        """Radial and tangential sum of the normal forces, N."""
        ends = arc(radius)
        radial, tangential = (
            quad(lambda psi, share=share: normal(radius, psi) * share(psi), *ends)[0]
            for share in (math.cos, math.sin)
        )
        return density * complex(radial, tangential)

    def excess(radius: float) -> float:
        return float(abs(radius + receptance * (1.0 + 1j * friction) * force(radius)) - abs(free))

    radii = np.geomspace(_LEAST * clearance, _MOST * abs(free), 400)
    balance = np.array([excess(radius) for radius in radii])
    crossings = np.flatnonzero((balance[:-1] < 0.0) & (balance[1:] >= 0.0))
    if not crossings.size:
        raise InputError("annular rub: no circular orbit balances the forces; use a stiffer ring")
    radius = float(brentq(excess, *radii[crossings[0] : crossings[0] + 2]))
    balanced = radius + receptance * (1.0 + 1j * friction) * force(radius)
    return AnnularRub(
        radius=radius,
        phase=sense * cmath.phase(free / balanced),
        normal_force=density * float(quad(lambda psi: normal(radius, psi), *arc(radius))[0]),
        arc=arc(radius),
    )


def _tip_receptance(stator: StatorModel, frequency: float) -> complex:
    """Return the radial receptance of a stator's tip at a frequency (rad/s), m/N."""
    body = stator.body
    tip = np.arange(body.n_dof) == stator.axial
    return complex(tip @ np.linalg.solve(body.dynamic_stiffness(frequency), tip.astype(np.complex128)))
