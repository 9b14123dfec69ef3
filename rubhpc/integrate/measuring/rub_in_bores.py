"""How rotors rub in bores: contact forces as vectors, where they act, and the whirl of the contact point."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.schema import RUB_KIND

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.kernels.accumulators import Accumulator

    Floats = NDArray[np.float64]

NORMAL_UP, NORMAL_ASIDE, UP, ASIDE = range(4)  # rows of `Samples.push`, forces on the stator
LASTING = 0.999  # share of the time in contact above which a rub is no partial one
EVERYWHERE = 2.0  # of the largest turn between samples: gaps between angles that the contact passes over


def bore_signals(push: Floats) -> dict[str, Floats]:
    """Waveforms (q, n) by their names in the schema, of `Samples.push` (q, 4, n); none without bores."""
    if not len(push):
        return {}
    touches = np.any(push[:, :UP] != 0.0, axis=1)
    angle = np.arctan2(push[:, NORMAL_ASIDE], push[:, NORMAL_UP])
    return {
        "contact_angle": np.where(touches, angle, np.nan),
        "contact_force_vertical": -push[:, UP],
        "contact_force_horizontal": -push[:, ASIDE],
    }


def rub_measures(push: Floats, accumulator: Accumulator, duration: float, model: Model) -> dict[str, Any]:
    """Measures of the rub in each bore by a record of a duration, s; NaN, or -1, of other stators."""
    q = len(model.stators)
    kind = np.full(q, -1)
    whirl, mean, spread, arc = np.full((4, q), np.nan)
    for i, stator in enumerate(model.stators):
        if not stator.is_bore:
            continue
        kind[i], time = RUB_KIND.index("none"), accumulator.contact_time[i]
        if not accumulator.impulse[i] > 0.0:
            continue
        whirl[i] = accumulator.turned[i] / time if time > 0.0 else np.nan
        force = push[i, NORMAL_UP] + 1j * push[i, NORMAL_ASIDE]
        resultant = abs(force.sum()) / np.abs(force).sum()
        mean[i], spread[i] = np.angle(force.sum()), np.sqrt(max(0.0, 2.0 - 2.0 * resultant))
        arc[i] = arc_of(np.angle(force[force != 0.0]))
        goes_around = arc[i] == 2.0 * np.pi and time >= LASTING * duration
        name = "forward" if whirl[i] > 0.0 else "backward_slipping"
        if accumulator.stick_time[i] > 0.5 * time:
            name = "rolling"
        kind[i] = RUB_KIND.index(name if goes_around else "partial")
    return {
        "rub_kind": kind,
        "whirl_frequency": whirl,
        "contact_angle_mean": mean,
        "contact_angle_spread": spread,
        "contact_arc": arc,
    }


def arc_of(angle: Floats) -> float:
    """Arc, rad, of the angles (n,) of a contact at successive samples; all of it where no gap is left."""
    turn = 2.0 * np.pi
    step = np.abs((np.diff(angle) + np.pi) % turn - np.pi).max(initial=0.0)
    ordered = np.sort(angle)
    gap = np.diff(ordered, append=ordered[0] + turn).max()
    return float(turn if gap <= EVERYWHERE * step else turn - gap)
