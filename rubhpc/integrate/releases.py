"""Records in which bearings let go of the shaft: the case goes on without them, in other modes."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.integrate.marched_record import Marched, joined_sums, march_record
from rubhpc.integrate.measuring.samples import add_sag, empty_samples, following_accumulator

if TYPE_CHECKING:
    from collections.abc import Callable

    from rubhpc.integrate.marches.march import March
    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.record import State


class Through(NamedTuple):
    """A record through the releases in it, about the shaft without loads, and what it ends with."""

    marched: Marched
    march: March
    setup: ModalSetup
    n_step: int  # of the marches before
    n_sample: int


def record_through(
    march: March, setup: ModalSetup, n_revolution: int, again: Callable[[State, ModalSetup], March]
) -> Through:
    """Record so many revolutions from where a march stands; where bearings let go, begin `again`."""
    parts: list[Marched] = []
    gained, done, n_step, turn = 0.0, 0, 0, setup.interval * setup.samples_per_revolution
    begins = turn * np.arange(n_revolution + 1, dtype=np.float64)
    while True:
        release = setup.release
        n = (n_revolution if release is None else release.turn(begins)) - done
        sums = following_accumulator(parts[-1].accumulator, turn * done) if parts else None
        marched = march_record(march, setup, n, sums)
        add_sag(marched.samples, marched.accumulator, setup.model)
        parts.append(marched)
        gained += marched.energy[1] - marched.energy[0]
        if marched.reason is not None or release is None or done + n == n_revolution:
            break
        done, n_step = done + n, n_step + march.n_step
        setup = release.setup
        march = again(marched.final, setup)
    model, n_sample = setup.model, setup.samples_per_revolution
    samples = empty_samples(march.n_place, n_revolution * n_sample, model.n_probe, model.n_push)
    whole = np.concatenate([part.samples.whole for part in parts], axis=1)
    samples.whole[:, : whole.shape[1]] = whole
    taken = Marched(
        samples,
        joined_sums([part.accumulator for part in parts]),
        (0.0, gained),
        marched.final,
        marched.reason,
    )
    return Through(taken, march, setup, n_step, done * n_sample)
