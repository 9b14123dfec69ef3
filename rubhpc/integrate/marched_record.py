"""A record as a march makes it, and that of a periodic motion: one period is marched and repeated."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.integrate.measuring.samples import empty_samples, following_accumulator, new_accumulator
from rubhpc.integrate.periodic_motions.approach import nothing
from rubhpc.kernels.force_average import AVERAGING_TIME, COUNT, END, OLDEST

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.marches.event_driven import EventDrivenMarch
    from rubhpc.integrate.marches.march import March
    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.record import State
    from rubhpc.integrate.setup import Setup
    from rubhpc.kernels.accumulators import Accumulator, Samples

    Floats = NDArray[np.float64]


_SUMMED = (
    *("n_contact", "contact_time", "impulse", "stick_time", "friction_work", "energy", "reversals"),
    "turned",
)
_LARGEST = ("highest", "peak_force", "peak_lateral", "pivots", "residual")
_EXTREMA = dict.fromkeys(_LARGEST, np.maximum) | dict.fromkeys(("lowest", "least_slip"), np.minimum)


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


class Part(NamedTuple):
    """A part of a period: its record, and how often it occurs."""

    samples: Samples
    accumulator: Accumulator  # begun with the sense of the part before
    times: int


def repeated_samples(parts: Sequence[Part], n_sample: int, model: Model) -> Samples:
    """Return the samples of a period over and over, up to `n_sample`."""
    period = np.concatenate([part.samples.whole for part in parts], axis=1)
    samples = empty_samples(model.n_place, n_sample, model.n_probe, model.n_push)
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


def repeat_period(march: EventDrivenMarch, period: int, n_revolution: int) -> tuple[Marched | None, int]:
    """Record a periodic motion from where a march stands on it.

    A record that holds no whole number of periods ends within one: that part is marched first, and then the
    rest of the period. A record shorter than a period is marched as it is.

    Returns
    -------
    Marched or None
        None where the period does not close as nearly as events are resolved: the march is back where it was.
    int
        Steps of the march before it was begun anew.
    """
    begun = march.reached()
    marched = _repeated(march, march.setup, period, n_revolution)
    if marched is not None:
        return marched, 0
    n_step = march.n_step
    march.begin(march.setup, begun)
    return None, n_step


def _repeated(march: EventDrivenMarch, setup: ModalSetup, period: int, n_revolution: int) -> Marched | None:
    n_whole, n_over = divmod(n_revolution, period)
    begun, turn = march.motion(), setup.interval * setup.samples_per_revolution
    first = last = march_record(march, setup, n_over or period)
    marched = [(first, n_whole + bool(n_over))]
    if n_whole > 0 and n_over > 0 and first.reason is None:
        follows = following_accumulator(first.accumulator, n_over * turn)
        follows.sense[:] = first.accumulator.sense
        last = march_record(march, setup, period - n_over, follows)
        marched.append((last, n_whole))
    if last.reason is not None or (n_whole > 0 and not _closes(setup, begun, march.stands_at())):
        return None
    parts = [Part(one.samples, one.accumulator, times) for one, times in marched]
    if n_revolution > period:
        _note_peak_at_return(march, setup, last.accumulator, (period - n_over) * turn)
    sums = repeated_sums(parts)
    gained = sum(times * (one.energy[1] - one.energy[0]) for one, times in marched)
    return Marched(
        samples=repeated_samples(parts, n_revolution * setup.samples_per_revolution, setup.model),
        accumulator=sums,
        energy=(first.energy[0], first.energy[0] + gained),
        final=first.final,
    )


def _closes(setup: ModalSetup, begun: Floats, ended: Floats) -> bool:
    """Whether a motion (2 n,) has returned, as nearly as events are resolved."""
    scale = np.array([[setup.spin], [1.0]])
    apart, size = ((scale * motion.reshape(2, -1)).ravel() for motion in (ended - begun, begun))
    return bool(apart @ apart <= nothing(setup) ** 2 * (size @ size))


def _note_peak_at_return(
    march: EventDrivenMarch, setup: ModalSetup, ended: Accumulator, passed: float
) -> None:
    """Add the largest mean force over times of which a part lies before the end of a period.

    `passed` (s) is the time that the accumulator has followed. The first period of a record has no force
    before its beginning, later ones have that of the period before.
    """
    if not _ends_within(ended, passed - AVERAGING_TIME):
        return
    n_sample = math.ceil(AVERAGING_TIME / setup.interval)
    follows = following_accumulator(ended, passed)
    samples = empty_samples(march.n_place, n_sample, setup.model.n_probe, setup.model.n_push)
    march.advance(0, n_sample, samples, follows, is_recorded=True)
    np.maximum(ended.peak_force, follows.peak_force, out=ended.peak_force)


def _ends_within(accumulator: Accumulator, since: float) -> bool:
    """Whether a piece of any pair's force ends after a time, s, that the accumulator has followed."""
    piece, time = accumulator.force_piece, accumulator.origin[0] + since
    newest = [(held[OLDEST] + held[COUNT] - 1) % piece.shape[2] for held in accumulator.force_held.tolist()]
    return any(
        count > 0 and piece[i, END, k] > time
        for i, (k, count) in enumerate(zip(newest, accumulator.force_held[:, COUNT], strict=True))
    )
