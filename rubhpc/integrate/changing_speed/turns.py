"""A record with a changing speed: contact of each revolution and of the whole, samples at fixed angles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.measuring.measures import contact_measures
from rubhpc.integrate.measuring.monitors import carrier_displacement, monitored
from rubhpc.integrate.measuring.rub_in_bores import rub_measures
from rubhpc.integrate.measuring.samples import empty_samples, new_accumulator
from rubhpc.kernels.accumulators import EXTREMA, SUMMED
from rubhpc.kernels.resampling import resample

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.kernels.accumulators import Accumulator

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]


MOST_WAITING = 128  # revolutions that are added at once


class Turns:
    """Contact of each revolution and of a whole record.

    Attributes
    ----------
    contact_time, peak_force, friction_work : (n_revolution, n_stator)
        Of each revolution; s, N and J.
    together : Accumulator
        Sums and extrema of all revolutions.

    They contain what was added before the last call of `sum_up`.
    """

    def __init__(self, n: int, model: Model) -> None:
        n_stator = len(model.stators)
        self.contact_time, self.peak_force, self.friction_work = np.zeros((3, n, n_stator))
        self.together = new_accumulator(n_stator, model.n_place)
        self._waiting: list[tuple[int, Accumulator]] = []

    def add(self, turn: int, accumulator: Accumulator) -> None:
        """Add the accumulator of a revolution, or of a part of one."""
        self._waiting.append((turn, accumulator))
        if len(self._waiting) == MOST_WAITING:
            self.sum_up()

    def sum_up(self) -> None:
        """Add the waiting accumulators."""
        if not self._waiting:
            return
        turns, accumulators = zip(*self._waiting, strict=True)
        self._waiting = []
        new = {name: np.array([getattr(one, name) for one in accumulators]) for name in (*SUMMED, *EXTREMA)}
        at = list(turns)
        np.add.at(self.contact_time, at, new["contact_time"])
        np.add.at(self.friction_work, at, new["friction_work"])
        np.maximum.at(self.peak_force, at, new["peak_force"])
        for name in SUMMED:
            total = getattr(self.together, name)
            total += new[name].sum(axis=0)
        for name, extreme in EXTREMA.items():
            total = getattr(self.together, name)
            extreme(total, extreme.reduce(new[name]), out=total)


def measures_of_turns(
    together: Accumulator, whole: Floats, n_revolution: int, model: Model, *, duration: float, is_round: bool
) -> dict[str, Any]:
    """Measures of the contacts of a whole record, as at constant speed (`measures_of`).

    `together` is the accumulator of all revolutions, `whole` their samples (`Samples.whole`), `duration`
    their time, s, and `is_round` whether the gap includes the roundness of the rim.
    """
    samples = empty_samples(model.n_place, whole.shape[1], model.n_probe, model.n_push)
    samples.whole[:] = whole
    return {
        **contact_measures(together, n_revolution, duration),
        "carrier_displacement": carrier_displacement(samples, model),
        **rub_measures(samples.push, together, duration, model),
    } | monitored(samples, together, model, is_round=is_round)


def bring_to_angles(whole: Floats, swing: Floats, cuts: Ints, n_place: int) -> None:
    """Resample (`Samples.whole`) at the intended angles of the shaft, in place.

    A piece is sampled at even times. At the acceleration a the shaft then lags the even angles by up to
    `a T^2 / 8`, and reaches them later.

    Contact forces, which are means over the intervals, are not changed.

    Parameters
    ----------
    swing : (n_piece,)
        Change of the speed over each piece, over the sum of its first and its last speed.
    cuts : (n_piece + 1,)
        Samples between which the pieces lie.
    """
    if swing.any():
        first_force = 4 + 2 * n_place
        resample(whole[:first_force], swing, cuts)
        resample(whole[first_force + n_place :], swing, cuts)
