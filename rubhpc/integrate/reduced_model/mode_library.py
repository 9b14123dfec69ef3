"""The contact modes of a reduced model, solved and tabulated when the event-driven march first meets them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.reduced_model.contact_mode import ContactMode, SlidingPairs
from rubhpc.integrate.reduced_model.mode_tables import energies_of, tabulate
from rubhpc.integrate.reduced_model.reduction import ReducedModel, directions
from rubhpc.integrate.reduced_model.table_stack import TableStack
from rubhpc.integrate.reduced_model.touching import mode_among, open_bodies
from rubhpc.kernels.contact_modes import LANES, SAMPLES_AT_ONCE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.reduced_model.touching import OpenBodies
    from rubhpc.kernels import contact_modes as kernel

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]

# Coordinates that a set of several contacts may have beyond any single one. The width is fixed before the
# first case: it determines the order of sums, and thus the last bits of every case.
SPARE = 8
FEW_PAIRS = 5  # with outputs of several samples ahead, which would be a third of the memory of larger tables


class ModeLibrary:
    """Contact modes of one speed and friction, solved when first met and shared by all cases.

    Parameters
    ----------
    opened : ContactMode
        The mode with every pair open, which does not depend on friction.
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
        tick: float,
        sample_level: int,
        n_level: int,
        is_measured: bool = True,
        among: OpenBodies | None = None,
    ) -> None:
        """Start with every pair open; of one pair also with it closed."""
        self.reduced = reduced
        self._take_pairs(model, friction)
        self._tick, self._sample_level, self._n_level = tick, sample_level, n_level
        if len(self.gap_jacobian) > FEW_PAIRS:
            self._n_ahead, self._n_level = 1, sample_level + 1
        self._is_measured = is_measured
        self._opened = opened
        self._among = open_bodies(reduced, model, opened) if among is None else among
        modes = self._first_modes()
        self._tables = TableStack(1 + len(self.gap_jacobian))
        self.masks: list[int] = []
        self._exponents: dict[int, Floats] = {}
        self.derived: dict[int, Any] = {}  # derived data of the modes, by mask
        for mode in modes:
            self._tabulate(mode)

    @property
    def n_most(self) -> int:
        """Most contact modes that fit."""
        return self._tables.n_most

    @property
    def n_byte(self) -> int:
        """Memory of its tables, bytes."""
        return self._tables.n_byte

    @property
    def is_full(self) -> bool:
        """Whether there is no room for another contact mode."""
        return len(self.masks) >= self.n_most

    def add(self, mask: int) -> bool:
        """Solve the mode with these pairs closed; returns whether the tables are wide enough for it."""
        mode = self._solved(mask)
        self.n_solved += 1
        if mode.exponent.size > self.width:
            return False
        self._tabulate(mode)
        return True

    def forget(self) -> None:
        """Make room: keep only the mode with every pair open.

        A case that has still to go on with the tables of before keeps them.
        """
        self._tables = TableStack(1 + len(self.gap_jacobian))
        self.derived.clear()
        self.masks.clear()
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

    n_solved = 0  # contact modes solved, including repeated ones
    _n_ahead = SAMPLES_AT_ONCE

    def _take_pairs(self, model: Model, friction: float) -> None:
        self.gap_jacobian, self.force_direction, self.slip = directions(self.reduced, model, friction)
        self._pairs = SlidingPairs(self.gap_jacobian, self.force_direction)

    def _first_modes(self) -> list[ContactMode]:
        """Solve the initial modes, whose size gives the width of all tables."""
        q = len(self.gap_jacobian)
        self.first_masks = [0] if q > 1 else [0, 1]
        modes = [self._solved(mask) for mask in self.first_masks]
        self.width = padded_width(max(mode.exponent.size for mode in modes), q)
        return modes

    def _solved(self, mask: int) -> ContactMode:
        return self._opened if mask == 0 else self._solve(mask)

    def _solve(self, mask: int) -> ContactMode:
        """The mode of a set of closed pairs."""
        return mode_among(self._among, self.reduced, self._pairs, mask)

    def _friction_of(self, mode: ContactMode) -> Complexes:
        """Friction forces on the motion with each coordinate of a mode (n, m), N."""
        return self._pairs.friction_forces(mode)

    def _tabulate(self, mode: ContactMode) -> None:
        self.masks.append(mode.mask)
        self._note_exponents(mode)
        self._tables.add(self._tables_of(mode, self.reduced))

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
            energies=energies_of(mode, self.reduced, self._friction_of(mode), self.width)
            if self._is_measured
            else None,
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
