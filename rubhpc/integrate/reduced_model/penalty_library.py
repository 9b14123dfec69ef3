"""The contact modes of a reduced model under a penalty."""

from __future__ import annotations

from typing import TYPE_CHECKING, Unpack

from rubhpc.integrate.reduced_model.mode_library import ModeLibrary, Shared
from rubhpc.integrate.reduced_model.touching import penalty_mode_among

if TYPE_CHECKING:
    from rubhpc.fem.model import Model
    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.integrate.reduced_model.penalty_mode import Penalty
    from rubhpc.integrate.reduced_model.reduction import ReducedModel
    from rubhpc.kernels.contact_modes import ModeTables


class PressedPairs(ModeLibrary):
    """Part of a penalty in tables of contact modes: loss of dampers and energy of springs."""

    _penalty: Penalty

    def _closed_pairs(self, mask: int) -> list[int]:
        return self._penalty.pressed(mask)

    def _tables_of(self, mode: ContactMode, reduced: ReducedModel) -> ModeTables:
        if not self._is_measured:
            return super()._tables_of(mode, reduced)
        tables = super()._tables_of(mode, self._penalty.damped(reduced, mode.mask))
        tables.loss[0] += self._penalty.stored_energy(mode, self.width)
        return tables


class PenaltyLibrary(PressedPairs):
    """Contact modes of pairs that are pressed, by spring and damper, or lifted; masks have q bits for each.

    The loss by damping includes that of the dampers and the energy of the springs.
    """

    def __init__(
        self,
        reduced: ReducedModel,
        model: Model,
        friction: float,
        *,
        penalty: Penalty,
        **shared: Unpack[Shared],
    ) -> None:
        """Start as `ModeLibrary` does."""
        self._penalty = penalty
        super().__init__(reduced, model, friction, **shared)

    def _solved(self, mask: int) -> ContactMode:
        return penalty_mode_among(self._among, self.reduced, self._penalty, self._opened, mask, self._known)
