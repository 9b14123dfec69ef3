"""Displacement of stators on a carrier: with the carrier, and relative to it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.kernels.accumulators import Accumulator, Samples

    Floats = NDArray[np.float64]


def carrier_displacement(samples: Samples, model: Model) -> Floats:
    """Largest displacement at a sample, m, of what each stator stands on: a carrier, or the ground (0)."""
    peak, q = np.zeros(len(model.stators)), len(model.stators)
    for i, carrier in enumerate(model.carriers, start=q):
        peak[np.array(carrier.stators) - 1] = np.hypot(samples.axial[i], samples.lateral[i]).max()
    return peak


def tip_deflection(samples: Samples, accumulator: Accumulator, model: Model) -> Floats:
    """Largest lateral deflection of each tip, (n_stator,), m.

    On the ground it is that of the motion between samples too. On a carrier it is the largest at a sample,
    against where the carrier takes the tip: `-v sin a + w cos a + r thx` at the angle a and contact radius r.
    """
    q = len(model.stators)
    peak, n_turning = accumulator.peak_lateral[:q].copy(), q + len(model.carriers)
    for i, carrier in enumerate(model.carriers, start=q):
        turn = np.zeros_like(samples.lateral[i])
        if carrier in model.turning_carriers:
            turn = samples.lateral[n_turning]
            n_turning += 1
        for k in np.array(carrier.stators) - 1:
            stator = model.stators[k]
            c, s = np.cos(stator.angle), np.sin(stator.angle)
            taken = c * samples.lateral[i] - s * samples.axial[i] + stator.radius * turn
            peak[k] = np.abs(samples.lateral[k] - taken).max()
    return peak
