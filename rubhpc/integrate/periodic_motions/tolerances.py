"""How exactly periodic motions and their events are found: to rounding, or as steps and ticks allow."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tolerances:
    """Tolerances of motions on branches that are followed in one way.

    Attributes
    ----------
    closed : float
        Residual, over the size of the motion, at which it is periodic.
    enough : float
        The same, where no further step makes it less.
    divides : float
        Distance, over the size, of sections that close after a part of a period.
    derivative : float
        How far from the motion its derivative is found, over the size.
    grain : float
        Part of the size to which a motion that cases share is rounded: searches differ by less.
    rounding : float
        Residual below which a search without progress may go on.
    same : float
        Distance of two motions that are the same, over their size.
    half : float
        Change over half the period, over the size, of a motion that has half the period.
    difference : float
        Of the range, between the two cases of a derivative by the parameter.
    located : float
        Of the range: distance of a point from its event.
    left : float
        Distance of a multiplier outside the unit circle that counts as outside.
    in_plane : float
        Steps, distance of a motion from its plane.
    """

    closed: float
    enough: float
    divides: float
    derivative: float
    grain: float
    rounding: float
    same: float
    half: float
    difference: float
    located: float
    left: float
    in_plane: float


TO_ROUNDING = Tolerances(
    closed=1e-10,
    enough=1e-10,
    divides=1e-7,
    derivative=0.0,
    grain=2.0**-20,
    rounding=1e-8,
    same=1e-6,
    half=1e-7,
    difference=1e-6,
    located=1e-9,
    left=1e-6,
    in_plane=1e-7,
)

# A motion after a revolution jumps by some 1e-8 of its size where an event moves to another tick, and by
# about as much where steps change. What is found from a difference of motions, or from the change of a
# multiplier along a branch, is so much less exact. The difference for a derivative makes the jumps and the
# curvature count alike.
BY_STEPS = Tolerances(
    closed=1e-8,
    enough=1e-6,
    divides=1e-4,
    derivative=1e-5,
    grain=2.0**-14,
    rounding=1e-6,
    same=1e-5,
    half=1e-5,
    difference=1e-4,
    located=1e-6,
    left=1e-4,
    in_plane=1e-5,
)
