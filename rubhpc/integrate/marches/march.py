"""Interface of all integrators: advance a case sample by sample, return its state and energy."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.record import State
    from rubhpc.kernels.accumulators import Accumulator, Samples

LONGEST_CALL = 0.15  # s; stop signals are handled between kernel calls
ALL_SAMPLES = 2**62  # in one kernel call, which pauses by itself
STEPS_A_SECOND = 5e5  # half of the rate of every integrator
NO_FORCES = "no contact forces that obey the laws were found"  # reason of an end


def ended_in(reason: str, revolution: int) -> str:
    """Return why a case cannot continue, with the revolution, before what may help."""
    what, *fix = reason.split("; ", 1)
    return "; ".join([f"{what} in revolution {revolution}", *fix])


class March(ABC):
    """A running case; sample 0 is the first recorded one, the transient lies before it."""

    def __init__(self, check: Callable[[], None] | None, first_stride: int, model: Model) -> None:
        """Set the function to call between kernel calls, the samples of the first call, and the model."""
        self.n_place = model.n_place
        self.n_probe = 0 if model.probe is None else len(model.probe.probes)
        self.n_body = model.n_place - len(model.turning_carriers)  # tips and carriers, their rotations aside
        self.n_step = 0
        self.sample = 0
        self.check = check
        self._stride = max(1, first_stride)

    def advance(
        self, first: int, last: int, samples: Samples, accumulator: Accumulator, *, is_recorded: bool
    ) -> str | None:
        """Advance from sample `first` to `last`; returns None, or why the case cannot continue."""
        self.sample = first
        while self.sample < last:
            if self.check is not None:
                self.check()
            before = self.n_step
            stop = min(self.sample + self._stride, last)
            reason = self._call(stop, samples, accumulator, is_recorded=is_recorded)
            if reason is not None:
                return reason
            self.sample = stop
            # By steps, not by the clock: the end of a call affects the last bits of modal results.
            elapsed = max(self.n_step - before, 1) / STEPS_A_SECOND
            stride = int(self._stride * min(2.0, 0.5 * LONGEST_CALL / elapsed))
            self._stride = min(max(1, stride), ALL_SAMPLES)  # a transient may be a thousand calls long
        return None

    @abstractmethod
    def _call(
        self, stop: int, samples: Samples, accumulator: Accumulator, *, is_recorded: bool
    ) -> str | None:
        """Advance from `self.sample` to sample `stop` in one kernel call."""

    def start_again(self, state: State) -> bool:
        """Restart the same case at another state; False where that needs a new march."""
        return False

    @abstractmethod
    def touching(self) -> NDArray[np.bool_]:
        """Whether each pair is in contact, (q,)."""

    @abstractmethod
    def energy(self) -> float:
        """Mechanical energy, J."""

    @abstractmethod
    def final(self) -> State:
        """State at the sample reached."""
