"""How much of a motion lies in the modes that a reduced model leaves out: an estimate for its rig."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.packing import degrees_of, output_degrees, whole_system
from rubhpc.integrate.standstill import at_standstill, cutoff_frequency, parted

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model

    Floats = NDArray[np.float64]

MARGIN = 4.0  # without it, estimates were up to four times too small where masses do not rebound


def modal_error(model: Model, spin: float, accuracy: float) -> float:
    """Estimate the largest error of a signal or a force, as a share of it, by the modes left out.

    A contact force is taken for a pulse at the contact frequency `w_c` (`standstill.Standstill`), with the
    spectrum `G(w) = min(1, (w_c / w)^2 + s)`, s being the share of the closing momentum that the tip's own
    mass gives up at once. A mode of frequency w whose place of contact moves by b, and whose place of a
    signal by a, rings with the displacement `a b G(w) / w` there, and opens and closes the gap with the
    velocity `b^2 G(w)`. Its ring counts as long as it lasts, over half a period of `w_c` at most: what is
    damped at once is followed by the static shapes that stand for it. The error is the root of the sum of
    squares over the modes left out, over that of all modes, times a margin.

    Parameters
    ----------
    spin : float, rad/s
    accuracy : float
        That of the reduction (`reduction.reduce_model`).

    Returns
    -------
    float
        0 where all modes are kept.
    """
    standstill = at_standstill(model)
    cutoff = cutoff_frequency(model, spin, accuracy)
    is_out = np.concatenate(
        [
            np.arange(part.frequency.size) >= parted(part, cutoff).low_frequency.size
            for part in standstill.parts
        ]
    )
    if not is_out.any():
        return 0.0
    frequency = np.concatenate([part.frequency for part in standstill.parts])
    mode = np.hstack([part.mode for part in standstill.parts])
    drag = whole_system(model, spin)[1]
    decay = np.maximum(0.5 * ((drag @ mode) * mode).sum(axis=0), 0.0)  # 1/s, of each mode
    weight = is_out / (1.0 + np.pi * decay / standstill.contact_frequency)

    def share(rung: Floats) -> float:
        whole = np.linalg.norm(rung)
        return float(np.linalg.norm(weight * rung) / whole) if whole > 0.0 else 0.0

    worst = 0.0
    signals = output_degrees(model)
    for stator, degree in zip(model.stators, degrees_of(model), strict=True):
        v, w, _, axial, lateral = (mode[row] if row >= 0 else np.zeros(frequency.size) for row in degree)
        across = np.cos(stator.angle) * v + np.sin(stator.angle) * w
        pulse = np.minimum(
            1.0, (standstill.contact_frequency / frequency) ** 2 + impact_share(across, axial, frequency)
        )
        worst = max(worst, share((across**2 + axial**2) * pulse))
        for row in degree[degree >= 0]:
            for at in (*(mode[signal] for signal in signals if signal >= 0), axial, lateral):
                worst = max(worst, share(mode[row] * at * pulse / frequency))
    return MARGIN * worst


def impact_share(across: Floats, axial: Floats, frequency: Floats) -> float:
    """Share of the closing momentum that the tip's own mass gives up at once, by its modes (n,)."""
    response = across / frequency**2  # of the rotor, whose static shape is that of a slow contact
    if not np.any(response):
        return 1.0
    inertia = (response @ response) / (across @ response) ** 2
    return float(1.0 / (1.0 + inertia * (axial @ axial)))


def sufficient_accuracy(model: Model, spin: float, accuracy: float) -> float:
    """Accuracy to ask for, a power of ten below this one, so that the estimate is within this one."""
    asked = accuracy
    while modal_error(model, spin, asked) > accuracy:
        asked *= 0.1
    return asked
