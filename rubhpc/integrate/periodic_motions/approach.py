"""How far a case is from a stable periodic motion, in a norm that falls as the case draws near."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

MOST_SQUARINGS = 60  # of the monodromy matrix, until nothing is left of it
NEUTRAL = 1e12  # times the energy of the first period, in all periods: what does not decay


class Approach:
    """How far a motion is from a stable periodic one, in a norm that falls while the distance is small.

    Its square is `d'P d` with `P = sum over k of (M^k)'W M^k`: the sum over all periods to come of the energy
    of the disturbance d, where M is the monodromy matrix and W the energy's. It falls by `d'W d` in a period.

    Attributes
    ----------
    is_stable : bool
        Whether the sum exists: all multipliers lie within the unit circle.

    Parameters
    ----------
    monodromy : (2 n, 2 n)
    energy : (2 n,)
        Diagonal of W.
    """

    def __init__(self, monodromy: Floats, energy: Floats) -> None:
        """Sum the energies of all periods: twice as many by each squaring of the matrix."""
        root = np.sqrt(energy)
        power = root[:, np.newaxis] * monodromy / root  # in which W is the identity
        sums = np.eye(energy.size)
        first = float(energy.size)
        self.is_stable = False
        for _ in range(MOST_SQUARINGS):
            added = power.T @ sums @ power
            sums += added
            if not np.trace(sums) <= NEUTRAL * first:
                break
            if np.trace(added) <= np.finfo(float).eps * np.trace(sums):
                self.is_stable = True
                break
            power = power @ power
        self._sums = root[:, np.newaxis] * sums * root

    def squares(self, apart: Floats) -> Floats:
        """Squares of k distances (k, 2 n), (k,)."""
        found: Floats = ((apart @ self._sums) * apart).sum(axis=1)
        return found
