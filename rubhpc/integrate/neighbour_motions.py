"""Two neighbouring motions of a case by the exact integrator, both in one kernel call."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.lyapunov import N_ALIGNING
from rubhpc.integrate.marches.event_driven import NoClosedForm
from rubhpc.integrate.measuring.regimes import N_MOST
from rubhpc.integrate.measuring.samples import empty_samples, new_accumulator
from rubhpc.kernels._jit import plain
from rubhpc.kernels.case_progress import (
    CONTACT_UNSOLVED,
    DIVERGED,
    FINISHED,
    MODE_WANTED,
    ask_for,
    begin_in,
    closed_pairs,
    new_progress,
)
from rubhpc.kernels.event_loop import event_work
from rubhpc.kernels.measuring import recorder
from rubhpc.kernels.separation import Pair, part

if TYPE_CHECKING:
    from rubhpc.integrate.marches.event_driven import EventDrivenMarch

N_SPAN = 4  # passed by one kernel call


class NeighbourMotions:
    """The motion of a march from where it stands on, and one beside it."""

    def __init__(self, march: EventDrivenMarch) -> None:
        """Start where `march` is, which itself stays there."""
        self.most_spans = N_ALIGNING + N_MOST
        self._march = march
        n_coordinate, n_motion = march.tables.switch_re.shape[2], march.tables.motion_re.shape[1]
        n, q = march.n_place, march.touching().size
        self._pair = Pair(
            progress=new_progress(2),
            z=np.zeros((2, 2, n_coordinate)),
            z_next=np.zeros((2, n_coordinate)),
            motion=np.zeros((2, n_motion)),
            size=np.zeros(1),
            ratio=np.zeros(N_SPAN),
            n_done=np.full(1, N_SPAN),
        )
        self._n_read = N_SPAN
        progress, self._pair.z[0] = march.place()
        begin_in(self._pair.progress[0], progress.mode)
        self._unrecorded = event_work(q), recorder(n), empty_samples(n, 0), new_accumulator(q)

    def part(self, n_revolution: int) -> float | None:
        """Go on with both; see `lyapunov.Neighbours`. Several spans are passed ahead, all of one length.

        Raises
        ------
        NoClosedForm
            Only short steps can follow one of them.
        """
        if self._n_read == N_SPAN:
            self._pass_spans(n_revolution)
            self._n_read = 0
        if self._n_read == self._pair.n_done[0]:
            return None
        ratio = float(self._pair.ratio[self._n_read])
        self._n_read += 1
        return ratio if math.isfinite(ratio) else None

    def _pass_spans(self, n_revolution: int) -> None:
        """Fill the ratios, as far as both motions go on."""
        march, pair = self._march, self._pair
        pair.n_done[0] = 0
        n_tick = n_revolution * march.clock.samples_per_revolution << march.clock.sample_level
        outcome = -1
        while outcome != FINISHED:
            if march.check is not None:
                march.check()
            outcome = part(march.tables, march.bodies, march.clock, n_tick, pair, *self._unrecorded)
            if outcome == CONTACT_UNSOLVED:
                raise NoClosedForm
            if outcome == DIVERGED:
                return
            if march.is_beyond(pair.motion[0]):
                pair.n_done[0] = 0
                return
            if outcome == MODE_WANTED:
                self._tabulate()

    def _tabulate(self) -> None:
        """Have the tables tabulated that are wanted.

        A motion that is in a mode by now enters it anew where a set of contacts is new to the case. Where
        one has only been forgotten it stays: what other cases have left in the library must not matter.
        """
        march, pair = self._march, self._pair
        masks = [
            plain(closed_pairs)(progress, march.tables) if progress.wanted < 0 else int(progress.wanted)
            for progress in pair.progress
        ]
        if not march.has_met(masks):
            for progress, z, motion in zip(pair.progress, pair.z, pair.motion, strict=True):
                if progress.wanted < 0:
                    motion[:] = march.motion_of(progress, z)
                    ask_for(progress, plain(closed_pairs)(progress, march.tables))
        standing = [i for i, progress in enumerate(pair.progress) if progress.wanted < 0]
        for i in sorted(range(2), key=standing.count):  # room for what is wanted is made first
            march.find(masks[i])
        for i in standing:
            begin_in(pair.progress[i], march.tables.mask.tolist().index(masks[i]))
