"""A rotor whose driven end is free to turn: the spin is a degree of freedom, the twist relative to that end.

The spin angle is that of the mean of rotor and drive, weighted by their inertia: it feels torques from
outside alone. About it, the driven end turns back by the mean of the twist.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Body, Model

    Floats = NDArray[np.float64]

LEAST_DRIVE = 1e-3  # inertia of a drive of which none is given, over that of the rotor


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeSpin:
    """What turns with the spin.

    Attributes
    ----------
    inertia : float, kg m^2
        Polar inertia of rotor and drive.
    share : (n_rotor_dof,)
        Twist about the driven end that lets this end turn back by 1 rad about the mean: `m / J`.
    """

    inertia: float
    share: Floats


def release(model: Model, drive_inertia: float | None) -> tuple[Model, FreeSpin]:
    """Return a model whose driven end turns as torques have it, and what turns with the spin.

    With the inertia J of rotor and drive and `m = M 1`, 1 being a unit rotation of all nodes, the kinetic
    energy of the twist u about the driven end is `u'(M - m m^T / J)u' / 2`, besides `J W^2 / 2` of the mean
    spin W. Stiffness and damping, which work between nodes and driven end, stay as they are.

    Parameters
    ----------
    drive_inertia : float or None, kg m^2
        Polar inertia of drive and coupling; None takes a thousandth of the rotor's.

    Raises
    ------
    InputError
        Nothing has a polar inertia.
    """
    rotor = model.rotor
    turning = unit_rotation(rotor)
    moment = rotor.mass @ turning
    own = float(turning @ moment)
    if drive_inertia is None:
        drive_inertia = LEAST_DRIVE * own
    inertia = own + drive_inertia
    if not inertia > 0.0:
        problem = "missing; this rotor has no degree thx, so that only the drive's inertia turns"
        raise InputError(f'[drive] inertia: {problem}; give one, such as "0.01 kg m^2"')
    mass = rotor.mass - np.outer(moment, moment) / inertia
    return replace(model, rotor=replace(rotor, mass=mass)), FreeSpin(inertia=inertia, share=moment / inertia)


def unit_rotation(rotor: Body) -> Floats:
    """All nodes turned by 1 rad about the shaft, (n_dof,)."""
    return np.array([float(name == "thx") for _, name in rotor.degrees])
