"""The record of a stable periodic motion that was solved for: one period is marched and repeated."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.marched_record import Marched, march_record
from rubhpc.integrate.measuring.repetition import Part, repeated_samples, repeated_sums
from rubhpc.integrate.measuring.samples import empty_samples, following_accumulator
from rubhpc.integrate.periodic_motions.approach import nothing
from rubhpc.kernels.force_average import AVERAGING_TIME, COUNT, END, OLDEST

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.marches.event_driven import EventDrivenMarch
    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.kernels.accumulators import Accumulator

    Floats = NDArray[np.float64]


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
    samples = empty_samples(march.n_place, n_sample, setup.model.n_probe)
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
