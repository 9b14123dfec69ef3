"""How far a case is from a stable periodic motion, in a norm that falls as the case draws near."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.lapack import dgeev

from rubhpc.kernels.linear_theory import Theory, fill_theory

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion

    Floats = NDArray[np.float64]

THERE = 1e-8  # of the motion's size: a case as near as that has arrived
TICKS = 4  # times what a point of the orbit turns in the resolution of events: nearer no simulation comes


def nothing(setup: ModalSetup) -> float:
    """Distance of a case from a motion, over the size of that, at which it has arrived."""
    return max(THERE, TICKS * abs(setup.spin) * setup.tick)


class Approach:
    """How far a motion is from a stable periodic one, in a norm that falls while the distance is small.

    Its square is `d'P d` with `P = sum over k of (M^k)'W M^k`: the sum over all periods to come of the energy
    of the disturbance d, where M is the monodromy matrix and W the energy's. It falls by `d'W d` in a period.

    Attributes
    ----------
    theory : Theory
        The monodromy matrix, as far as anything is left of a disturbance after one period.
    is_stable : bool
        Whether the sum exists: all multipliers lie within the unit circle.

    Parameters
    ----------
    monodromy : (2 n, 2 n)
    energy : (2 n,)
        Diagonal of W.
    scale : (2 n,), optional
        What components are multiplied with, to be compared with one another.
    """

    def __init__(self, monodromy: Floats, energy: Floats, scale: Floats | None = None) -> None:
        """Sum the energies of all periods."""
        m = energy.size
        rooms = np.empty((8, m, m))
        weights = np.sqrt(energy) if scale is None else scale
        rank, self.is_stable = fill_theory(monodromy, weights, energy, rooms)
        self.theory = Theory(
            rooms[0, :rank].copy(),
            rooms[1, :rank].copy(),
            rooms[2, :rank, :rank].copy(),
            rooms[3, :rank, :rank].copy(),
        )
        self._energy = energy

    @classmethod
    def to(cls, piecewise: PiecewiseMotion, monodromy: Floats) -> Approach:
        """Distances from a motion of a case with this monodromy matrix."""
        square, pace = piecewise.setup.spin**2, piecewise.bodies.stiffness.diagonal()
        scale = np.ones(2 * piecewise.n)
        np.sqrt(np.maximum(pace, square), out=scale[: piecewise.n])
        return cls(monodromy, piecewise.energy, scale)

    @cached_property
    def multiplier(self) -> complex:
        """The largest; of a pair either."""
        if self.theory.onward.size == 0:
            return 0j
        real, imag, *_ = dgeev(self.theory.onward, compute_vl=0, compute_vr=0)
        k = int((real**2 + imag**2).argmax())
        return complex(real[k], imag[k])

    def square(self, apart: Floats) -> float:
        """Square of the distance (2 n,)."""
        read = self.theory.reading @ apart
        return float(apart**2 @ self._energy + read @ self.theory.sums @ read)

    def squares(self, apart: Floats) -> list[float]:
        """Squares of k distances (k, 2 n)."""
        read = apart @ self.theory.reading.T
        later = ((read @ self.theory.sums) * read).sum(axis=1)
        found: list[float] = (apart**2 @ self._energy + later).tolist()
        return found
