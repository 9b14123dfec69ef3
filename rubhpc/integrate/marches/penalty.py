"""A case from event to event under a penalty: springs and dampers join bodies that press, in closed form."""

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
    """A case whose pairs are open, press, or are lifted: overlapped still, and without a force."""

    take_change = staticmethod(change_pressed)

    def change(
        self, mask: int, crossing: int, angle: float, motion: Floats, moment: float | None = None
    ) -> int:
        """Take an event, which leaves `motion` (2 n,) as it is; returns the states that go on.

        Nothing impacts here: no `moment` decides whether a pair parts.
        """
        return int(self.take_change(self.bodies, mask, crossing, motion))

    def moved_by(self, mask: int) -> int:
        """What of a set of states decides how the bodies move: the pairs that press."""
        return mask & ((1 << self._clearance.size) - 1)

    def opened(self, mask: int) -> NDArray[np.bool_]:
        """Which pairs are open, and not lifted, (q,)."""
        return ~self.closed(mask) & ~self.closed(mask >> self._clearance.size)

    def _find_library(self, setup: ModalSetup, friction: float) -> ModeLibrary:
        if self._clearance.size > MOST_PAIRS:
            raise NoClosedForm
        return setup.penalty_library(friction)

    def _first_mask(self, contact_force: Floats) -> int:
        return int(pressed_pairs(self.bodies, self._motion))
