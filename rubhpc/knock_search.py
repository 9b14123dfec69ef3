"""The search for the least impulse that leads to rub, in any of some directions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

_RATIO = 1.25  # of one impulse tried to the one before


class Direction(NamedTuple):
    """Where a knock acts: angle from straight up, rad, and node, or None for the output node."""

    angle: float
    node: int | None


@dataclass(frozen=True, kw_only=True)
class Found:
    """The least knock.

    Attributes
    ----------
    impulse : float
        The smallest that leads to rub, N s; NaN where none does.
    harmless : float
        The largest below it of which no direction leads to rub, as far as it was tried, N s.
    direction : Direction or None
        Of the smallest.
    n_tried : int
        Knocks computed.
    """

    impulse: float
    harmless: float
    direction: Direction | None
    n_tried: int


def find_least(
    leads_to_rub: Callable[[float, Direction], bool],
    directions: Sequence[Direction],
    low: float,
    high: float,
    tolerance: float,
) -> Found:
    """Return the least impulse that leads to rub in any of some directions.

    Each impulse tried is a quarter larger than the one before, so that a narrower range of them that leads
    to rub may be passed over. The step to the first that does is then bisected, in the directions that did.

    Parameters
    ----------
    leads_to_rub : callable
        Of impulse, N s, and direction.
    low, high : float, N s
        First and last impulse.
    tolerance : float
        Relative width of the interval that is left.
    """
    n_tried, harmless, impulse = 0, 0.0, low
    while True:
        rubbing = [d for d in directions if leads_to_rub(impulse, d)]
        n_tried += len(directions)
        if rubbing:
            break
        harmless = impulse
        if impulse >= high:
            return Found(impulse=math.nan, harmless=harmless, direction=None, n_tried=n_tried)
        impulse = min(impulse * _RATIO, high)
    while impulse - harmless > tolerance * impulse:
        middle = 0.5 * (impulse + harmless)
        nearer = [d for d in rubbing if leads_to_rub(middle, d)]
        n_tried += len(rubbing)
        if nearer:
            impulse, rubbing = middle, nearer
        else:
            harmless = middle
    return Found(impulse=impulse, harmless=harmless, direction=rubbing[0], n_tried=n_tried)
