"""Contact in a recorded case: the spans in and out of it, the jumps at their ends, the decay between."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from postproc.signals.decay import decaying_sine
from postproc.signals.spectra import check_signal, samples_per_revolution
from postproc.store.axes import refusal
from postproc.store.select import narrow
from postproc.store.variables import require_results

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

_BEFORE, _AFTER = 5, 3  # samples that a jump is extrapolated from, and those it is held against
_ABOVE = 10.0  # of the median, where a signal alone shows an event
_LEAST = 8  # samples of a span from which a decay is read


def sample_time(case: xr.Dataset) -> float:
    """Return the time from one sample of a case to the next, s."""
    spin = float(narrow(case, ["spin_speed"])["spin_speed"].values)
    return 2 * math.pi / (spin * samples_per_revolution(case["revolution"]))


def signal_of(case: xr.Dataset, signal: str, stator: int | None = None) -> xr.DataArray:
    """Return one signal of one case, (sample,), loaded and in double precision.

    `stator` counts from 1 and may be left out where there is one, or where one has been selected.
    """
    check_signal(signal)
    if stator is not None and "stator" in case.dims:
        case = case.isel(stator=[_place(case, stator)])
    wave: xr.DataArray = narrow(case, [signal])[signal].astype(float).load()
    require_results(wave.values, case)
    return wave


def touching(case: xr.Dataset, stator: int | None = None) -> xr.DataArray:
    """Return whether the rotor touches a stator, or the one named, within the interval after each sample."""
    touches: xr.DataArray = _force(case, stator) > 0
    return touches.assign_attrs(units="1", long_name="in contact")


def contact_spans(case: xr.Dataset, stator: int | None = None, whole: bool = True) -> xr.Dataset:
    """Return the spans of contact of one case.

    Parameters
    ----------
    stator : int, optional
        Which, counted from 1; any of them by default.
    whole : bool
        Leave out a span that the beginning or the end of the record cuts.

    Returns
    -------
    Dataset over `span`
        `first` and `end` (samples, half open), `start` and `duration` (s), `revolution` at the start, and
        `peak_force` (N), of the means over sample intervals that are stored.
    """
    spans = _spans(case, touching(case, stator).values, whole)
    peaks = _peaks(_force(case, stator).values, spans["first"].values, spans["end"].values)
    return spans.assign(peak_force=("span", peaks, {"units": "N", "long_name": "peak contact force"}))


def free_spans(case: xr.Dataset, stator: int | None = None, whole: bool = True) -> xr.Dataset:
    """Return the spans out of contact of one case, as `contact_spans` does, without `peak_force`.

    A case that never touches is one span; it counts as whole.
    """
    free = ~touching(case, stator).values
    return _spans(case, free, whole and not free.all())


def peak_after_contact(case: xr.Dataset, signal: str = "torsion", stator: int | None = None) -> xr.DataArray:
    """Return the largest magnitude of a signal from each touch to the next, (span,), in its unit."""
    wave = signal_of(case, signal, stator)
    first = contact_spans(case, stator)["first"].values
    peaks = _peaks(np.abs(wave.values), first[:-1], first[1:])
    return xr.DataArray(peaks, dims="span", name=signal, attrs=wave.attrs)


def event_jumps(
    case: xr.Dataset, signal: str = "torsion_acceleration", stator: int | None = None
) -> xr.Dataset:
    """Return how a signal jumps where the rotor touches and leaves the stator.

    Before and after an event straight lines are laid through four samples and met at its instant; their
    difference there is the step, that of their slopes the slope change. The departure is the rms by which the
    next three samples leave a parabola through the five before: `local_rms` is the rms of the same along the
    free span next to the event, where the signal is smooth.

    Events without a free span of some samples next to them are left out.

    Returns
    -------
    Dataset over `event`
        `time` (s, the middle of the sample interval), `kind` ("touch" or "release"), `step` and `departure`
        (the signal's unit), `slope_change` (its unit a second), `local_rms` and `ratio`, which is the
        departure over it.
    """
    wave = signal_of(case, signal, stator)
    values, dt = wave.values, sample_time(case)
    spans = contact_spans(case, stator, whole=False)
    first, end = spans["first"].values, spans["end"].values
    # The touch lies between a span's first sample and the next one, the release after its last sample.
    places = np.concatenate((first + 1, end))
    kinds = np.concatenate((np.full(first.size, "touch"), np.full(end.size, "release")))
    order = np.argsort(places, kind="stable")
    places, kinds = places[order], kinds[order]
    inside = (places >= _BEFORE) & (places <= values.size - max(_AFTER, 4))
    places, kinds = places[inside], kinds[inside]
    departure = _departures(values)
    levels = _local_rms(departure, places, kinds, touching(case, stator).values)
    known = np.isfinite(levels)
    places, kinds, levels = places[known], kinds[known], levels[known]
    before = _lines(values, places - 4)
    after = _lines(values, places)
    # At the event, half an interval past the fourth sample before and half an interval short of the next.
    step = (after[:, 0] - 0.5 * after[:, 1]) - (before[:, 0] + 3.5 * before[:, 1])
    unit = str(wave.attrs.get("units", "1"))
    jump = departure[places]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = jump / levels
    per_second = {"units": f"{unit} s-1", "long_name": "change of slope"}
    return xr.Dataset(
        {
            "time": ("event", (places - 0.5) * dt, {"units": "s", "long_name": "time"}),
            "kind": ("event", kinds),
            "step": ("event", step, {"units": unit, "long_name": "step"}),
            "slope_change": ("event", (after[:, 1] - before[:, 1]) / dt, per_second),
            "departure": ("event", jump, {"units": unit, "long_name": "departure from extrapolation"}),
            "local_rms": ("event", levels, {"units": unit, "long_name": "rms departure in free motion"}),
            "ratio": ("event", ratio, {"units": "1", "long_name": "departure over its rms in free motion"}),
        }
    )


def events_in_signal(
    case: xr.Dataset, signal: str = "torsion_acceleration", stator: int | None = None
) -> xr.Dataset:
    """Return where a signal jumps, found from the signal alone, as on a test rig without a force sensor.

    An event is where the departure (see `event_jumps`) peaks above ten times its median over the
    revolution. Its time is known to within four samples.

    Returns
    -------
    Dataset over `event`
        `time` (s), `departure` (the signal's unit) and `ratio`, which is the departure over that median.
    """
    from scipy.signal import find_peaks

    wave = signal_of(case, signal, stator)
    departure = np.nan_to_num(_departures(wave.values))
    medians = np.median(departure.reshape(-1, samples_per_revolution(wave)), axis=1)
    level = np.repeat(medians, samples_per_revolution(wave))
    places, _ = find_peaks(departure, height=_ABOVE * level, distance=_BEFORE)
    jump = departure[places]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = jump / level[places]
    unit = str(wave.attrs.get("units", "1"))
    return xr.Dataset(
        {
            "time": ("event", (places - 0.5) * sample_time(case), {"units": "s", "long_name": "time"}),
            "departure": ("event", jump, {"units": unit, "long_name": "departure from extrapolation"}),
            "ratio": ("event", ratio, {"units": "1", "long_name": "departure over its median"}),
        }
    )


def free_decay(case: xr.Dataset, signal: str = "stator_lateral", stator: int | None = None) -> xr.Dataset:
    """Return frequency and damping of the free vibration in each span out of contact.

    Each span is taken as a sum of decaying sines (matrix pencil, `signals.decay`); the strongest is returned.

    Returns
    -------
    Dataset over `span`
        `start`, `duration` (s), `frequency` (damped, Hz), `damping_ratio`, `decay_rate` (1/s), `amplitude`
        (at the start of the span, in the signal's unit), `remaining` (of it at the end of the span) and
        `residual` (rms misfit over rms). NaN where a span is too short or does not oscillate.
    """
    wave = signal_of(case, signal, stator)
    dt = sample_time(case)
    spans = free_spans(case, stator)
    pieces = [wave.values[i:j] for i, j in zip(spans["first"].values, spans["end"].values, strict=True)]
    fits = [decaying_sine(piece, dt) if piece.size >= _LEAST else {} for piece in pieces]
    quantities = {
        "frequency": ("Hz", "damped natural frequency"),
        "damping_ratio": ("1", "damping as a fraction of critical"),
        "decay_rate": ("s-1", "decay rate"),
        "amplitude": (str(wave.attrs.get("units", "1")), "amplitude at the start of the span"),
        "residual": ("1", "rms misfit over rms"),
    }
    found = spans[["start", "duration"]].assign(
        {
            name: ("span", [fit.get(name, math.nan) for fit in fits], {"units": unit, "long_name": text})
            for name, (unit, text) in quantities.items()
        }
    )
    text = "amplitude at the end of the span over that at its start"
    remaining = np.exp(-found["decay_rate"].values * found["duration"].values)
    return found.assign(remaining=("span", remaining, {"units": "1", "long_name": text}))


def _force(case: xr.Dataset, stator: int | None) -> xr.DataArray:
    """Return the contact force of one stator, or the largest of all, (sample,), N."""
    force = narrow(case, ["contact_force"], ["stator"])["contact_force"]
    if "stator" in force.dims:
        force = force.max("stator") if stator is None else force.isel(stator=_place(case, stator))
    return force.astype(float).load()


def _place(case: xr.Dataset, stator: int) -> int:
    n_stator = case.sizes["stator"]
    if not 1 <= stator <= n_stator:
        raise refusal(case, f"there is no stator {stator}; choose one from 1 to {n_stator}")
    return stator - 1


def runs_of(mask: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return where the runs of a mask (n,) begin and end, half open, (n_run,) each."""
    ends = np.diff(np.pad(mask.astype(np.int8), 1))
    return np.flatnonzero(ends == 1), np.flatnonzero(ends == -1)


def _spans(case: xr.Dataset, inside: NDArray[np.bool_], whole: bool) -> xr.Dataset:
    """Return the runs of a mask (n_sample,) as spans over time."""
    first, end = runs_of(inside)
    if whole:
        kept = (first > 0) & (end < inside.size)
        first, end = first[kept], end[kept]
    dt = sample_time(case)
    return xr.Dataset(
        {
            "first": ("span", first, {"units": "1", "long_name": "first sample"}),
            "end": ("span", end, {"units": "1", "long_name": "sample after the last"}),
            "start": ("span", first * dt, {"units": "s", "long_name": "start"}),
            "duration": ("span", (end - first) * dt, {"units": "s", "long_name": "duration"}),
            "revolution": ("span", case["revolution"].values[first], {"units": "1"}),
        }
    )


def _peaks(values: Floats, first: NDArray[np.intp], end: NDArray[np.intp]) -> Floats:
    """Return the largest value in each of some spans that do not overlap, (n_span,)."""
    if first.size == 0:
        return np.zeros(0)
    pairs = np.column_stack((first, end)).ravel()
    # The floor past the end lets a span reach to the last sample.
    peaks: Floats = np.maximum.reduceat(np.append(values, -np.inf), pairs)[::2]
    return peaks


def _departures(values: Floats) -> Floats:
    """Return the rms by which samples i, i+1, i+2 leave the parabola through the five before, (n_sample,)."""
    at = np.arange(_BEFORE + _AFTER)
    fit = np.vander(at, 3)
    leave = np.eye(_BEFORE + _AFTER)[_BEFORE:].copy()
    leave[:, :_BEFORE] -= fit[_BEFORE:] @ np.linalg.pinv(fit[:_BEFORE])
    found = np.full(values.size, np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(values, _BEFORE + _AFTER)
    found[_BEFORE : _BEFORE + len(windows)] = np.sqrt(np.mean((windows @ leave.T) ** 2, axis=-1))
    return found


def _local_rms(
    departure: Floats, places: NDArray[np.intp], kinds: NDArray[np.str_], touches: NDArray[np.bool_]
) -> Floats:
    """Return the rms departure in the free span next to each event, clear of its ends, (n_event,)."""
    reach = np.ones(2 * _BEFORE + 1)  # no window of a departure may touch a contact
    clear = (np.convolve(touches, reach, "same") < 0.5) & np.isfinite(departure)
    squares = np.concatenate(([0.0], np.cumsum(np.where(clear, departure, 0.0) ** 2)))
    counts = np.concatenate(([0], np.cumsum(clear)))
    is_touch = kinds == "touch"
    bounds = np.concatenate(([0], places, [departure.size]))
    at = np.arange(1, places.size + 1)
    low = np.where(is_touch, bounds[at - 1], bounds[at])
    high = np.where(is_touch, bounds[at], bounds[at + 1])
    n = counts[high] - counts[low]
    with np.errstate(invalid="ignore"):
        level: Floats = np.sqrt((squares[high] - squares[low]) / np.where(n > 0, n, np.nan))
    return level


def _lines(values: Floats, first: NDArray[np.intp]) -> Floats:
    """Return value at the first sample and slope (a sample) of the lines through four samples, (n, 2)."""
    window = values[first[:, None] + np.arange(4)]
    slope, start = np.polynomial.polynomial.polyfit(np.arange(4), window.T, 1)[::-1]
    found: Floats = np.column_stack((start, slope))
    return found
