"""Extrapolation of a settling motion to its limit, from its last revolutions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.lapack import dgelsy

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

LEAST_SHARE = 1e-6  # of the largest singular value: smaller ones, as estimated, are rounding or nonlinear


def extrapolated(motions: Floats, energy: Floats) -> Floats:
    """Return the fixed point of the linear map that takes each of k motions (k, 2 n) to the next, (2 n,).

    Reduced rank extrapolation (Eddy 1979, Mesina 1977): the combination of motions, with weights that sum to
    one, whose change under the map is least, mapped once. It is exact where the motions contain k - 2 modes
    of the map or fewer. A single motion is returned unchanged.

    Parameters
    ----------
    energy : (2 n,)
        Weights of the squares by which changes are compared.
    """
    if len(motions) < 3:
        return np.asarray(motions[-1])
    change = motions[1:] - motions[:-1]
    root = np.sqrt(energy)
    turned = ((change[:-1] - change[-1]) * root).T
    (m, k), last = turned.shape, np.zeros((max(turned.shape), 1))
    last[:m, 0] = -change[-1] * root
    free = np.zeros(k, dtype=np.int32)  # columns that may be exchanged: all
    room = max(m, 5) * k  # LAPACK asks for 4 k + 1 where there are fewer rows than columns
    weights = dgelsy(turned, last, free, LEAST_SHARE, room)[1][:k, 0]
    return np.asarray(motions[-1] + (motions[1:-1] - motions[-1]).T @ weights)
