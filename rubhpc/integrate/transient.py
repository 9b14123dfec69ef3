"""The transient: a fixed number of revolutions, or until the motion has settled."""

from __future__ import annotations

from itertools import chain, cycle
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.measuring.samples import empty_samples, new_accumulator, no_record
from rubhpc.kernels.accumulators import HORIZONTAL, TWIST, VERTICAL

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.marches.march import March
    from rubhpc.kernels.accumulators import Accumulator, Samples
    from rubhpc.study.tables import Recording

    Floats = NDArray[np.float64]

# Revolutions between compared cycles: one is compared with those 8 and 12 later, which finds motions of
# period 1, 2, 3, 4, 6, 8 and 12. The last cycle is the first of the next three.
PAUSES = (7, 3)
DECAYED = 0.01  # of the largest past value of a signal: reference for smaller ones


def pass_transient(march: March, recording: Recording) -> tuple[str | None, int]:
    """March through the transient, until the motion has settled where `recording` says "auto".

    It has settled when no displacement of output node, tips or carriers, no twist, rate of the twist or probe
    differs from that 8 or 12 revolutions before by more than `settled_within` of the signal's largest value
    in the cycle, or of a hundredth of its largest past value, so that a decaying signal settles too. The
    transient ends after `longest_transient` revolutions at the latest.

    Returns
    -------
    str or None
        Reason why the case cannot continue.
    int
        Revolutions marched.
    """
    if not recording.is_transient_auto:
        return pass_revolutions(march, recording, recording.longest_transient), recording.longest_transient

    n_place, done, limit = march.n_place, 0, recording.longest_transient
    tips = 4 + np.arange(march.n_body)  # rotations of carriers are visible in the tips that they move
    samples, accumulator = (
        empty_samples(n_place, recording.samples_per_revolution, march.n_probe),
        new_accumulator(march.touching().size, n_place),
    )
    idle = idle_of(march)
    reference: Floats | None = None
    largest: Floats | None = None
    for i, pause in enumerate(chain([0], cycle(PAUSES))):
        if done + pause + 1 > limit:
            return pass_revolutions(march, recording, limit - done, idle), limit
        reason = pass_revolutions(march, recording, pause, idle)
        done += pause
        if reason is None:
            reason = march.advance(
                0, recording.samples_per_revolution, samples, accumulator, is_recorded=True
            )
        if reason is not None:
            return reason, done
        done += 1
        moved = samples.whole[[VERTICAL, HORIZONTAL, TWIST, *tips, *tips + n_place]]
        rate = np.gradient(samples.rotor[TWIST])
        latest = np.concatenate([moved, rate[np.newaxis], samples.probe])
        reached = np.abs(latest).max(axis=1)
        largest = reached if largest is None else np.maximum(largest, reached)
        if reference is not None and has_settled(
            latest, reference, recording.settled_within, DECAYED * largest
        ):
            return None, done
        if i % len(PAUSES) == 0:
            reference = latest
    raise AssertionError  # the pauses never end


def has_settled(cycle: Floats, earlier: Floats, tolerance: float, least: Floats | float = 0.0) -> bool:
    """Whether two cycles (signals, samples) agree within a share of each signal's largest value.

    For smaller signals the reference is `least`, (signals,).
    """
    change, size = np.abs(cycle - earlier).max(axis=1), np.abs(cycle).max(axis=1)
    return bool(np.all(change <= tolerance * np.maximum(size, least)))


def pass_revolutions(
    march: March, recording: Recording, n_revolution: int, idle: tuple[Samples, Accumulator] | None = None
) -> str | None:
    """March some revolutions without a record; returns why the case cannot continue.

    `idle` is the unused record that a march requires (`idle_of`).
    """
    samples, accumulator = idle or idle_of(march)
    first = -n_revolution * recording.samples_per_revolution
    return march.advance(first, 0, samples, accumulator, is_recorded=False)


def idle_of(march: March) -> tuple[Samples, Accumulator]:
    """Empty samples and an accumulator, which `pass_revolutions` does not change."""
    return no_record(march.n_place, march.touching().size)
