"""Contact modes of a penalty and of friction with stick over a range of speeds."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Self

from rubhpc.integrate.changing_speed.mode_courses import NODES
from rubhpc.integrate.changing_speed.range_library import RangeLibrary
from rubhpc.integrate.reduced_model.friction_library import StatesOfPairs
from rubhpc.integrate.reduced_model.mode_library import SPARE
from rubhpc.integrate.reduced_model.penalty_library import PressedPairs
from rubhpc.kernels.contact_modes import LANES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.fem.model import Model
    from rubhpc.integrate.changing_speed.mode_courses import Eigenmodes
    from rubhpc.integrate.reduced_model.friction_mode import FrictionPairs
    from rubhpc.integrate.reduced_model.penalty_mode import Penalty
    from rubhpc.integrate.reduced_model.reduction import ReducedModel


class RangePenaltyLibrary(PressedPairs, RangeLibrary):
    """Contact modes of pairs that press, by spring and damper, or are lifted."""

    def __init__(self, *args: Any, penalty: Penalty, **keys: Any) -> None:
        """Start as `RangeLibrary` does."""
        self._penalty = penalty
        super().__init__(*args, **keys)


class RangeFrictionLibrary(StatesOfPairs, RangeLibrary):
    """Contact modes of pairs that slide in either sense or stick; masks as in `FrictionLibrary`.

    The speed of the rims goes with that of the shaft, also where matrices stay what they are.
    """

    def __init__(self, *args: Any, pairs: FrictionPairs, **keys: Any) -> None:
        """Start as `RangeLibrary` does."""
        self._pairs = pairs
        super().__init__(*args, **keys)

    def eigenmodes(self, mask: int, within: float) -> Eigenmodes | None:
        """As of `RangeLibrary`; None where a pair is closed, since a rim's speed changes what enters."""
        return None if self._closed_pairs(mask) else super().eigenmodes(mask, within)

    def _others(self, beside: Sequence[ReducedModel]) -> list[tuple[ReducedModel, float]]:
        return super()._others(beside or [self.reduced] * (len(NODES) - 1))

    def _with(self, reduced: ReducedModel, place: float = 0.0) -> Self:
        other = super()._with(reduced, place)
        share = 1.0 + place * self._reach / self._spin
        other._pairs = replace(self._pairs, rim_speed=self._pairs.rim_speed * share)
        return other

    def _width_of(self, model: Model, friction: float) -> int:
        return -(-(self._opened.exponent.size + SPARE) // LANES) * LANES
