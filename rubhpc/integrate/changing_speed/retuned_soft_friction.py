"""Contact modes of friction with stick under a penalty, tuned to the speed of each piece of a run-up."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.changing_speed.retuned_laws import RetunedFrictionLibrary
from rubhpc.integrate.reduced_model.penalty_mode import overlap_rows

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.integrate.reduced_model.reduction import ReducedModel
    from rubhpc.kernels.contact_modes import ModeTables
    from rubhpc.kernels.retuning import HeldMode

    Floats = NDArray[np.float64]


class RetunedSoftFrictionLibrary(RetunedFrictionLibrary):
    """Contact modes of pairs that slide in either sense or stick, or are lifted, with springs and dampers."""

    def __init__(self, *args: Any, **keys: Any) -> None:
        """Start as `RetunedFrictionLibrary` does."""
        self._springs: list[tuple[Floats, Floats]] = []  # of a mode: gaps (k, n) by motion and coordinates
        super().__init__(*args, **keys)

    def forget(self) -> None:
        """Make room: keep no mode but that with every pair open."""
        self._springs.clear()
        super().forget()

    def _tables_of(self, mode: ContactMode, reduced: ReducedModel) -> ModeTables:
        return super()._tables_of(mode, self._pairs.damped(reduced, mode.mask))

    def _hold(self, mode: ContactMode) -> HeldMode:
        held, tables, place = super()._hold(mode), self.tables(), len(self._held)
        closed = self._pairs.closed(mode.mask)
        rows = overlap_rows(self.gap_jacobian, closed, mode, self.width)
        self._springs.append((self.gap_jacobian[closed], rows))
        still = rows.copy()
        still[:, self._moving(place, held)] = 0.0  # these are added piece by piece
        tables.loss[place] += 0.5 * self._pairs.stiffness * still.T @ still
        return held

    def _moving(self, place: int, held: HeldMode) -> list[int]:
        """Coordinates that change with the speed: the response, and what goes as the rims move."""
        m, one = held.is_pair.size, self._steady[place].one
        return [m, one, self.width + m, self.width + one]

    def _after(self, place: int, tables: ModeTables) -> None:
        """Springs hold energy by what changes with the speed too."""
        super()._after(place, tables)
        gap, rows = self._springs[place]
        if not len(rows):
            return
        moving, n = self._moving(place, self._held[place]), gap.shape[1]
        first = moving[:2]
        rows[:, first] = gap @ tables.motion_re[place, :n, first].T
        rows[:, moving[2:]] = -(gap @ tables.motion_im[place, :n, first].T)
        form = (0.5 * self._pairs.stiffness * rows[:, moving].T) @ rows
        loss = tables.loss[place]
        loss[moving] += form
        loss[:, moving] += form.T
        loss[np.ix_(moving, moving)] -= form[:, moving]
