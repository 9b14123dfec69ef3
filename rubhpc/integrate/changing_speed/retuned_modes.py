"""Contact modes of a range of speeds, tuned to the speeds of a run-up's pieces, several of them at once.

Only the unbalance response and the exponentials are made anew (`kernels.retuning`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.changing_speed.eigenmodes import Eigenmodes
from rubhpc.integrate.changing_speed.held_modes import HeldModes
from rubhpc.integrate.changing_speed.mode_parts import speeds_of
from rubhpc.integrate.reduced_model.table_stack import TableStack
from rubhpc.kernels.retuning import retune

NOT_TUNED = -2  # in place of a set of closed pairs: a contact mode that this piece has not met
AT_ONCE = 16  # pieces to whose speeds a contact mode is tuned at once
MOST_BYTES = 2**23  # of its tables for so many pieces; where they are more, it is tuned to fewer at once

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.reduced_model.reduction import ReducedModel
    from rubhpc.kernels.retuning import Speeds

    Ints = NDArray[np.int64]


class Desk:
    """Tables that are tuned to pieces under way, of one library after the other."""

    def __init__(self, tables: TableStack) -> None:
        self.tables = tables
        self.user: RetunedLibrary | None = None


class RetunedLibrary(HeldModes):
    """Contact modes of one set of matrices and one friction, tuned to one spin speed after the other.

    Parameters
    ----------
    reduced, model, friction, phasor, known, tick, sample_level, n_level, beside, at_place, risen, is_balanced
        As in `HeldModes`.
    desks : dict
        Of the libraries that take turns, by what they have in common.
    at_once : int
        Pieces to whose speeds a contact mode is tuned at once, at most.
    """

    def __init__(
        self,
        reduced: ReducedModel,
        model: Model,
        friction: float,
        *,
        tick: float,
        sample_level: int,
        desks: dict[tuple[object, ...], Desk] | None = None,
        at_once: int = AT_ONCE,
        **keys: Any,
    ) -> None:
        """Start with every pair open."""
        super().__init__(reduced, model, friction, tick=tick, sample_level=sample_level, **keys)
        self._at_once = at_once
        kind: tuple[object, ...] = type(self), self.width, self._n_level, self._is_measured
        desk = Desk(TableStack(1 + len(self.gap_jacobian), self._most_modes))
        self._desk = desk if desks is None else desks.setdefault(kind, desk)
        self._tables = self._desk.tables
        self.n_room = 0  # tables that each mode has, for as many pieces
        # Of the modes on the desk: the first of their tables, and up to which piece of those at hand they are
        # tuned.
        self._place: dict[int, int] = {}
        self._tuned: dict[int, int] = {}
        self._speeds = speeds_of(
            [reduced.spin], [complex(reduced.spin**2)], [0.0], [tick], reduced.spin, sample_level
        )
        self._at = 0  # piece among those at hand
        self._window = 0  # the first of the pieces for which there are tables
        self.masks: list[int] = []
        self._take_desk()
        self.add(0)

    @property
    def followed(self) -> RetunedLibrary:
        """Itself: all of a run-up is recorded."""
        return self

    @property
    def is_tuned_ahead(self) -> bool:  # type: ignore[override]
        """Whether a mode is tuned to several pieces at once: pieces begin with those met before."""
        return self.n_room > 1

    @property
    def n_most(self) -> int:
        """Contact modes that there is room for."""
        return self._tables.n_most // max(1, self.n_room)

    @property
    def window_end(self) -> int:
        """The piece, of those at hand, from which on tables are tuned anew."""
        return self._window + self.n_room

    @property
    def is_full(self) -> bool:
        """Whether there is no room for another contact mode."""
        return len(self._held) >= self.n_most

    def unmet(self, met: set[int]) -> list[int]:
        """None: each piece begins with no mode."""
        return []

    def tune(self, speeds: Speeds, piece: int) -> None:
        """Begin a piece, given by its place among the speeds: with no mode."""
        self._take_desk()
        if speeds is not self._speeds or piece <= self._at:
            self._speeds, self._tuned = speeds, {}
        self.reach(piece)

    def reach(self, piece: int) -> None:
        """Go on to a later piece of those at hand, with no mode, though some may be tuned already."""
        self._at = piece
        window = piece - piece % max(1, self.n_room)
        if window != self._window:
            self._window, self._tuned = window, {}
        self.masks = [NOT_TUNED] * len(self.masks)
        self.tables().mask[:] = NOT_TUNED

    def add(self, mask: int) -> bool:
        """Tune the mode with these pairs closed; returns whether the tables are wide enough for it."""
        if not self._has(mask):
            return False
        if mask not in self._place:
            self._put(mask)
        at, speeds = self._at, self._speeds
        place = self._place[mask] + at - self._window
        if self._tuned.get(mask, 0) <= at:
            end = min(speeds.spin.size, self.window_end)
            if mask in self._strange:
                self._solve_at(mask, place, float(speeds.within[at]), float(speeds.rise[at]))
                end = at + 1
            retune(self.tables(), place - at, self._held[mask][1], speeds, at, end)
            self._tuned[mask] = end
        self.masks[place] = self.tables().mask[place] = mask
        return True

    def eigenmodes(self, mask: int, within: float, rise: float) -> Eigenmodes | None:
        """Those of a set of closed pairs at a place in the range, from -1 to 1, and of the acceleration.

        None where a speed changes what enters them otherwise, or it has no room.
        """
        if mask not in self._held and self.is_full:
            self.forget()
        if not self._has(mask):
            return None
        row, held = self._held[mask]
        if held.rim.one >= 0 or mask in self._strange:
            return None
        return Eigenmodes.of(row, held, within, rise)

    def tuned(self, met: set[int]) -> Ints:
        """Sets of closed pairs of the tables that are tuned to this piece or to later ones, of those met."""
        found = np.full(len(self.masks), NOT_TUNED)
        for mask, end in self._tuned.items():
            if mask in met:
                first = self._place[mask] - self._window
                found[first + self._at : first + end] = mask
        return found

    def _take_desk(self) -> None:
        """Clear the desk of what another library has left on it."""
        if self._desk.user is not self:
            self._desk.user = self
            self._tables.clear()
            self._place.clear()
            self._tuned.clear()
            self.masks = []

    def _solve_at(self, mask: int, place: int, within: float, rise: float) -> None:
        """Solve a mode that cannot be followed at a place in the range, and put it on the desk."""
        assert self._at_place is not None
        library = self._with(self._at_place(within, rise))
        mode = library._solved(mask)
        row, _ = self._held[mask] = library._tabulated(mode, library._linear(mode))
        for field, new in zip(self.tables(), row, strict=True):
            field[place] = new[0]

    def _put(self, mask: int) -> None:
        """Put a mode on the desk."""
        row, place = self._held[mask][0], len(self.masks)
        self.n_room = self.n_room or self._n_room_of(sum(field.nbytes for field in row))
        self._place[mask] = place
        self._tables.add(row, self.n_room)
        self.masks += [NOT_TUNED] * self.n_room
        self.tables().mask[place:] = NOT_TUNED

    def _n_room_of(self, n_byte: int) -> int:
        """Pieces to which a mode is tuned at once, a power of two, by the memory of its tables for one."""
        found = self._at_once
        while found > 1 and found * n_byte > MOST_BYTES:
            found //= 2
        return found

    def forget(self) -> None:
        """Make room: keep no mode but that with every pair open."""
        self._exponents.clear()
        self._held.clear()
        if self._desk.user is self:
            self._desk.user = None
            self._take_desk()
            self.add(0)
