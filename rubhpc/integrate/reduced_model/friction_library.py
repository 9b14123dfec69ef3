"""The contact modes of a reduced model under set-valued friction."""

from __future__ import annotations

from typing import TYPE_CHECKING, Unpack

from rubhpc.integrate.reduced_model.friction_mode import FrictionMode
from rubhpc.integrate.reduced_model.mode_library import SPARE, ModeLibrary, Shared
from rubhpc.integrate.reduced_model.touching import friction_mode_among
from rubhpc.kernels.contact_modes import LANES
from rubhpc.kernels.friction_states import FORWARD

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.integrate.reduced_model.friction_mode import FrictionPairs
    from rubhpc.integrate.reduced_model.reduction import ReducedModel
    from rubhpc.kernels.contact_modes import ModeTables

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]

MOST_FRICTION_MODES = 1024  # sets of states of one speed and friction: up to four for each of closed pairs


class FrictionLibrary(ModeLibrary):
    """Contact modes of pairs that slide in either sense or stick; masks have two bits per pair.

    Under a penalty they have a third bit, and its springs and dampers count as in `PenaltyLibrary`.
    """

    _most_modes = MOST_FRICTION_MODES

    def __init__(
        self,
        reduced: ReducedModel,
        model: Model,
        pairs: FrictionPairs,
        **shared: Unpack[Shared],
    ) -> None:
        """Start as `ModeLibrary` does, with one pair sliding forward."""
        self._pairs = pairs
        super().__init__(reduced, model, pairs.friction, **shared)

    _closed = FORWARD

    def _width(self, sizes: list[int]) -> int:
        return -(-(max(sizes) + SPARE) // LANES) * LANES

    def _solved(self, mask: int) -> ContactMode:
        if mask == 0:
            return self._opened
        return friction_mode_among(self._among, self.reduced, self._pairs, mask, self._known)

    def _closed_pairs(self, mask: int) -> list[int]:
        return self._pairs.closed(mask)

    def _tables_of(self, mode: ContactMode, reduced: ReducedModel) -> ModeTables:
        if not self._pairs.stiffness or not self._is_measured:
            return super()._tables_of(mode, reduced)
        tables = super()._tables_of(mode, self._pairs.damped(reduced, mode.mask))
        tables.loss[0] += self._pairs.stored_energy(mode, self.width)
        return tables

    def _slip_rows(self) -> Floats:
        return self.slip[:0]

    def _friction_of(self, mode: ContactMode) -> Complexes | None:
        assert isinstance(mode, FrictionMode)
        return mode.friction_forces(self._pairs)
