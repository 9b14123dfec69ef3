"""Features of all cases of a prior by interpolation: polynomials over a grid of Chebyshev points.

Many posteriors of one study can share its cases. Where the motion is smooth over the whole prior some hundred
cases give all others; where it is not the error at trial points shows that.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from rubhpc.identification.comparison import Seen
from rubhpc.identification.priors import at_shares

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.identification.candidates import Rub

    Floats = NDArray[np.float64]

_POINTS = {1: 32, 2: 16, 3: 8}  # a key, by the number of open keys
_TRIALS = 8  # points at which the error is looked at
_SMALL = 0.05  # of the noise: an error that does not count


class Interpolated:
    """Features over the unit cube of the priors of a rub.

    Parameters
    ----------
    rub : Rub
        Whose cases are computed, 512 at most.

    Attributes
    ----------
    error : (n_channel, n_feature)
        Largest error at trial points; infinite where a case fails or there are more than three open keys.
    """

    def __init__(self, rub: Rub) -> None:
        self._rub = rub
        n_key = len(rub.priors)
        self._n = _POINTS.get(n_key, 0)
        self.error: Floats = np.full(rub.comparison.measured.values.shape, np.inf)
        points = np.cos(np.pi * (np.arange(self._n) + 0.5) / max(self._n, 1))
        found = [self._case(0.5 * (np.array(at) + 1.0)) for at in itertools.product(points, repeat=n_key)]
        if not self._n or any(seen is None for seen in found):
            return
        factors = np.stack([np.concatenate([s.values, s.variance]) for s in found if s is not None])
        factors = factors.reshape(*[self._n] * n_key, *factors.shape[1:])
        inverse = np.linalg.inv(chebvander(points, self._n - 1))
        for axis in range(n_key):
            factors = np.moveaxis(np.tensordot(inverse, factors, (1, axis)), 0, axis)
        self._factors = factors
        trials = np.random.default_rng(1).random((_TRIALS, n_key))
        known = [self._case(shares) for shares in trials]
        if all(seen is not None for seen in known):
            apart = [np.abs(s.values - self(at).values) for s, at in zip(known, trials, strict=True) if s]
            self.error = np.max(apart, axis=0)

    def _case(self, shares: Floats) -> Seen | None:
        return self._rub.outcome(at_shares(self._rub.priors, shares).tolist()).seen

    def serves(self, measured: Seen) -> bool:
        """Whether the error does not count beside the noise of a record."""
        return bool((self.error <= _SMALL * np.sqrt(measured.variance)).all())

    def __call__(self, shares: Floats) -> Seen:
        """Return the features at a point of the unit cube."""
        found = self._factors
        for row in chebvander(2.0 * shares - 1.0, self._n - 1):
            found = np.tensordot(row, found, (0, 0))
        values, variance = np.split(found, 2)
        return Seen(values, np.maximum(variance.real, 0.0))
