"""Contact modes of friction with stick under a penalty, tuned to the speed of each piece of a run-up."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.changing_speed.retuned_laws import RetunedFrictionLibrary
from rubhpc.integrate.reduced_model.penalty_mode import overlap_rows
from rubhpc.kernels.retuning_laws import NO_RIM, Springs

if TYPE_CHECKING:
    from rubhpc.integrate.changing_speed.near_modes import Linear
    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.integrate.reduced_model.reduction import ReducedModel
    from rubhpc.kernels.contact_modes import ModeTables
    from rubhpc.kernels.retuning import HeldMode


class RetunedSoftFrictionLibrary(RetunedFrictionLibrary):
    """Contact modes of pairs that slide in either sense or stick, or are lifted, with springs and dampers."""

    def _tables_of(self, mode: ContactMode, reduced: ReducedModel) -> ModeTables:
        if not self._is_measured:
            return super()._tables_of(mode, reduced)
        return super()._tables_of(mode, self._pairs.damped(reduced, mode.mask))

    def _springs_of(self, mode: ContactMode) -> Springs:
        closed = self._pairs.closed(mode.mask)
        rows = overlap_rows(self.gap_jacobian, closed, mode, self.width)
        return Springs(0.5 * self._pairs.stiffness, np.ascontiguousarray(self.gap_jacobian[closed]), rows)

    def _hold(self, mode: ContactMode, row: ModeTables | None, linear: Linear) -> HeldMode:
        held = super()._hold(mode, row, linear)
        if row is None:
            return held
        m, one = held.is_pair.size, held.rim.one
        moving = [m, self.width + m] if one == NO_RIM else [m, one, self.width + m, self.width + one]
        still = held.springs.overlap.copy()
        still[:, moving] = 0.0  # these are added piece by piece
        row.loss[0] += held.springs.half * still.T @ still
        return held
