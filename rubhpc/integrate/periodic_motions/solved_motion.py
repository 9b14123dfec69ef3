"""A periodic motion that was solved for, the linear theory of cases near it, and its record.

Cases that lead to the same motion share them. It is solved for once more from rounded numbers, so that it has
the same bits whatever case has led to it.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from functools import cached_property
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from rubhpc.integrate.measuring.regimes import known_regime
from rubhpc.integrate.periodic_motions.approach import Approach

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.measuring.regimes import Verdict
    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.periodic_motions.collocated_motion import FollowedMotion
    from rubhpc.integrate.periodic_motions.shooting import Orbit
    from rubhpc.integrate.record import Record

    Floats = NDArray[np.float64]

LOOK = 4  # revolutions from one look at the distance of a case to the next, or a period if that is longer
MOST_KEPT = 16  # motions of one operating point


class SolvedMotion:
    """A periodic motion, and the linear theory about it.

    Attributes
    ----------
    approach : Approach
        Distances from it.
    n_period : int
        Periods from one look at the distance of a case to the next.
    record : (Record, int) or None
        Its record, once there is one, and the steps of that.
    """

    def __init__(self, followed: FollowedMotion, orbit: Orbit) -> None:
        self.orbit, self.period = orbit, orbit.period
        self.approach = Approach(orbit.monodromy, followed.energy)
        self.n_period = max(1, LOOK // orbit.period)
        self.record: tuple[Record, int] | None = None

    @property
    def is_doubled(self) -> bool:
        """Whether it is unstable, and the largest disturbance changes sides in every period."""
        return not self.approach.is_stable and self.orbit.multipliers[0].real < -1.0

    @cached_property
    def to_next_look(self) -> Floats:
        """Derivative of the motion at a look by that at the one before, (2 n, 2 n)."""
        return np.linalg.matrix_power(self.orbit.monodromy, self.n_period)

    def judge(
        self, _vertical: Floats, _horizontal: Floats, _per_revolution: int, is_contact: bool
    ) -> Verdict:
        """Judge its record, whatever the orbit."""
        return known_regime(self.period, self.orbit.multipliers[0], is_contact=is_contact)


class SolvedMotions:
    """Motions of one operating point of a set-up, the latest ones."""

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[int, int, bytes], SolvedMotion] = OrderedDict()

    def __len__(self) -> int:
        return len(self._kept)

    def of(
        self,
        followed: FollowedMotion,
        orbit: Orbit,
        shoot_from: Callable[[Floats, int, int], Orbit],
    ) -> SolvedMotion:
        """Return the motion that was solved for, as any case that leads to it gets it.

        Parameters
        ----------
        shoot_from : callable
            Solves for the motion near a beginning (2 n,), with the pairs in these states, of a period.
        """
        begun = rounded(orbit.motion, followed)
        key = orbit.period, orbit.states, begun.tobytes()
        if key not in self._kept:
            self._kept[key] = SolvedMotion(followed, shoot_from(begun, orbit.states, orbit.period))
            if len(self._kept) > MOST_KEPT:
                self._kept.popitem(last=False)
        self._kept.move_to_end(key)
        return self._kept[key]


def rounded(motion: Floats, followed: FollowedMotion) -> Floats:
    """A motion (2 n,), rounded to a power of two, `Tolerances.grain` of its size."""
    grain = followed.tolerances.grain * 2.0 ** math.frexp(followed.size(motion))[1]
    unit = grain / np.sqrt(followed.energy)
    return np.asarray(np.round(motion / unit) * unit + 0.0)  # no negative zeros: bytes are compared


_KEPT: WeakKeyDictionary[ModalSetup, tuple[object, SolvedMotions]] = WeakKeyDictionary()


def solved_motions(setup: ModalSetup, point: object) -> SolvedMotions:
    """Motions of an operating point of a set-up: those of its last one are kept."""
    if setup not in _KEPT or _KEPT[setup][0] != point:
        _KEPT[setup] = point, SolvedMotions()
    return _KEPT[setup][1]
