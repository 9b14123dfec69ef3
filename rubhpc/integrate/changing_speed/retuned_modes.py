"""Contact modes whose matrices stay or follow the spin speed: only the unbalance response is made anew.

A library holds the contact modes of a range of speeds, and tunes them to the speeds of a run-up's pieces
(`kernels.retuning`), several of them at once.
"""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.changing_speed.eigenmodes import Eigenmodes
from rubhpc.integrate.changing_speed.followed_modes import (
    MOST_LOST,
    Node,
    followed,
    matched,
)
from rubhpc.integrate.changing_speed.mode_entries import entries
from rubhpc.integrate.changing_speed.mode_parts import (
    held_mode,
    output_operators,
    speeds_of,
    with_slip,
    without_renewed,
)
from rubhpc.integrate.changing_speed.near_modes import Linear, near_mode
from rubhpc.integrate.reduced_model.mode_library import ModeLibrary, width_without_modes
from rubhpc.integrate.reduced_model.reduction import directions
from rubhpc.integrate.reduced_model.table_stack import TableStack
from rubhpc.integrate.reduced_model.touching import OpenBodies, contact_mode_among, open_bodies
from rubhpc.kernels.contact_modes import SAMPLES_AT_ONCE
from rubhpc.kernels.retuning import retune
from rubhpc.kernels.retuning_laws import Springs

NOT_TUNED = -2  # in place of a set of closed pairs: a contact mode that this piece has not met
AT_ONCE = 16  # pieces to whose speeds a contact mode is tuned at once
MOST_BYTES = 2**23  # of its tables for so many pieces; where they are more, it is tuned to fewer at once

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.integrate.reduced_model.reduction import ReducedModel
    from rubhpc.integrate.reduced_model.system_modes import Solved
    from rubhpc.kernels.contact_modes import ModeTables
    from rubhpc.kernels.retuning import HeldMode, Speeds

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]
    Ints = NDArray[np.int64]


class Desk:
    """Tables that are tuned to pieces under way, of one library after the other."""

    def __init__(self, tables: TableStack) -> None:
        self.tables = tables
        self.user: RetunedLibrary | None = None


