"""Extrapolation of a settling motion to its limit, from its last revolutions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

LEAST_SHARE = 1e-6  # of the largest singular value: smaller ones are rounding or nonlinear


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
    change = np.diff(motions, axis=0)
    turned = (change[:-1] - change[-1]).T
    root = np.sqrt(energy)
    weights = np.linalg.lstsq(turned * root[:, None], -change[-1] * root, rcond=LEAST_SHARE)[0]
    return np.asarray(motions[-1] + (motions[1:-1] - motions[-1]).T @ weights)
