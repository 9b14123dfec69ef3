"""Measures of displacements and forces by which `rubhpc.validity` judges the model, but the slip speed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.kernels.accumulators import HORIZONTAL, VERTICAL

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model, StatorModel
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


def monitored(samples: Samples, accumulator: Accumulator, model: Model, *, is_round: bool) -> dict[str, Any]:
    """These measures of a record, from its samples about the shaft without loads, and its extrema.

    `is_round`: the gap includes the roundness of the rim (updated normal).
    """
    stators, force = model.stators, accumulator.peak_force
    deflection = tip_deflection(samples, accumulator, model)
    return {
        "force_over_euler_load": force / [stator.euler_load for stator in stators],
        "tip_deflection_ratio": deflection / [stator.length for stator in stators],
        "foreshortening_ratio": foreshortening_ratio(stators, deflection, force, is_round=is_round),
        "normal_angle": np.zeros(len(stators)) if is_round else normal_angle(samples, model),
        "force_over_strength": force / [stator.strength for stator in stators],
        "bearing_clearance_ratio": bearing_clearance_ratio(samples, model),
    }


def foreshortening_ratio(
    stators: tuple[StatorModel, ...], deflection: Floats, force: Floats, *, is_round: bool
) -> Floats:
    """Return the change of the gap by bending that the model omits, over the tip's compression, (q,).

    A tip at a lateral `deflection` l (q,), m, draws back by 0.6 l^2 / L, and the rim, r away from its centre,
    by l^2 / (2 r). A body without a length or a rim has neither. The compression is the static one under the
    `force` (q,), N; without it the ratio is 0.
    """
    ratio = np.zeros(len(stators))
    for i, stator in enumerate(stators):
        drawn = 0.6 / stator.length if stator.squared_slope is None else 0.0
        away = 0.0 if is_round or stator.radius == 0.0 else 0.5 / stator.radius
        compression = force[i] * stator.axial_compliance if force[i] > 0.0 else 0.0
        if compression > 0.0:
            ratio[i] = (drawn + away) * deflection[i] ** 2 / compression
    return ratio


def normal_angle(samples: Samples, model: Model) -> Floats:
    """Largest angle from the fixed normal to the line of centres, (q,), rad, at the samples in contact.

    With the tip at `l` along the rim and the disc's centre at (v, w), the tip is `l + v sin a - w cos a`
    beside the centre and, in contact, the radius r away from it along the stator's axis, at the angle a.
    """
    angle = np.zeros(len(model.stators))
    for i, stator in enumerate(model.stators):
        touches = samples.force[i] > 0.0
        if stator.radius > 0.0 and touches.any():
            v, w = _motion_of(stator.node, samples, model)
            aside = samples.lateral[i] + np.sin(stator.angle) * v - np.cos(stator.angle) * w
            angle[i] = np.arctan(np.abs(aside[touches]).max() / stator.radius)
    return angle


def bearing_clearance_ratio(samples: Samples, model: Model) -> float:
    """Largest displacement in a bearing at a sample over its clearance; 0 where no clearance is given."""
    if model.probe is None or not model.probe.clearances:
        return 0.0
    first = len(model.probe.probes) + 2 * len(model.probe.nodes)
    motion = samples.probe[first:].reshape(len(model.probe.clearances), 2, -1)
    return float((np.hypot(motion[:, 0], motion[:, 1]).max(axis=1) / model.probe.clearances).max())


def _motion_of(node: int, samples: Samples, model: Model) -> Floats:
    """Vertical and horizontal displacement (2, n_sample) of a node that a stator faces, m."""
    if node == model.output_node:
        return samples.rotor[[VERTICAL, HORIZONTAL]]
    assert model.probe is not None  # a model that is simulated watches all other nodes
    first = len(model.probe.probes) + 2 * model.probe.nodes.index(node)
    return samples.probe[first : first + 2]
