"""The contact modes of a reduced model, solved and tabulated when the event-driven march first meets them."""

from __future__ import annotations

import weakref
from copy import copy
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.reduced_model.contact_mode import ContactMode, SlidingPairs, count_coordinates
from rubhpc.integrate.reduced_model.mode_tables import bytes_ahead, energies_of, mode_of, tabulate
from rubhpc.integrate.reduced_model.reduction import ReducedModel, directions
from rubhpc.integrate.reduced_model.table_stack import MOST_BYTES, MOST_MODES, TableStack
from rubhpc.integrate.reduced_model.touching import mode_among, open_bodies
from rubhpc.kernels.contact_modes import LANES, SAMPLES_AT_ONCE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.reduced_model.mode_tables import Energies
    from rubhpc.integrate.reduced_model.system_modes import Solved
    from rubhpc.integrate.reduced_model.touching import OpenBodies
    from rubhpc.kernels import contact_modes as kernel

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]

# Coordinates that a set of several contacts may have beyond any single one. The width is fixed before the
# first case: it determines the order of sums, and thus the last bits of every case.
SPARE = 8
FEW_PAIRS = 5  # with outputs that take little memory
VACANT = -3  # instead of a set of closed contacts: a discarded mode


class ModeLibrary:
    """Contact modes of one speed and friction, solved when first met and shared by all cases.

    Parameters
    ----------
    opened : ContactMode
        The mode with every pair open, which does not depend on friction.
    known : Solved
        The parts of the open set.
    tick : float, s
    sample_level, n_level : int
        Samples are 2^sample_level ticks apart; exponentials are tabulated over 1, 2, ..., 2^(n_level - 1)
        ticks.
    is_measured : bool
        Whether the tables contain slip, outputs and energies, or only what following a motion needs.
    among : OpenBodies, optional
        The bodies with every pair open, where they are known.
    """

    def __init__(
        self,
        reduced: ReducedModel,
        model: Model,
        friction: float,
        *,
        opened: ContactMode,
        known: Solved,
        tick: float,
        sample_level: int,
        n_level: int,
        is_measured: bool = True,
        among: OpenBodies | None = None,
    ) -> None:
        """Start with every pair open; of one pair also with it closed."""
        self.reduced = reduced
        self._take_pairs(model, friction)
        self._tick, self._sample_level = tick, sample_level
        self._n_level = self._n_level_followed = n_level
        self._is_measured = is_measured
        self._opened, self._known = opened, known
        q = len(self.gap_jacobian)
        self._among = open_bodies(reduced, model, opened) if among is None else among
        self.first_masks = [0] if q > 1 else [0, 1]
        modes = [self._solved(mask) for mask in self.first_masks]
        self.width = padded_width(max(mode.exponent.size for mode in modes), q)
        may_be_large, ahead = self._is_measured and self._is_parted, (self._n_ahead, n_level)
        if may_be_large and q > FEW_PAIRS:
            self._n_ahead, self._n_level = 1, sample_level + 1
        rows = [self._tables_of(mode, reduced) for mode in modes]
        if may_be_large:
            self._is_large = self._most_modes * bytes_ahead(rows[0], reduced, *ahead) > MOST_BYTES
        if (self._n_ahead, self._n_level) != ahead and not self._is_large:
            self._n_ahead, self._n_level = ahead
            rows = [self._tables_of(mode, reduced) for mode in modes]
        self._tables = TableStack(1 + q, self._most_modes, MOST_BYTES)
        self.masks = [mode.mask for mode in modes]
        self._exponents: dict[int, Floats] = {}
        self.derived: dict[int, Any] = {}  # derived data of the modes, by mask
        self._chance = np.random.default_rng(0)
        for mode, row in zip(modes, rows, strict=True):
            self._tabulate(mode, row)

    @property
    def followed(self) -> ModeLibrary:
        """Contact modes with which a motion is followed where nothing is recorded.

        Memory holds few large modes. Without slip, outputs and energies it holds more, and twice as much
        memory is allowed: an irregular motion whose modes do not fit solves them repeatedly. A mode in one of
        the two libraries is not solved again for the other.
        """
        if not self._is_large:
            return self
        if self._other is None:
            self._other = made = copy(self)
            made._other = weakref.proxy(self)  # a strong reference would be a cycle, which is freed late
            made._is_measured = made._is_large = False
            made._is_roomy = True
            made._n_solved = 0
            made._n_level = self._n_level_followed
            made._tables = TableStack(1 + len(self.gap_jacobian), 2 * self._most_modes, 2 * MOST_BYTES)
            made.masks, made._exponents, made.derived, made._chance = [], {}, {}, np.random.default_rng(0)
            for mask in self.first_masks:
                made.add(mask)
        return self._other

    @property
    def n_most(self) -> int:
        """Most contact modes that fit."""
        return self._tables.n_most

    @property
    def n_usual(self) -> int:
        """Number of contact modes above which a case meets too many; `n_most` or fewer."""
        if not self._is_roomy:
            return self.n_most
        least, usual = 1 + len(self.gap_jacobian), (MOST_BYTES + MOST_BYTES // 2)
        return max(least, min(self._most_modes, usual // self._tables.n_byte_of_one))

    @property
    def n_byte(self) -> int:
        """Memory of its tables, bytes."""
        return self._tables.n_byte + (self._other._tables.n_byte if self._other else 0)

    @property
    def n_solved(self) -> int:
        """Contact modes solved for these tables and those of `followed`, including repeated ones."""
        return self._n_solved + (self._other._n_solved if self._other else 0)

    @property
    def is_full(self) -> bool:
        """Whether there is no room for another contact mode."""
        return len(self.masks) >= self.n_most

    def add(self, mask: int) -> bool:
        """Solve the mode with these pairs closed; returns whether the tables are wide enough for it."""
        mode = self._other._recovered(mask) if self._other else None
        if mode is None:
            mode = self._solved(mask)
            self._n_solved += 1
        if mode.exponent.size > self.width:
            return False
        if VACANT in self.masks:
            self.masks[self.masks.index(VACANT)] = mask
        else:
            self.masks.append(mask)
        self._tabulate(mode)
        return True

    def _recovered(self, mask: int) -> ContactMode | None:
        """The contact mode with these pairs closed, from its tables; None where it is not in them."""
        if mask not in self.masks:
            return None
        row = self._tables.row(self.masks.index(mask))
        return mode_of(row, self._exponents[mask])

    def make_room(self) -> None:
        """Discard a contact mode other than the initial ones.

        It is chosen at random: a rotor that runs round in a ring returns to the oldest one. A library that
        cannot discard single modes discards all.
        """
        if self._chance is None:
            self.forget()
            return
        if VACANT in self.masks:
            return
        n_first = len(self.first_masks)
        place = int(self._chance.integers(n_first, len(self.masks)))
        self._exponents.pop(self.masks[place])
        self.derived.pop(self.masks[place], None)
        self.masks[place] = VACANT
        self._tables.vacate(place)

    def forget(self) -> None:
        """Make room: keep only the mode with every pair open."""
        self._tables.clear()
        self._exponents.clear()
        self.derived.clear()
        self.masks = [0]
        self._tabulate(self._opened)

    def unmet(self, met: set[int]) -> list[int]:
        """Places in the tables of contact modes that a case has not met."""
        return [place for place, mask in enumerate(self.masks) if mask not in met]

    def tables(self) -> kernel.ModeTables:
        """All contact modes as arrays."""
        tables: kernel.ModeTables = self._tables.view()
        return tables

    def exponents(self, mask: int) -> Floats:
        """Exponents of a mode's coordinates, 1/s: (2, m), real and imaginary."""
        return self._exponents[mask]

    is_tuned_ahead = False  # whether modes are tuned to several pieces of a changing speed together
    _n_solved = 0
    _other: ModeLibrary | None = None  # for large modes: the library for following, or for measuring
    _is_large = False  # memory may not hold all modes
    _is_roomy = False  # whether it holds more modes than a case in closed form needs
    _is_parted = True  # whether large modes have separate tables for following and measuring
    _n_ahead = SAMPLES_AT_ONCE
    _chance: np.random.Generator | None = None
    _most_modes = MOST_MODES
    _is_measured = True

    def _take_pairs(self, model: Model, friction: float) -> None:
        self.gap_jacobian, self.force_direction, self.slip = directions(self.reduced, model, friction)
        self._pairs = SlidingPairs(self.gap_jacobian, self.force_direction)

    def _solved(self, mask: int) -> ContactMode:
        return self._opened if mask == 0 else self._solve(mask)

    def _solve(self, mask: int) -> ContactMode:
        """The mode of a set of closed pairs."""
        return mode_among(self._among, self.reduced, self._pairs, mask, self._known)

    def _energies_of(self, mode: ContactMode) -> Energies:
        """Energies of a mode."""
        friction = self._friction_of(mode)
        if self._among is None:
            return energies_of(mode, self.reduced, friction, self.width)
        closed = self._pairs.closed(mode.mask)
        return self._among.energies(mode, self.reduced, friction, closed, self.width)

    def _friction_of(self, mode: ContactMode) -> Complexes | None:
        """Friction forces on the motion with each coordinate of a mode (n, m), N; None: omitted."""
        return self._pairs.friction_forces(mode)

    def _tabulate(self, mode: ContactMode, row: kernel.ModeTables | None = None) -> None:
        """Add a mode, with its tables if they are known."""
        self._note_exponents(mode)
        self._tables.add(row or self._tables_of(mode, self.reduced))

    def _note_exponents(self, mode: ContactMode) -> None:
        exponent, m = np.zeros((2, self.width)), mode.exponent.size
        exponent[0, :m], exponent[1, :m] = mode.exponent.real, mode.exponent.imag
        self._exponents[mode.mask] = exponent

    def _tables_of(self, mode: ContactMode, reduced: ReducedModel) -> kernel.ModeTables:
        """Tables of one mode."""
        return tabulate(
            mode,
            reduced,
            self.slip,
            energies=self._energies_of(mode) if self._is_measured else None,
            width=self.width,
            tick=self._tick,
            sample_level=self._sample_level,
            n_level=self._n_level,
            is_measured=self._is_measured,
            n_ahead=self._n_ahead,
        )


def padded_width(widest: int, q: int) -> int:
    """Width of tables for modes of q pairs up to this size; for several pairs the size of the open mode.

    Closing a gap removes a degree of freedom. It adds a coordinate only where a vibration becomes two decays.
    """
    return -(-(widest + (SPARE if q > 1 else 0)) // LANES) * LANES


def width_without_modes(reduced: ReducedModel, model: Model, friction: float, n_open: int) -> int:
    """Return the width that the tables of a library would have, which solves no contact mode for it.

    `n_open` is the number of coordinates with every pair open.
    """
    gap_jacobian, force_direction, _ = directions(reduced, model, friction)
    q = len(gap_jacobian)
    if q > 1:
        return padded_width(n_open, q)
    return padded_width(max(n_open, count_coordinates(reduced, gap_jacobian, force_direction, 1)), q)
