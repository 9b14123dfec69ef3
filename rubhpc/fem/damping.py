"""Rayleigh damping `D = alpha M + beta K`, from coefficients or from ratios at given frequencies."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from rubhpc.rig.parts import Damping


def rayleigh_coefficients(damping: Damping) -> tuple[float, float]:
    """Coefficients alpha (1/s) and beta (s) of `D = alpha M + beta K`.

    A mode at angular frequency w then has the ratio `alpha / (2 w) + beta w / 2`. One given ratio is met
    by alpha alone, two are met exactly, and more in the least squares. Neither coefficient is let below
    zero, so two ratios that fall faster than 1/frequency are met in the least squares too: a negative
    beta, however small, would make the highest modes of the mesh grow.
    """
    if not damping.ratios:
        return damping.alpha, damping.beta
    from scipy.optimize import nnls  # 0.3 s to load, and few rigs ask for it

    omega = 2 * math.pi * np.array([frequency for frequency, _ in damping.ratios])
    ratio = np.array([ratio for _, ratio in damping.ratios])
    if len(omega) == 1:
        return float(2 * ratio[0] * omega[0]), 0.0
    # beta is sought as beta * scale^2, so that both columns are of one size
    scale = float(np.sqrt(omega.min() * omega.max()))
    columns = np.stack([0.5 / omega, 0.5 * omega / scale**2], axis=1)
    (alpha, beta), _ = nnls(columns, ratio)
    return float(alpha), float(beta / scale**2)
