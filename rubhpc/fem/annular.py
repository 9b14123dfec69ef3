"""Synchronous full annular rub of a ring of stators in closed form: what dense rings come to.

H. F. Black, Interaction of a whirling rotor with a vibrating stator across a clearance annulus, J. Mech. Eng.
Sci. 10 (1968) 1-12, for a ring of many stators, each on its own; docs/theory/annular.md.
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

_LEAST = 1.001  # orbit radius over the clearance from which an arc of contact is looked for
_MOST = 10.0  # orbit radius over that of the contact-free response up to which it is looked for


@dataclass(frozen=True, kw_only=True)
class AnnularRub:
    """A circular orbit that presses an arc of the ring which goes round with it.

    Attributes
    ----------
    radius : float
        Of the orbit of the disc, m.
    phase : float
        Of the orbit, from straight up with the spin, when the shaft's angle is zero, rad.
    normal_force : float
        Sum of the normal forces at any instant, N.
    arc : tuple of (rear, front)
        Where contact ends and begins, from the line of the deflection in the sense of the spin, rad.
    """

    radius: float
    phase: float
    normal_force: float
    arc: tuple[float, float]


def annular_rub(model: Model, spin: float, clearance: float, friction: float) -> AnnularRub:
    """Solve the synchronous full annular rub of an isotropic rotor in a ring without gaps.

    Parameters
    ----------
    model : Model
        Its stators are equal, stand at one node and all around: `count` of them in a rig.
    spin : float
        rad/s.
    clearance : float
        m.
    friction : float
        Coefficient; friction slides steadily.

    Returns
    -------
    AnnularRub
        The orbit with the least radius. Whether it is stable is another question.

    Raises
    ------
    InputError
        When the contact-free orbit does not reach the ring, or no circular orbit balances the forces.
    """
    rotor, stator = model.rotor.at(spin), model.stators[0]
    rows = [rotor.index(stator.node, name) for name in ("v", "w")]
    sense = math.copysign(1.0, spin)
    free = steady_response(model, spin)[rows[0]]
    if abs(free) <= clearance:
        problem = (
            f"the contact-free orbit of {abs(free):.4g} m does not reach a clearance of {clearance:.4g} m"
        )
        raise InputError(f"annular rub: {problem}; take a smaller one")
    turning = np.zeros(rotor.n_dof, dtype=np.complex128)
    turning[rows] = 1.0, -1j
    dynamic = rotor.stiffness - spin**2 * rotor.mass + 1j * spin * (rotor.damping + spin * rotor.gyroscopic)
    lateral = [row for row in range(rotor.n_dof) if rotor.part[row] in rotor.part[rows]]
    receptance = np.linalg.solve(dynamic[np.ix_(lateral, lateral)], turning[lateral])[lateral.index(rows[0])]
    if spin < 0.0:  # seen in a mirror
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
        raise InputError("annular rub: no circular orbit balances the forces; the ring is left or too soft")
    radius = float(brentq(excess, *radii[crossings[0] : crossings[0] + 2]))
    balanced = radius + receptance * (1.0 + 1j * friction) * force(radius)
    return AnnularRub(
        radius=radius,
        phase=sense * cmath.phase(free / balanced),
        normal_force=density * float(quad(lambda psi: normal(radius, psi), *arc(radius))[0]),
        arc=arc(radius),
    )


def _tip_receptance(stator: StatorModel, frequency: float) -> complex:
    """Radial displacement of a stator's tip for a unit force there at a frequency (rad/s), m/N."""
    body = stator.body
    tip = np.arange(body.n_dof) == stator.axial
    dynamic = body.stiffness - frequency**2 * body.mass + 1j * frequency * body.damping
    return complex(tip @ np.linalg.solve(dynamic, tip.astype(np.complex128)))
