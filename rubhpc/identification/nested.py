"""Nested sampling by dynesty: the posterior of a hypothesis, and its evidence.

J. S. Speagle, Monthly Notices of the Royal Astronomical Society 493, 2020. Points are proposed and evaluated
in queues of a fixed length, so that the result is the same for any number of processes.
"""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rubhpc.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from numpy.typing import NDArray

    from rubhpc.identification.evaluation import Shared

    Floats = NDArray[np.float64]

_QUEUE = 8
_SPARSE = 30.0  # per cent of the points that are accepted, below which they are drawn within bounds
_PRECISION = 0.1  # of ln(evidence) that is left when the sampling ends
MOST = 1000  # evaluations a live point: a rough likelihood, as of a chaotic machine, has no end of peaks


class Sampled(NamedTuple):
    """Points of a run of nested sampling."""

    values: Floats  # (n_point, n_value)
    log_weights: Floats  # (n_point,), of the posterior, whose sum is 1
    log_volumes: Floats  # (n_point,), shares of the prior, whose sum is 1
    log_likelihoods: Floats  # (n_point,)
    log_evidence: float
    error: float  # standard error of the logarithm
    n_call: int
    is_whole: bool = True  # it ended by itself

    def draws(self, count: int, seed: int) -> NDArray[np.intp]:
        """Return the positions of so many equally likely draws."""
        shares = np.cumsum(np.exp(self.log_weights))
        rng = np.random.default_rng(seed)
        at = (np.arange(count) + rng.random()) / count  # systematic resampling
        return np.minimum(np.searchsorted(shares / shares[-1], at), shares.size - 1)

    @property
    def effective(self) -> float:
        """Effective number of draws (Kish)."""
        weights = np.exp(self.log_weights)
        return float(weights.sum() ** 2 / (weights**2).sum())


class Alone:
    """Maps functions in this process."""

    size = 1

    def map(self, function: Callable[[Any], Any], items: Iterable[Any]) -> list[Any]:
        """Return the values of a function."""
        return [function(item) for item in items]


def require_sampler() -> None:
    """Refuse to begin without dynesty."""
    try:
        import dynesty  # noqa: F401
    except ImportError:
        raise InputError(
            "identify: needs the package dynesty; install it with pip install 'rubhpc[identify]'"
        ) from None


def sample(
    likelihood: Callable[[Floats], float],
    values_at: Callable[[Floats], Floats],
    n_value: int,
    *,
    mapper: Alone | Shared,
    live: int,
    seed: int,
    most: int = MOST,
    say: Callable[[int, float, float], None] = lambda n_call, log_evidence, left: None,
) -> Sampled:
    """Return the points of a distribution.

    Parameters
    ----------
    likelihood : callable
        Of values (n_value,), its logarithm; minus infinity where there are none.
    values_at : callable
        Of a point of the unit cube.
    n_value : int
    mapper : Alone or Shared
        Evaluates them.
    live : int
        Live points.
    seed : int
    most : int
        Evaluations a live point, after which the sampling is ended.
    say : callable
        Called with the number of evaluations, the logarithm of the evidence, and how much is left of it.
    """
    if n_value == 0:
        only = likelihood(np.zeros(0))
        point = np.zeros((1, 0)), np.zeros(1), np.zeros(1), np.array([only])
        return Sampled(*point, log_evidence=only, error=0.0, n_call=1)
    from dynesty import NestedSampler

    def report(found: Any, iteration: int, n_call: int, **_: Any) -> None:
        say(n_call, float(found.logz), float(found.delta_logz))

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            sampler = NestedSampler(
                likelihood,
                values_at,
                n_value,
                nlive=live,
                bound="multi",
                rstate=np.random.default_rng(seed),
                pool=mapper,
                queue_size=_QUEUE,
                first_update={"min_eff": _SPARSE},
            )
        except RuntimeError:
            raise InputError("identify: no case of the prior can be computed; narrow the priors") from None
        sampler.run_nested(dlogz=_PRECISION, maxcall=most * live, print_progress=True, print_func=report)
    found = sampler.results
    before = np.concatenate([[0.0], found.logvol[:-1]])
    volumes = np.exp(before) - np.exp(found.logvol)
    log_volumes = np.log(np.maximum(volumes, np.finfo(float).tiny))
    return Sampled(
        values=found.samples,
        log_weights=found.logwt - np.logaddexp.reduce(found.logwt),
        log_volumes=log_volumes - np.logaddexp.reduce(log_volumes),
        log_likelihoods=found.logl,
        log_evidence=float(found.logz[-1]),
        error=float(found.logzerr[-1]) if math.isfinite(found.logzerr[-1]) else 0.0,
        n_call=(n_call := int(np.sum(found.ncall))),
        is_whole=n_call <= most * live,
    )
