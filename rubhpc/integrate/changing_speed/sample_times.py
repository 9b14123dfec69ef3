"""Samples at fixed angles of a shaft whose speed changes within a piece.

A piece is sampled at even times. At the acceleration a the shaft then lags the even angles by up to
`a T^2 / 8`, and reaches them later.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rubhpc.kernels.resampling import resample

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]


def bring_to_angles(whole: Floats, swing: Floats, cuts: Ints, n_place: int) -> None:
    """Resample (`Samples.whole`) at the intended angles of the shaft, in place.

    Contact forces, which are means over the intervals, are not changed.

    Parameters
    ----------
    swing : (n_piece,)
        Change of the speed over each piece, over the sum of its first and its last speed.
    cuts : (n_piece + 1,)
        Samples between which the pieces lie.
    """
    if swing.any():
        first_force = 4 + 2 * n_place
        resample(whole[:first_force], swing, cuts)
        resample(whole[first_force + n_place :], swing, cuts)
