"""Collocation for a while, where events of the closed form have no end or no forces obey the laws."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rubhpc.kernels.case_progress import FINISHED, follow

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from rubhpc.integrate.marches.collocation import CollocationMarch
    from rubhpc.kernels.accumulators import Accumulator, Samples
    from rubhpc.kernels.case_progress import Clock, Progress
    from rubhpc.kernels.sampling import Recorder

    Floats = NDArray[np.float64]
    Flags = NDArray[np.bool_]

PASSING = 1e-3  # s, taken by collocation: many periods of what bounces so fast


class Interlude:
    """The march by collocation of a case that else goes from event to event, made when it is first needed.

    Parameters
    ----------
    make : callable
        Makes it, at the speed of the case.
    """

    def __init__(self, make: Callable[[], CollocationMarch]) -> None:
        """Take no steps at first."""
        self._make = make
        self._march: CollocationMarch | None = None
        self._n_tick = 0  # still to be taken

    @property
    def is_under_way(self) -> bool:
        """Whether ticks are still to be taken."""
        return self._n_tick > 0

    def stop(self) -> None:
        """Go on in closed form."""
        self._n_tick = 0

    def forget(self) -> None:
        """Stop, and make another march when it is needed: the speed is another one."""
        self._march, self._n_tick = None, 0

    def take_over(
        self, clock: Clock, progress: Progress, recorder: Recorder, motion: Floats, closed: Flags
    ) -> None:
        """Begin at the tick reached, with a motion (2 n,) and the closed pairs (q,)."""
        self._march = self._march or self._make()
        self.prolong(clock)
        self._march.take_over(clock, progress, recorder, motion, closed)

    def prolong(self, clock: Clock) -> None:
        """Go on for a millisecond more, at most for a revolution."""
        revolution = clock.samples_per_revolution << clock.sample_level
        self._n_tick = min(revolution, max(1, round(PASSING / clock.tick)))

    def advance(
        self,
        last_tick: int,
        clock: Clock,
        progress: Progress,
        samples: Samples,
        accumulator: Accumulator,
        motion: Floats,
        *,
        is_recorded: bool,
    ) -> tuple[int, Flags]:
        """Go on as far as ticks are to be taken, up to one; `progress` follows, and `motion` at the end.

        Returns
        -------
        int
            FINISHED, or why it stopped before.
        (q,) of bool
            Pairs that are closed.
        """
        march, before = self._march, int(progress.tick)
        assert march is not None
        outcome = march.advance_to(
            min(last_tick, before + self._n_tick), clock, samples, accumulator, is_recorded
        )
        follow(progress, march.progress)
        self._n_tick -= int(progress.tick) - before
        if outcome == FINISHED:
            motion[:] = march.motion()
        return outcome, march.touching()
