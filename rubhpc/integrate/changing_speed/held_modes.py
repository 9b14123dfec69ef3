"""Contact modes whose matrices stay or follow the spin speed, solved once for a range of speeds."""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.changing_speed.followed_modes import MOST_LOST, Node, followed, matched
from rubhpc.integrate.changing_speed.mode_entries import entries
from rubhpc.integrate.changing_speed.mode_parts import (
    held_mode,
    output_operators,
    with_slip,
    without_renewed,
)
from rubhpc.integrate.changing_speed.near_modes import Linear
from rubhpc.integrate.reduced_model.mode_library import ModeLibrary, width_without_modes
from rubhpc.integrate.reduced_model.reduction import directions
from rubhpc.integrate.reduced_model.touching import OpenBodies, contact_mode_among, open_bodies
from rubhpc.kernels.contact_modes import SAMPLES_AT_ONCE
from rubhpc.kernels.retuning_laws import Springs

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import Self

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.integrate.reduced_model.reduction import ReducedModel
    from rubhpc.integrate.reduced_model.system_modes import Solved
    from rubhpc.kernels.contact_modes import ModeTables
    from rubhpc.kernels.retuning import HeldMode

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]


class HeldModes(ModeLibrary):
    """Contact modes of one set of matrices and one friction, without what a speed renews.

    Parameters
    ----------
    reduced : ReducedModel
        Matrices; its spin and force are those of some speed.
    phasor : (n,), complex
        Unbalance at unit speed, kg m: at the speed W its force is `Re[W^2 phasor exp(i W t)]`, N.
    tick : float, s
    sample_level, n_level : int
        As in `ModeLibrary`; levels stay, the tick changes with the speed.
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
        beside: Sequence[ReducedModel] = (),
        at_place: Callable[[float, float], ReducedModel] | None = None,
        risen: ReducedModel | None = None,
        is_balanced: bool = True,
    ) -> None:
        """Start with every pair open."""
        self.reduced, self._known = reduced, known
        self._is_measured, self._at_place = is_balanced, at_place
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
        self._exponents = {}
        self._held: dict[int, tuple[ModeTables, HeldMode]] = {}  # by the set of closed pairs
        self._strange: set[int] = set()  # modes that cannot be followed
        self._counted: tuple[tuple[int, ...], int] = (), 0  # modes, and their memory, bytes

    @property
    def n_byte(self) -> int:
        """Memory that its contact modes hold."""
        if self._counted[0] != (masks := tuple(self._held)):
            fields = (field for kept in self._held.values() for part in kept for field in part)
            sizes = {
                id(field): field.nbytes
                for field in fields
                if isinstance(field, np.ndarray) and any(field.strides)
            }
            self._counted = masks, sum(sizes.values())
        return self._counted[1]

    def follows(self, mask: int) -> bool:
        """Whether a mode follows the speed, in coordinates that go on from piece to piece."""
        return bool(self._beside) and mask not in self._strange

    def has_strange(self, met: set[int]) -> bool:
        """Whether one of the modes met cannot be followed, and is solved at each piece."""
        return not self._strange.isdisjoint(met)

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
            found = [self._node(mode, library) for library in (*self._beside, *self._risen)]
            nodes, n = [middle, *(node for node in found if node is not None)], 1 + len(self._beside)
            if len(nodes) > len(found):
                risen = nodes[n] if self._risen else None
                entered = entries(nodes[:n], risen)
                if entered.lost <= MOST_LOST:
                    held = followed(nodes[:n], risen, entered, own.seen)
            if held is middle.held:
                self._strange.add(mode.mask)
        self._held[mode.mask] = row, held

    def _node(self, mode: ContactMode, library: HeldModes) -> Node | None:
        """The same mode in another library; None where that has another motion."""
        found = matched(mode, library._solved(mode.mask))
        if found is None:
            return None
        return Node.of(found, library._hold(found, None, library._linear(found)), library._slip_rows())

    def _tabulated(
        self, mode: ContactMode, linear: Linear, row: ModeTables | None = None
    ) -> tuple[ModeTables, HeldMode]:
        """A mode of these matrices with what is renewed of its tables left out."""
        row = row or self._tables_of(mode, self.reduced)
        if not self._is_measured:
            row = with_slip(row, self._slip_rows() @ mode.motion[self.slip.shape[1] :], mode.exponent)
        row = without_renewed(row, len(self._output))
        return row, self._hold(mode, row if self._is_measured else None, linear)

    def _with(self, reduced: ReducedModel) -> Self:
        """A library with other matrices that solves and tabulates as this one does, and holds nothing."""
        other = copy(self)
        other.reduced, other._output = reduced, np.hstack(output_operators(reduced))
        other._beside, other._is_open = [], False
        return other

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