class RetunedLibrary(ModeLibrary):
    """Contact modes of one set of matrices and one friction, tuned to one spin speed after the other.

    Parameters
    ----------
    reduced : ReducedModel
        Matrices; its spin and force are those of some speed.
    phasor : (n,), complex
        Unbalance at unit speed, kg m: at the speed W its force is `Re[W^2 phasor exp(i W t)]`, N.
    tick : float, s
    sample_level, n_level : int
        As in `ModeLibrary`; levels stay, the tick changes with the speed.
    desks : dict
        Of the libraries that take turns, by what they have in common.
    beside : sequence of ReducedModel
        The same at other speeds of the range (`followed_modes.NODES`), through which modes follow
        the speed; none where they stay what they are.
    at_place : callable, optional
        The same at a place in the range, from -1 to 1, and of the acceleration: for modes that cannot be
        followed, which are solved at each piece.
    risen : ReducedModel, optional
        The same in the middle of the range at another acceleration, with which modes go evenly.
    is_balanced : bool
        Whether energies are asked for, which stand in no table of modes that follow the speed.
    at_once : int
        Pieces to whose speeds a contact mode is tuned at once, at most.
    """

    _n_ahead = 0  # outputs are filled in for each speed

    def __init__(
        self,
        reduced: ReducedModel,
        model: Model,
        friction: float,
        *,
        phasor: Complexes,
        known: Solved,
        tick: float,
        sample_level: int,
        n_level: int,
        desks: dict[tuple[object, ...], Desk] | None = None,
        beside: Sequence[ReducedModel] = (),
        at_place: Callable[[float, float], ReducedModel] | None = None,
        risen: ReducedModel | None = None,
        is_balanced: bool = True,
        at_once: int = AT_ONCE,
    ) -> None:
        """Start with every pair open."""
        self.reduced, self._known = reduced, known
        self._is_measured, self._at_place, self._at_once = is_balanced, at_place, at_once
        self.gap_jacobian, self.force_direction, self.slip = directions(reduced, model, friction)
        self._tick, self._sample_level, self._n_level = tick, sample_level, n_level
        self._phasor, self._output = phasor, np.hstack(output_operators(reduced))
        self._among: OpenBodies | None = None
        self._opened, self._is_open = self._solve(0), True
        self._among = open_bodies(reduced, model, self._opened)
        self.first_masks = [0]
        self.width = self._width_of(model, friction)
        self._beside = [self._with(other) for other in beside]
        self._risen = [self._with(risen)] if risen is not None else []
        q = len(self.gap_jacobian)
        kind: tuple[object, ...] = type(self), self.width, n_level, is_balanced
        desk = Desk(TableStack(1 + q, self._most_modes))
        self._desk = desk if desks is None else desks.setdefault(kind, desk)
        self._tables = self._desk.tables
        self._exponents = {}
        self.n_room = 0  # tables that each mode has, for as many pieces
        # By the set of closed pairs: what is kept of a mode; of those on the desk, the first of its tables,
        # and up to which piece of those at hand it is tuned.
        self._held: dict[int, tuple[ModeTables, HeldMode]] = {}
        self._place: dict[int, int] = {}
        self._tuned: dict[int, int] = {}
        self._strange: set[int] = set()  # modes that cannot be followed
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
    def n_byte(self) -> int:
        """Memory that its contact modes hold."""
        fields = (field for kept in self._held.values() for part in kept for field in part)
        sizes = {
            id(field): field.nbytes
            for field in fields
            if isinstance(field, np.ndarray) and any(field.strides)
        }
        return sum(sizes.values())

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

    def follows(self, mask: int) -> bool:
        """Whether a mode follows the speed, in coordinates that go on from piece to piece."""
        return bool(self._beside) and mask not in self._strange

    def has_strange(self) -> bool:
        """Whether one of the modes cannot be followed, and is solved at each piece."""
        return bool(self._strange)

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
        for mask, place in self._place.items():
            if mask in met:
                first = place - self._window
                found[first + self._at : first + self._tuned.get(mask, 0)] = mask
        return found

    def _take_desk(self) -> None:
        """Clear the desk of what another library has left on it."""
        if self._desk.user is not self:
            self._desk.user = self
            self._tables.clear()
            self._place.clear()
            self._tuned.clear()
            self.masks = []

    def _has(self, mask: int) -> bool:
        """Whether it has the mode with these pairs closed; one met for the first time is solved."""
        if mask not in self._held:
            mode = self._solved(mask)
            if mode.exponent.size > self.width:
                return False
            self._tabulate(mode)
        return True

    def _tabulate(self, mode: ContactMode, row: ModeTables | None = None) -> None:
        self._note_exponents(mode)
        own = self._linear(mode)
        row, held = self._tabulated(mode, own, row)
        if self._beside:
            middle = Node.of(mode, held, self._slip_rows())
            found = [self._node(mode, own, library) for library in (*self._beside, *self._risen)]
            nodes, n = [middle, *(node for node in found if node is not None)], 1 + len(self._beside)
            if len(nodes) > len(found):
                risen = nodes[n] if self._risen else None
                entered = entries(nodes[:n], risen)
                if entered.lost <= MOST_LOST:
                    held = followed(nodes[:n], risen, entered, own.seen)
            if held is middle.held:
                self._strange.add(mode.mask)
        self._held[mode.mask] = row, held

    def _node(self, mode: ContactMode, own: Linear, library: RetunedLibrary) -> Node | None:
        """The same mode in another library; None where that has another motion."""
        linear = library._linear(mode)
        near = near_mode(mode, (own, linear), self.reduced, library.reduced)
        found = near or matched(mode, library._solved(mode.mask))
        return Node.of(found, library._hold(found, None, linear), library._slip_rows()) if found else None

    def _tabulated(
        self, mode: ContactMode, linear: Linear, row: ModeTables | None = None
    ) -> tuple[ModeTables, HeldMode]:
        """A mode of these matrices with what is renewed of its tables left out."""
        row = row or self._tables_of(mode, self.reduced)
        if not self._is_measured:
            row = with_slip(row, self._slip_rows() @ mode.motion[self.slip.shape[1] :], mode.exponent)
        row = without_renewed(row, len(self._output))
        return row, self._hold(mode, row if self._is_measured else None, linear)

    def _with(self, reduced: ReducedModel) -> RetunedLibrary:
        """A library with other matrices that solves and tabulates as this one does, and holds nothing."""
        other = copy(self)
        other.reduced, other._output = reduced, np.hstack(output_operators(reduced))
        other._beside, other._is_open = [], False
        return other

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

    def _solve(self, mask: int) -> ContactMode:
        """The mode of a set of states."""
        directions = self.gap_jacobian, self.force_direction
        return contact_mode_among(self._among, self.reduced, directions, mask, self._known)

    def _solved(self, mask: int) -> ContactMode:
        if not self._is_open:  # one beside another, most of whose modes follow from those of that
            self._is_open, self._opened = True, self._solve(0)
            self._among = self._among.at(self.reduced, self._opened) if self._among else None
        return self._opened if mask == 0 else self._solve(mask)

    def _width_of(self, model: Model, friction: float) -> int:
        """Width of tables for any mode that is met later."""
        return width_without_modes(self.reduced, model, friction, self._opened.exponent.size)

    def _linear(self, mode: ContactMode) -> Linear:
        """What a set of closed pairs makes of the motion."""
        closed = [i for i in range(len(self.slip)) if mode.mask >> i & 1]
        directions = self.gap_jacobian, self.force_direction
        return Linear.of_closed(closed, self.reduced, directions, self._phasor)

    def _hold(self, mode: ContactMode, row: ModeTables | None, linear: Linear) -> HeldMode:
        """What the spin speed leaves alone of a mode and its tables, (1, ...) each; None without energies."""
        return held_mode(
            mode,
            self.reduced,
            linear,
            slip=self._slip_rows(),
            phasor=self._phasor,
            output=self._output,
            width=self.width,
            n_ahead=1 if self._closed_pairs(mode.mask) else SAMPLES_AT_ONCE,
            springs=self._springs_of(mode),
            is_balanced=self._is_measured,
        )

    def _springs_of(self, mode: ContactMode) -> Springs:
        """Springs that press in a mode."""
        return Springs(0.0, self.gap_jacobian[:0], np.zeros((0, 2 * self.width)))
