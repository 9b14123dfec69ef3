"""A case from event to event under a penalty: springs and dampers between pressed bodies, in closed form."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rubhpc.integrate.marches.event_driven import EventDrivenMarch
from rubhpc.integrate.marches.met_modes import NoClosedForm
from rubhpc.kernels.penalty_events import MOST_PAIRS, change_pressed, pressed_pairs

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.reduced_model.mode_library import ModeLibrary

    Floats = NDArray[np.float64]


class PenaltyMarch(EventDrivenMarch):
    """A case whose pairs are open, pressed, or lifted: still overlapped, without a force."""

    take_change = staticmethod(change_pressed)

    def change(
        self, mask: int, crossing: int, angle: float, motion: Floats, moment: float | None = None
    ) -> int:
        """Compute an event, which does not change `motion` (2 n,); returns the states afterwards.

        There are no impacts: `moment` has no effect.
        """
        return int(self.take_change(self.bodies, mask, crossing, motion))

    def moved_by(self, mask: int) -> int:
        """Part of a set of states that determines the motion: the pressed pairs."""
        return mask & ((1 << self._clearance.size) - 1)

    def opened(self, mask: int) -> NDArray[np.bool_]:
        """Whether each pair is open and not lifted, (q,)."""
        return ~self.closed(mask) & ~self.closed(mask >> self._clearance.size)

    def _find_library(self, setup: ModalSetup, friction: float) -> ModeLibrary:
        if self._clearance.size > MOST_PAIRS:
            raise NoClosedForm
        return setup.penalty_library(friction)

    def _first_mask(self, contact_force: Floats) -> int:
        return int(pressed_pairs(self.bodies, self._motion))
