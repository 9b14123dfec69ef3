"""The record of a motion that repeats itself, from the parts of one period."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.integrate.measuring.samples import empty_samples

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.fem.model import Model
    from rubhpc.kernels.accumulators import Accumulator, Samples

_SUMMED = ("n_contact", "contact_time", "impulse", "stick_time", "friction_work", "energy", "reversals")
_LARGEST = ("highest", "peak_force", "peak_lateral", "pivots", "residual")
_EXTREMA = dict.fromkeys(_LARGEST, np.maximum) | dict.fromkeys(("lowest", "least_slip"), np.minimum)


class Part(NamedTuple):
    """A part of a period: its record, and how often it occurs."""

    samples: Samples
    accumulator: Accumulator  # begun with the sense of the part before
    times: int


def repeated_samples(parts: Sequence[Part], n_sample: int, model: Model) -> Samples:
    """Return the samples of a period over and over, up to `n_sample`."""
    period = np.concatenate([part.samples.whole for part in parts], axis=1)
    samples = empty_samples(model.n_place, n_sample, model.n_probe)
    for first in range(0, n_sample, period.shape[1]):
        room = samples.whole[:, first : first + period.shape[1]]
        room[:] = period[:, : room.shape[1]]
    return samples


def repeated_sums(parts: Sequence[Part]) -> Accumulator:
    """Return sums and extrema of all periods, in place of those of the last part.

    The first part of a period may occur once more than the others. A pair that slides in another sense where
    a period begins than where it ends reverses once more in each period than in the first one.
    """
    first, last, sums = parts[0], parts[-1], parts[-1].accumulator
    is_odd = sum(part.accumulator.reversals for part in parts) % 2
    returns = last.times - 1 + (first.accumulator.sense != 0) * (first.times - last.times)
    for name in _SUMMED:
        getattr(sums, name)[:] *= last.times
    for part in parts[:-1]:
        for name in _SUMMED:
            getattr(sums, name)[:] += part.times * getattr(part.accumulator, name)
        for name, extreme in _EXTREMA.items():
            total = getattr(sums, name)
            extreme(total, getattr(part.accumulator, name), out=total)
    sums.reversals[:] += is_odd * returns
    return sums
