"""Times of samples: uniform ones from a clock, or from a column, with what is missing found and filled."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from postproc.signals.contacts import runs_of
from rubhpc.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Flags = NDArray[np.bool_]

_GAP = 1.5  # steps of time, beyond which samples are missing
_UNEVEN = 0.05  # of a step, by which a sample may be off a uniform grid
_BACK = 0.01  # share of samples whose time does not increase, at most
_PEAKED = 5.0  # times as many samples at the last level as at the one before: no sine has 2.5
_RUN = 3  # clipped samples in a row
_FEWEST = 16  # samples of a record


class Sampled(NamedTuple):
    """Columns at uniform times."""

    step: float  # s
    values: dict[str, Floats]  # (n_sample,) each, without NaN
    absent: dict[str, Flags]  # where they are filled
    notes: list[str]

    @property
    def time(self) -> Floats:
        """Times (n_sample,), s, from 0."""
        count = np.arange(next(iter(self.values.values())).size, dtype=np.float64)
        return self.step * count


def sampled(
    columns: Mapping[str, Floats], time: Floats | None, rate: float | None, where: str, name: str = ""
) -> Sampled:
    """Return columns (n_sample,), NaN where a sample is missing, on a uniform grid of times.

    `time` (s) is that of each sample; without it the `rate` (Hz) is needed. File and column of the time are
    named in messages: InputError where the time does not increase, a column has no numbers, or there are too
    few samples.
    """
    n = min((values.size for values in columns.values()), default=0)
    if n < _FEWEST:
        raise InputError(f"{where}: has {n} samples, too few for any figure; give a longer record")
    for column, values in columns.items():
        if not np.isfinite(values).any():
            raise InputError(f"{where}: column {column} contains no number; choose another one, or repair it")
    notes: list[str] = []
    if time is None:
        step, in_gap = 1.0 / float(rate or 1.0), np.zeros(n, dtype=bool)
        found = {column: values[:n] for column, values in columns.items()}
    else:
        step, found, in_gap = _on_grid(columns, time[:n], where, name, notes)
    filled, absent = {}, {}
    for column, values in found.items():
        gone = ~np.isfinite(values)
        absent[column] = gone
        filled[column] = values
        if gone.any():
            places = np.arange(values.size)
            filled[column] = np.interp(places, places[~gone], values[~gone])
        if (own := gone & ~in_gap).any():
            lost = f"{100 * float(own.mean()):.2g} % of the samples are missing"
            notes.append(f"column {column}: {lost}, up to {step * _longest(own):.3g} s in a row")
    return Sampled(step, filled, absent, notes)


def _on_grid(
    columns: Mapping[str, Floats], time: Floats, where: str, name: str, notes: list[str]
) -> tuple[float, dict[str, Floats], Flags]:
    """Step, s, columns on the uniform grid of the median step, NaN in gaps, and where these are."""
    from scipy.interpolate import CubicSpline

    known = np.flatnonzero(np.isfinite(time))
    ahead = np.concatenate([[True], time[known[1:]] > np.maximum.accumulate(time[known])[:-1]])
    known, lost = known[ahead], time.size - int(ahead.sum())
    if known.size < _FEWEST or lost > _BACK * time.size:
        fix = "write it with more digits, or give [time] rate instead of the column"
        raise InputError(f"{where}: [time] column {name}: does not increase at {lost} samples; {fix}")
    if lost:
        notes.append(f"time: {lost} samples without an increasing time are left out")
    at = time[known] - time[known[0]]
    steps = np.diff(at)
    near = steps[steps < _GAP * float(np.median(steps))]
    step = float(near.mean())
    grid = step * np.arange(round(at[-1] / step) + 1)
    place = np.clip(np.searchsorted(at, grid), 1, at.size - 1)
    apart = np.minimum(np.abs(grid - at[place - 1]), np.abs(grid - at[place]))
    in_gap = (at[place] - at[place - 1] > _GAP * step) & (apart > 0.25 * step)
    off = float(apart[~in_gap].max(initial=0.0))
    is_even = off <= _UNEVEN * step or _is_rounded(time[known], off)
    if in_gap.any():
        gaps = runs_of(in_gap)[0]
        notes.append(
            f"time: {int(in_gap.sum())} samples are missing in {gaps.size} gaps, up to "
            f"{step * _longest(in_gap):.3g} s in a row"
        )
    if not is_even:
        spread = 100.0 * float(near.std()) / step
        notes.append(f"time: steps are not uniform (standard deviation {spread:.2g} %); interpolated")
    found = {}
    for column, values in columns.items():
        own = values[known]
        there = np.isfinite(own)
        if is_even:
            nearest = np.where(np.abs(grid - at[place - 1]) < np.abs(grid - at[place]), place - 1, place)
            picked = own[nearest]
        else:
            picked = CubicSpline(at[there], own[there])(grid)
            picked = np.where(np.interp(grid, at, there.astype(float)) < 0.5, math.nan, picked)
        found[column] = np.where(in_gap, math.nan, picked)
    return step, found, in_gap


def _is_rounded(time: Floats, off: float) -> bool:
    """Whether times that are up to `off` seconds away from a uniform grid have been rounded to decimals."""
    last = 10.0 ** math.ceil(math.log10(1.4 * off))
    return bool(np.allclose(time / last, np.rint(time / last), atol=1e-3, rtol=0.0))


def clipped(values: Floats) -> tuple[float, list[float]]:
    """Return the share of samples at which a signal is cut off, and at which of its highest and lowest value.

    There are then far more samples at this value than at the one next to it, in runs.
    """
    share, levels = 0.0, []
    for sign in (1.0, -1.0):
        one = sign * values
        top = float(one.max())
        below, at_top = one[one < top], one == top
        if not below.size or top == 0.0 or _longest(at_top) < _RUN:
            continue
        if int(at_top.sum()) > _PEAKED * int((below == below.max()).sum()):
            share += float(at_top.mean())
            levels.append(sign * top)
    return share, levels


def _longest(flags: Flags) -> int:
    """Return the length of the longest run of true."""
    first, end = runs_of(flags)
    return int((end - first).max(initial=0))
