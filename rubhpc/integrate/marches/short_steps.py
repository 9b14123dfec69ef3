"""Short steps in place of closed form, where events have no end or no forces obey the laws."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rubhpc.kernels.case_progress import FINISHED, follow

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from rubhpc.integrate.marches.contact_stepping import ContactSteppingMarch
    from rubhpc.kernels.accumulators import Accumulator, Samples
    from rubhpc.kernels.case_progress import Clock, Progress
    from rubhpc.kernels.sampling import Recorder

    Floats = NDArray[np.float64]

PASSING = 1e-3  # s, taken in short steps: many periods of what bounces so fast


class ShortSteps:
    """The march in short steps of a case that else goes from event to event, made when it is first needed.

    Parameters
    ----------
    make : callable
        Makes it, at the speed of the case.
    """

    def __init__(self, make: Callable[[], ContactSteppingMarch]) -> None:
        """Take no steps at first."""
        self._make = make
        self._march: ContactSteppingMarch | None = None
        self._n_tick = 0  # still to be taken

    @property
    def are_under_way(self) -> bool:
        """Whether ticks are still to be taken."""
        return self._n_tick > 0

    def stop(self) -> None:
        """Go on in closed form."""
        self._n_tick = 0

    def forget(self) -> None:
        """Stop, and make another march when it is needed: the speed is another one."""
        self._march, self._n_tick = None, 0

    def take_over(self, clock: Clock, progress: Progress, recorder: Recorder, motion: Floats) -> None:
        """Begin at the tick reached, with a motion (2 n,)."""
        self._march = self._march or self._make()
        self.prolong(clock)
        follow(self._march.progress, progress)
        self._march.take_over(clock, recorder, motion)

    def prolong(self, clock: Clock) -> None:
        """Take steps for a millisecond more, at most for a revolution."""
        revolution = clock.samples_per_revolution << clock.sample_level
        self._n_tick = min(revolution, max(1, round(PASSING / clock.tick)))

    def step_to(
        self,
        last_tick: int,
        clock: Clock,
        progress: Progress,
        samples: Samples,
        accumulator: Accumulator,
        motion: Floats,
        *,
        is_recorded: bool,
    ) -> tuple[int, NDArray[np.bool_]]:
        """Step as far as steps are to be taken, up to a tick; `progress` follows, and `motion` at the end.

        Returns
        -------
        int
            FINISHED, or why it stopped before.
        (q,) of bool
            Pairs that are closed.
        """
        march, before = self._march, int(progress.tick)
        assert march is not None
        outcome = march.step_to(
            min(last_tick, before + self._n_tick), clock, samples, accumulator, is_recorded
        )
        follow(progress, march.progress)
        self._n_tick -= int(progress.tick) - before
        if outcome == FINISHED:
            motion[:] = march.motion_of(march.progress, march.coordinates)
        return outcome, march.touching()
