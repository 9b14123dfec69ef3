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

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]

MOST_FRICTION_MODES = 1024  # sets of states of one speed and friction: up to four for each of closed pairs


class StatesOfPairs(ModeLibrary):
    """Modes of pairs that slide in either sense or stick; under a penalty with its springs and dampers."""

    _most_modes = MOST_FRICTION_MODES
    _pairs: FrictionPairs

    def _solve(self, mask: int) -> ContactMode:
        return friction_mode_among(self._among, self.reduced, self._pairs, mask, self._known)

    def _closed_pairs(self, mask: int) -> list[int]:
        return self._pairs.closed(mask)

    def _damped(self, mask: int) -> ReducedModel:
        return self._pairs.damped(self.reduced, mask) if self._pairs.stiffness else self.reduced

    def _springs(self, mask: int) -> tuple[float, list[int]]:
        return self._pairs.stiffness, self._pairs.closed(mask) if self._pairs.stiffness else []

    def _slip_rows(self) -> Floats:
        return self.slip[:0]

    def _friction_of(self, mode: ContactMode) -> Complexes | None:
        assert isinstance(mode, FrictionMode)
        return mode.friction_forces(self._pairs)


class FrictionLibrary(StatesOfPairs):
    """Contact modes of pairs that slide in either sense or stick; masks have two bits per pair.

    Under a penalty they have a third bit, and its springs and dampers count as in `PenaltyLibrary`.
    """

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
