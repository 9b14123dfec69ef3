"""Ranges of speed and acceleration over which the matrices of a run-up may keep their values."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

WIDEST, NARROWEST = 0.5, 1e-4  # half of the range over the speed
WIDEST_TABULATED = 0.16  # the same where bearings follow a table, not a straight line
AT_ENDS = 2.0  # error at the ends of a range over its mean: it is linear from the middle
ACCELERATION_SHARE = 0.05  # of these errors, by the acceleration, which may change suddenly


def held_range(
    stiffness: Floats,
    damping: Floats,
    drift: tuple[Floats, Floats],
    speed: float,
    acceleration: float,
    *,
    accuracy: float,
    momentum: Floats | None = None,
    widest: float = WIDEST,
) -> tuple[float, float]:
    """Half of the ranges of speeds, rad/s, and of accelerations, rad/s^2, over which matrices may be held.

    Held at their values in the middle of it, they shift the exponent l of a mode by `l' h` at its ends, with
    `l' = w A' v` by the left and right eigenvectors of the system A. The response to the unbalance,
    `exp(i W t)`, errs by that over `|i W - l|`; in a passage that takes the time `h / a` for half of the
    range, not by more than that over `a / h`. Motions that ring by themselves err in their frequency by
    `l' h / l`.

    Parameters
    ----------
    stiffness, damping : (n, n)
        At the speed, the mass being the identity.
    drift : two of (n, n)
        Change of stiffness and damping with the speed, per rad/s.
    speed, acceleration : float, rad/s, rad/s^2
    accuracy : float
        Relative error of the response to unbalance by a mode, and of each exponent, in the mean over a range.
    momentum : (n, n), optional
        Change of the stiffness with the acceleration, per rad/s^2.
    widest : float
        Half of the widest range over the speed.
    """
    n = len(stiffness)
    system = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])
    exponent, shape = np.linalg.eig(system)
    against = np.linalg.inv(shape)[:, n:]
    shift = np.abs(np.einsum("ka,ab,bk->k", against, np.hstack(drift), shape, optimize=True))
    half = widest * speed
    while True:
        excited = np.clip(np.abs(exponent.imag), speed - half, speed + half)
        distance = np.hypot(exponent.real, np.abs(exponent.imag) - excited)
        distance = np.maximum(distance, abs(acceleration) / half)
        allowed = AT_ENDS * accuracy * np.minimum(distance, np.abs(exponent))
        if half <= NARROWEST * speed or np.all(shift * half <= allowed):
            break
        half *= 0.75
    if momentum is None:
        return half, math.inf
    turned = np.abs(np.einsum("ka,ab,bk->k", against, momentum, shape[:n], optimize=True))
    reached = np.divide(allowed, turned, out=np.full(allowed.shape, math.inf), where=turned > 0.0)
    return half, ACCELERATION_SHARE * float(reached.min())
