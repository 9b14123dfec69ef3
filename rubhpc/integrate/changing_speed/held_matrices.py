"""Over which speeds the matrices of a run-up may keep their values."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

WIDEST, NARROWEST = 0.16, 0.00125  # half of the range over the speed
RESPONSE = 3e-3  # relative error of the response to unbalance by a mode whose exponent is held
RINGING = 2e-3  # relative error of an exponent


def held_range(
    stiffness: Floats, damping: Floats, drift: tuple[Floats, Floats], speed: float, acceleration: float
) -> float:
    """Half of the range of speeds over which matrices may be held, rad/s.

    Held at their values in the middle of it, they shift the exponent l of a mode by `l' h` at its ends, with
    `l' = w A' v` by the left and right eigenvectors of the system A. The response to the unbalance, `exp(i
    W t)`, errs by that over `|i W - l|`; in a passage that takes the time `h / a` for half of the range, not
    by more than that over `a / h`. Motions that ring by themselves err in their frequency by `l' h / l`.

    Parameters
    ----------
    stiffness, damping : (n, n)
        At the speed, the mass being the identity.
    drift : two of (n, n)
        Change of stiffness and damping with the speed, per rad/s.
    speed, acceleration : float, rad/s, rad/s^2
    """
    n = len(stiffness)
    system = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])
    exponent, shape = np.linalg.eig(system)
    change = np.vstack([np.zeros((n, 2 * n)), -np.hstack(drift)])
    shift = np.abs(np.einsum("ka,ab,bk->k", np.linalg.inv(shape), change, shape, optimize=True))
    half = WIDEST * speed
    while half > NARROWEST * speed:
        excited = np.clip(np.abs(exponent.imag), speed - half, speed + half)
        distance = np.hypot(exponent.real, np.abs(exponent.imag) - excited)
        distance = np.maximum(distance, abs(acceleration) / half)
        allowed = np.minimum(RESPONSE * distance, RINGING * np.abs(exponent))
        if np.all(shift * half <= allowed):
            break
        half *= 0.5
    return half
