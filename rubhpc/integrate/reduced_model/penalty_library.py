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


class PressedPairs(ModeLibrary):
    """Modes of pairs that are pressed, by spring and damper, or lifted; with their losses and energies."""

    _penalty: Penalty

    def _closed_pairs(self, mask: int) -> list[int]:
        return self._penalty.pressed(mask)

    def _solve(self, mask: int) -> ContactMode:
        if mask == 0:
            return super()._solve(0)
        return penalty_mode_among(self._among, self.reduced, self._penalty, self._opened, mask, self._known)

    def _damped(self, mask: int) -> ReducedModel:
        return self._penalty.damped(self.reduced, mask)

    def _springs(self, mask: int) -> tuple[float, list[int]]:
        return self._penalty.stiffness, self._penalty.pressed(mask)


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
