"""Spin speeds that change: straight lines over the time, and when the shaft reaches an angle."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError
from rubhpc.input.fields import FieldError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]

LAG = 0.003  # rad, by which the shaft may depart from its angle within a piece
PIECES = (16, 12, 8, 6, 4, 3, 2, 1)  # revolutions in a piece
LONGEST_PIECE = PIECES[0]
SAME_SAMPLE = 1e-6  # intervals of samples, within which a bend of the speed is at a sample
MOST_REVOLUTIONS = 100_000  # of a case whose speed changes


@dataclass(frozen=True, kw_only=True)
class SpeedLaw:
    """A spin speed given at some times and linear between them; the shaft's angle is 0 at the first.

    Attributes
    ----------
    time : tuple of float, s
        Rising.
    speed : tuple of float, rad/s
        As many, all positive.

    Raises
    ------
    FieldError
        No shaft follows it, or it turns less than once or more than 100 000 times.
    """

    time: tuple[float, ...]
    speed: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.time) < 2 or len(self.time) != len(self.speed):
            raise FieldError("law", "needs a time and a speed of two points or more; write [[t, speed], ...]")
        if any(a >= b for a, b in itertools.pairwise(self.time)):
            raise FieldError("law", "its times do not rise; put its points in the order of time")
        if min(self.speed) <= 0.0:
            problem = f"{min(self.speed):g} rad/s is out of range"
            raise FieldError("law", f"{problem}; sampling is locked to the shaft, which turns above 0")
        turns = float(self._angle[-1]) / (2.0 * math.pi)
        if turns > MOST_REVOLUTIONS:
            raise FieldError(
                "law",
                f"the shaft turns by {turns:.6g} revolutions, above {MOST_REVOLUTIONS}; give it less time",
            )
        if self.n_revolution < 1:
            raise FieldError("law", f"the shaft turns by {turns:.3g} of a revolution; give it more time")

    @property
    def n_revolution(self) -> int:
        """Whole revolutions."""
        return math.floor(float(self._angle[-1]) / (2.0 * math.pi) * (1.0 + 1e-12))

    @cached_property
    def acceleration(self) -> Floats:
        """Angular acceleration between the points, (n_point - 1,), rad/s^2."""
        return np.diff(self.speed) / np.diff(self.time)

    def at_angle(self, angle: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Time (s), speed (rad/s) and acceleration (rad/s^2) where the shaft has turned by an angle, rad."""
        turned = np.asarray(angle, dtype=np.float64)
        place = np.searchsorted(self._angle[1:-1], turned, side="right")
        ahead = turned - self._angle[place]
        begin, rate = np.array(self.speed)[place], self.acceleration[place]
        speed = np.sqrt(np.maximum(begin**2 + 2.0 * rate * ahead, 0.0))
        # The root of the parabola that does not cancel.
        return np.array(self.time)[place] + 2.0 * ahead / (begin + speed), speed, rate

    def bends(self, per_revolution: int) -> Floats:
        """Where the acceleration changes, in samples of which a revolution has so many, rising."""
        at: Floats = self._angle[1:-1][np.diff(self.acceleration) != 0.0] * per_revolution / (2.0 * math.pi)
        near = np.round(at)
        snapped: Floats = np.where(np.abs(at - near) < SAME_SAMPLE, near, at)
        return snapped

    def between(self, begin: float, end: float) -> slice:
        """The straight lines of the law from one time to another, s, that is later."""
        first = np.searchsorted(self.time[1:-1], begin, side="right")
        return slice(int(first), int(np.searchsorted(self.time[1:-1], end, side="left")) + 1)

    @cached_property
    def _angle(self) -> Floats:
        """Angle at the points, (n_point,), rad."""
        speed = np.array(self.speed)
        return np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(self.time))])


def piece_length(per_revolution: int, pieces_per_revolution: int) -> int:
    """Return the samples of a piece where a revolution is cut into so many equal ones."""
    is_count = isinstance(pieces_per_revolution, int) and pieces_per_revolution >= 1
    if not is_count or per_revolution % pieces_per_revolution:
        problem = f"{pieces_per_revolution} is not a divisor of the {per_revolution} samples in a revolution"
        raise InputError(f"pieces_per_revolution: {problem}; choose another number")
    return per_revolution // pieces_per_revolution


def cut(
    law: SpeedLaw,
    per_revolution: int,
    pieces_per_revolution: int | None = None,
    allowed: Callable[[float, float], float] = lambda _speed, _turns: LAG,
) -> Ints:
    """Cut a law into pieces, each of which is taken at its mean speed.

    Under the acceleration a the shaft's angle departs from that of a steady spin by `a T^2 / 12` over a piece
    of the duration T, which is to be within what is allowed: pieces are of `PIECES` revolutions or of halves,
    quarters ... of one. A bend of the speed lies between two samples, a piece by themselves.

    Parameters
    ----------
    per_revolution : int
        Samples in a revolution; pieces are of whole numbers of them.
    pieces_per_revolution : int, optional
        Cut every revolution into as many, whatever the law.
    allowed : callable, optional
        That lag, rad, at a speed, rad/s, in pieces of so many revolutions; `LAG` if not given.

    Returns
    -------
    (n_piece + 1,)
        Samples between which the pieces lie, from 0 to the end of the last whole revolution.
    """
    n = law.n_revolution
    if pieces_per_revolution is not None:
        length = piece_length(per_revolution, pieces_per_revolution)
        return _around(law.bends(per_revolution), np.arange(n * pieces_per_revolution + 1) * length)
    time, speed, rate = (values.tolist() for values in law.at_angle(2.0 * np.pi * np.arange(n + 1)))
    bends = law.bends(per_revolution)
    corners = (bends / per_revolution).tolist()
    cuts, turn = [0], 0
    while turn < n:
        until = min([n, *(corner for corner in corners if corner > turn)])
        count = next(
            count
            for count in PIECES
            if count == 1
            or (
                turn + count <= until
                and abs(rate[turn]) * (time[turn + count] - time[turn]) ** 2
                <= 12.0 * allowed(speed[turn], count)
            )
        )
        parts = 1
        if count == 1:
            within = law.acceleration[law.between(time[turn], time[turn + 1])]
            lag = float(np.abs(within).max()) * (time[turn + 1] - time[turn]) ** 2 / 12.0
            while lag > allowed(speed[turn], 1.0 / parts) * parts**2 and per_revolution % (2 * parts) == 0:
                parts *= 2
        stride = per_revolution * count // parts
        cuts += range(cuts[-1] + stride, cuts[-1] + per_revolution * count + 1, stride)
        turn += count
    return _around(bends, np.array(cuts))


def _around(bends: Floats, cuts: Ints) -> Ints:
    """Cut also at the samples before and after each bend, as far as the cuts go."""
    near = np.concatenate([np.floor(bends), np.ceil(bends)]).astype(np.int64)
    return np.union1d(cuts, near[near < cuts[-1]])
