"""What enters the eigenmodes of a contact mode, at any speed of the shaft."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


class Eigenmodes(NamedTuple):
    """Eigenmodes of a set of closed pairs, m of them, which no speed changes."""

    exponent: Complexes  # (m,), 1/s
    is_pair: NDArray[np.bool_]  # (m,)
    motion: Complexes  # (2 n, m)
    enter: Complexes  # (m, 2 n)
    constant: Complexes  # (c, m), for a unit of each coordinate that does not move
    drive: Complexes  # (m,), by the unbalance at unit speed
    mirrored_drive: Complexes  # (m,)

    def entered(
        self, motion: Floats, constants: Floats, turning: complex, factor: complex, time: float
    ) -> Complexes:
        """Coordinates (m,) of a motion (2 n,) at a time, s.

        `turning` (1/s) is the exponent of the unbalance force, `factor` (1/s^2) that of the unbalance at unit
        speed at time 0.
        """
        direct = self.drive * factor / (turning - self.exponent)
        mirrored = self.mirrored_drive * factor / (turning - self.exponent.conj())
        other = np.where(self.is_pair, mirrored, direct).conj()
        turned = np.exp(turning * time)
        response = 0.5 * (direct * turned + other * turned.conj())
        coordinates: Complexes = self.enter @ motion - constants @ self.constant - response
        return coordinates
