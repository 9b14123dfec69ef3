"""Contact modes with curved gaps, tuned to the speed of each piece of a run-up."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.changing_speed.retuned_modes import Linear, RetunedLibrary
from rubhpc.integrate.reduced_model.curved_library import CurvedLibrary
from rubhpc.integrate.reduced_model.curved_tables import StillParts, motion_rows, still_parts, tuned_tables

if TYPE_CHECKING:
    from collections.abc import Callable

    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.integrate.reduced_model.reduction import ReducedModel
    from rubhpc.kernels.retuning import HeldMode


class RetunedCurvedLibrary(RetunedLibrary, CurvedLibrary):
    """Contact modes of one set of matrices, with what curved gaps need of them.

    `at_piece` gives the reduced model at the speed of the piece at hand.
    """

    at_once = 1  # the tables of curved gaps are larger, and are made piece by piece

    def __init__(self, *args: Any, at_piece: Callable[[], ReducedModel], **keys: Any) -> None:
        """Start with every pair open."""
        self._row, self._curved = motion_rows(args[0], args[1]), None
        self._at_piece = at_piece
        self._still: dict[int, StillParts] = {}  # by place
        super().__init__(*args, **keys)

    def add(self, mask: int) -> bool:
        """Tune the mode with these pairs closed; returns whether the tables are wide enough for it."""
        is_tuned = self._tuned.get(self._place.get(mask, -1), 0) > self._at
        if not super().add(mask):
            return False
        if not is_tuned:
            self._tune_curved(self._place[mask])
        return True

    def forget(self) -> None:
        """Make room: keep no mode but that with every pair open."""
        if self._curved is not None:
            self._curved.clear()
        super().forget()

    def _hold(self, mode: ContactMode, place: int) -> HeldMode:
        directions = self.gap_jacobian, self.force_direction
        self._still[place] = still_parts(mode, self.reduced, self._row, directions, self.width)
        return super()._hold(mode, place)

    def _linear(self, mode: ContactMode) -> Linear:
        linear = super()._linear(mode)  # friction follows the momentary normal, and is not counted
        return linear._replace(across=np.zeros_like(linear.across))

    def _tune_curved(self, place: int) -> None:
        tables, curved = self.tables(), self.curved_tables()
        motion = tables.motion_re[place] + 1j * tables.motion_im[place]
        steps = np.ldexp(self._speeds.tick[self._at], np.arange(curved.weight_re.shape[1]))
        exponent = self._held[place].exponent
        tuned = tuned_tables(self._still[place], self._at_piece(), exponent, motion, steps)
        for field, now in zip(curved, tuned, strict=True):
            field[place] = now
