"""A record as a march makes it, or as several do one after another."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from rubhpc.integrate.measuring.samples import empty_samples, new_accumulator
from rubhpc.kernels.accumulators import EXTREMA, SUMMED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.integrate.marches.march import March
    from rubhpc.integrate.record import State
    from rubhpc.integrate.setup import Setup
    from rubhpc.kernels.accumulators import Accumulator, Samples


class Marched(NamedTuple):
    """A marched record."""

    samples: Samples
    accumulator: Accumulator
    energy: tuple[float, float]  # J, where it begins and where it ends
    final: State
    reason: str | None = None  # why the case could not go on


def march_record(
    march: March, setup: Setup, n_revolution: int, accumulator: Accumulator | None = None
) -> Marched:
    """Record so many revolutions from where a march stands; a given accumulator follows another record."""
    model, n_sample = setup.model, n_revolution * setup.samples_per_revolution
    samples = empty_samples(march.n_place, n_sample, model.n_probe, model.n_push)
    sums = accumulator or new_accumulator(len(model.stators), march.n_place)
    before = march.energy()
    sums.is_touching[:] = march.touching()  # a contact under way did not begin in the record
    reason = march.advance(0, n_sample, samples, sums, is_recorded=True)
    final = march.final()
    return Marched(samples, sums, (before, march.energy() if reason is None else before), final, reason)


def joined_sums(parts: Sequence[Accumulator]) -> Accumulator:
    """Return sums and extrema of the parts of a record, in place of those of the last one."""
    sums = parts[-1]
    for part in parts[:-1]:
        for name in SUMMED:
            getattr(sums, name)[:] += getattr(part, name)
        for name, extreme in EXTREMA.items():
            total = getattr(sums, name)
            extreme(total, getattr(part, name), out=total)
    return sums
