"""How often rub indicators distinguish rub from no rub, each alone and all together."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from postproc.signals.indicators import INDICATORS
from postproc.store.axes import refusal
from rubhpc.errors import InputError
from rubhpc.schema import DONE, REGIME

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

TOGETHER = "all_together"
_LEAST = 10  # cases of each kind in either half, to learn from and to judge by


def judge(scores: xr.Dataset, false_alarm: float = 0.05, seed: int = 1) -> xr.Dataset:
    """Return every case's verdict, and how often it is right.

    The cases are split at random into halves, and each half is judged with thresholds of the other: from its
    cases without contact come the mean and the standard deviation of each indicator, and its threshold, which
    a share `false_alarm` of them passes. All indicators together are taken by Fisher's method: the sum of
    `-ln p`, with `p` the probability that an indicator is as high without contact, from a normal distribution
    of that mean and deviation.

    Parameters
    ----------
    scores : Dataset
        From `indicator_scores`.
    false_alarm : float
        Between 0 and 1.
    seed : int
        Of the halves.

    Returns
    -------
    Dataset
        Over (indicator, level): `detection_rate` (of the cases that touch), `false_alarm_rate` (of those that
        do not) and `area_under_curve` (the probability that a case which touches scores higher than one that
        does not; the mean of both halves). Over (indicator, axes, level): `verdict`, the share of the draws
        in which rub is detected. Over the axes: `rub`. Over (axes, level, draw): the indicators.

    Raises
    ------
    InputError
        There are too few cases without contact, or none that touches.
    """
    if not 0 < false_alarm < 1:
        raise InputError(f"false_alarm: {false_alarm:g} is out of range; it must lie between 0 and 1")
    axes = tuple(str(d) for d in scores["rub"].dims)
    rub = scores["rub"].values
    score = scores[list(INDICATORS)].to_dataarray("indicator").compute()
    values = score.transpose("indicator", *axes, "level", "draw").values
    done = np.isfinite(values).all(axis=(0, -2, -1))
    halves = _halves(scores, rub, done, seed)
    names = [*INDICATORS, TOGETHER]
    is_detected = np.full((len(names), *values.shape[1:]), math.nan)
    areas = np.zeros((2, len(names), values.shape[-2]))
    for i_half, (learnt, judged) in enumerate((halves, halves[::-1])):
        known = np.concatenate((values, _together(values, learnt & ~rub)[None]))
        threshold = np.quantile(known[:, learnt & ~rub], 1 - false_alarm, axis=(1, 3))
        is_detected[:, judged] = known[:, judged] > threshold[:, None, :, None]
        for place in np.ndindex(*threshold.shape):
            level = known[place[0]][..., place[1], :]
            areas[(i_half, *place)] = area_under_curve(
                level[judged & rub].ravel(), level[judged & ~rub].ravel()
            )
    found = {
        "detection_rate": (is_detected[:, done & rub].mean(axis=(1, 3)), "share of cases with rub detected"),
        "false_alarm_rate": (
            is_detected[:, done & ~rub].mean(axis=(1, 3)),
            "share of cases without rub detected as rub",
        ),
        "area_under_curve": (areas.mean(axis=0), "area under the receiver operating curve"),
        "verdict": (is_detected.mean(axis=-1), "share of draws in which rub is detected"),
    }
    return scores.assign_coords(indicator=names).assign(
        {
            name: (
                ("indicator", *(axes if name == "verdict" else ()), "level"),
                value,
                {"units": "1", "long_name": text},
            )
            for name, (value, text) in found.items()
        }
    )


def require_both_kinds(store: xr.Dataset, seed: int = 1) -> None:
    """Check that `judge` can learn from a store, by the regime of its cases alone: no waveform is read.

    InputError where there are too few cases without contact, or with it.
    """
    regime, done = (store[name].values for name in ("regime", "status"))
    _halves(store, regime != REGIME.index("no_contact"), done == DONE, seed)


def _halves(
    data: xr.Dataset, rub: NDArray[np.bool_], done: NDArray[np.bool_], seed: int
) -> list[NDArray[np.bool_]]:
    """Return the cases of either half that are done; InputError where one has too few of a kind."""
    is_first = np.random.default_rng(seed).permutation(rub.size).reshape(rub.shape) < rub.size / 2
    halves = [half & done for half in (is_first, ~is_first)]
    fewest = min(int((half & kind).sum()) for half in halves for kind in (rub, ~rub))
    if fewest < _LEAST:
        n_free, n_rub = int((done & ~rub).sum()), int((done & rub).sum())
        which = "smaller clearances" if n_rub < n_free else "clearances above the contact-free amplitude"
        raise refusal(
            data,
            f"{n_free} selected cases without contact and {n_rub} with it are too few to "
            f"learn from; use some {4 * _LEAST} of each, the others by {which} in the study",
        )
    return halves


def area_under_curve(with_rub: Floats, without: Floats) -> float:
    """Return the area under the receiver operating curve, (n,), (m,) -> 0 to 1; 0.5 is chance.

    It is the share of pairs in which the case with rub scores higher, ties counted half (Mann and Whitney).
    """
    from scipy.stats import mannwhitneyu

    pairs = mannwhitneyu(with_rub, without, method="asymptotic").statistic
    return float(pairs) / (with_rub.size * without.size)


def _together(values: Floats, learnt: NDArray[np.bool_]) -> Floats:
    """(n_indicator, ..., n_level, n_draw) -> (..., n_level, n_draw), the sum of -ln p."""
    from scipy.special import log_ndtr

    known = values[:, learnt]  # (n_indicator, n_case, n_level, n_draw)
    shape = (len(values), *(1 for _ in learnt.shape), known.shape[-2], 1)
    mean = known.mean(axis=(1, 3)).reshape(shape)
    deviation = known.std(axis=(1, 3)).reshape(shape)
    together: Floats = -log_ndtr(-(values - mean) / deviation).sum(axis=0)
    return together
