"""Contact modes with curved gaps over a range of speeds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rubhpc.integrate.changing_speed.range_library import RangeLibrary
from rubhpc.integrate.reduced_model.curved_library import (
    CurvedLibrary,
    StillParts,
    empty_tables,
    motion_rows,
    n_tabulated,
    push,
    still_parts,
    tune,
)
from rubhpc.integrate.reduced_model.table_stack import TableStack

if TYPE_CHECKING:
    from collections.abc import Callable

    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.integrate.reduced_model.reduction import ReducedModel
    from rubhpc.kernels.contact_modes import ModeTables


class RangeCurvedLibrary(RangeLibrary, CurvedLibrary):
    """Contact modes of one range of speeds, with what curved gaps need of them.

    `at_piece` gives the reduced model at the speed of the piece at hand.
    """

    def __init__(self, *args: Any, at_piece: Callable[[], ReducedModel], **keys: Any) -> None:
        """Start with every pair open."""
        self._row, self._curved = motion_rows(args[0], args[1]), None
        self._at_piece = at_piece
        self._still: dict[int, StillParts] = {}  # by set of closed pairs
        self._n_curved, self._n_step = 0, n_tabulated(keys["tick"], keys["n_level"])
        # Its own buffer: tables of curved gaps stay where they are. They are larger, and made piece by piece.
        super().__init__(*args, **keys | {"buffers": None, "at_once": 1})

    def add(self, mask: int) -> bool:
        """Fill tables of the mode with these pairs closed; returns whether they are wide enough for it."""
        is_filled = self._filled.get(mask, 0) > self._at
        if not super().add(mask):
            return False
        if not is_filled:
            self._tune_curved(mask)
        return True

    def forget(self) -> None:
        """Make room: keep no mode but that with every pair open."""
        if self._curved is not None:
            self._curved.clear()
        self._n_curved = 0
        self._still.clear()
        super().forget()

    def _tabulate(self, mode: ContactMode, row: ModeTables | None = None) -> None:
        directions = self.gap_jacobian, self.force_direction
        self._still[mode.mask] = still_parts(mode, self.reduced, self._row, directions)
        super()._tabulate(mode, row)

    def _tune_curved(self, mask: int) -> None:
        place, tables = self._place[mask], self.tables()
        reduced, still = self._at_piece(), self._still[mask]
        if self._curved is None:
            self._curved = TableStack(1 + len(self.gap_jacobian), self._most_modes)
        is_new = place == self._n_curved
        if is_new:
            self._curved.add(empty_tables(still, self.width, self._n_step))
            self._n_curved += 1
        curved = self.curved_tables()
        if is_new or (self._is_followed and still.closed):
            push(curved, place, still, reduced, (tables.enter_re[place] + 1j * tables.enter_im[place]).T)
        motion = tables.motion_re[place], tables.motion_im[place]
        longest = float(self._speeds.tick[self._at]) * 2.0 ** (self._n_step - 1)
        tune(curved, place, still, reduced, self._held[mask][1].exponent, motion, longest)
