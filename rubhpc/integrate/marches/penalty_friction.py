"""A case from event to event under set-valued friction and a penalty, in closed form between events."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.marches.friction import FrictionMarch
from rubhpc.kernels.friction_states import MOST_SOFT_PAIRS, lifted_place
from rubhpc.kernels.penalty_events import pressed_pairs

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.kernels.contact_pairs import Workspace

    Floats = NDArray[np.float64]


class PenaltyFrictionMarch(FrictionMarch):
    """A case whose pairs open, are lifted, slide in either sense and stick, with springs and dampers."""

    most_pairs = MOST_SOFT_PAIRS

    def opened(self, mask: int) -> NDArray[np.bool_]:
        """Whether each pair is open and not lifted, (q,)."""
        q = self._clearance.size
        is_lifted = np.array([bool(mask >> lifted_place(q, i) & 1) for i in range(q)])
        return np.asarray(~self.closed(mask) & ~is_lifted)

    def _soften(self, solver: Workspace) -> None:
        """Normal forces do not depend on each other."""
        solver.matrix[:], solver.coupling[:] = np.eye(len(solver.matrix)), 0.0

    def _first_mask(self, contact_force: Floats) -> int:
        return self._states_after(np.zeros(self._clearance.size, dtype=np.bool_), 0.0)

    def _states_after(self, is_pressed: NDArray[np.bool_], angle: float, further: int = 0) -> int:
        """States by the overlaps of the motion; forces of steps of collocation are not used."""
        q = self._clearance.size
        found = int(pressed_pairs(self.bodies, self._motion))
        pressed = np.array([bool(found >> i & 1) for i in range(q)])
        return super()._states_after(pressed, angle, found >> q << lifted_place(q, 0))
