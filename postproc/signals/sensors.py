"""Sensors: what a measurement makes of a simulated signal, from the probe to the samples of a data logger."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfilt, sosfilt_zi

from postproc.signals.resampling import between, decimated
from postproc.signals.spectra import check_signal, samples_per_revolution
from postproc.store.run_ups import is_run_up
from postproc.store.select import narrow
from rubhpc.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.float64]

_LEAST_OVERSAMPLING = 2  # times the rate, at which signals are filtered before the clock samples them
_STEEP = 4  # order of the Butterworth filter of a sensor's band
_FEWEST = 16  # samples
PULSE = 5.0  # V, height of the key-phasor's pulses
_PULSE_WIDTH = 10.0  # degrees of a turn


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """What a sensor and its converter do to a signal, in the unit of the signal (SI).

    Parameters
    ----------
    white : float
        Root mean square of white noise, in the band up to half the sampling rate.
    pink : float
        Root mean square of noise whose power falls as 1 over the frequency, from the first line of the
        record.
    offset : float
        What is added to every sample.
    run_out : tuple of (order, amplitude, phase)
        Slow roll: what the probe sees of a shaft that turns without vibration; amplitudes zero to peak,
        phases (rad) as of `run_up`: by which they lead the order of the shaft's angle.
    band : float, optional
        Hz, at which a low-pass of fourth order (Butterworth) takes 3 dB.
    full_scale : float, optional
        Largest magnitude that is not clipped.
    step : float
        Of the converter.
    drop_outs : float
        Share of the samples that are lost, NaN.
    drop_out_length : float
        Samples that are lost in a row, on the average.
    """

    white: float = 0.0
    pink: float = 0.0
    offset: float = 0.0
    run_out: tuple[tuple[float, float, float], ...] = ()
    band: float | None = None
    full_scale: float | None = None
    step: float = 0.0
    drop_outs: float = 0.0
    drop_out_length: float = 1.0

    def __post_init__(self) -> None:
        for name in ("white", "pink", "step", "drop_outs"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise InputError(f"sensor: {name}: {getattr(self, name)} is out of range; give 0 or more")
        for name in ("band", "full_scale"):
            if (value := getattr(self, name)) is not None and not value > 0.0:
                raise InputError(f"sensor: {name}: {value} is out of range; give one above 0, or None")
        length = self.drop_out_length
        if not length >= 1.0 or self.drop_outs * (1.0 + length) > length:  # a sample at least between two
            problem = f"{self.drop_outs} of the samples cannot be lost {length} in a row"
            raise InputError(
                f"sensor: drop_outs: {problem}; give a smaller share, or a drop_out_length above 1"
            )

    def before_clock(self, values: Floats, turns: Floats, rate: float) -> Floats:
        """Return what reaches the converter of a signal (n_sample,), at `rate` hertz and shaft turns."""
        seen = values + self.offset
        for order, amplitude, phase in self.run_out:
            seen = seen + amplitude * np.cos(2.0 * math.pi * order * turns + phase)
        if self.band is None or self.band >= 0.5 * rate:
            return seen
        sections = butter(_STEEP, self.band, fs=rate, output="sos")
        return np.asarray(sosfilt(sections, seen, zi=sosfilt_zi(sections) * seen[0])[0])

    def after_clock(self, values: Floats, rng: np.random.Generator) -> Floats:
        """Return what the converter gives of a signal (n_sample,): noise, limits, steps and losses."""
        found = values + self.white * rng.standard_normal(values.size)
        if self.pink:
            power = np.append(0.0, 1.0 / np.arange(1, values.size // 2 + 1))
            lines = rng.standard_normal((power.size, 2)) @ (1.0, 1j) * np.sqrt(power / (4.0 * power.sum()))
            found += self.pink * values.size * np.fft.irfft(lines, values.size)
        if self.full_scale is not None:
            found = np.clip(found, -self.full_scale, self.full_scale)
        if self.step:
            found = self.step * np.rint(found / self.step)
        if self.drop_outs:
            found[self._lost(values.size, rng)] = math.nan
        return found

    def _lost(self, n_sample: int, rng: np.random.Generator) -> NDArray[np.bool_]:
        """Return which samples are lost: runs and spans between them of random lengths (a Markov chain)."""
        begins = min(1.0, self.drop_outs / ((1.0 - self.drop_outs) * self.drop_out_length))
        lost = np.zeros(n_sample, dtype=bool)
        at = int(rng.geometric(begins)) - 1
        while at < n_sample:
            end = at + int(rng.geometric(1.0 / self.drop_out_length))
            lost[at:end] = True
            at = end + int(rng.geometric(begins))
        return lost


def sense(
    case: xr.Dataset,
    sensors: Mapping[str, Sensor | Mapping[str, Any]],
    *,
    rate: float,
    seed: int = 1,
    key_phasor_angle: float = 0.0,
) -> xr.Dataset:
    """Return what a data logger records of one case: its signals seen by sensors and sampled by a clock.

    Parameters
    ----------
    case : Dataset
        Of a store, at a constant speed or as run-up, or of `rubhpc.run_up`.
    sensors : mapping of signal to Sensor, or its arguments
        Of `vertical`, `probe_left`, and so on.
    rate : float
        Of the samples, Hz; what lies above half of it is filtered off.
    seed : int
        Of the noise; each signal has draws of its own, whatever other signals there are.
    key_phasor_angle : float
        rad, from straight up in the sense of spin: where the mark passes the key-phasor.

    Returns
    -------
    Dataset over `time` (s)
        The signals, and `key_phasor` (V): a pulse of 5 V that begins at this angle in every revolution.

    Raises
    ------
    InputError
        There is no such signal, or the rate or a sensor is out of range.
    """
    for name in sensors:
        check_signal(name, case)
    clock = Clock(case, rate)
    data = narrow(case, list(sensors)).load()
    found: dict[str, Any] = {}
    for name, given in sensors.items():
        sensor = given if isinstance(given, Sensor) else Sensor(**_known(given))
        rng = np.random.default_rng([seed, *name.encode()])
        seen = clock.before_converter(data[name].values, sensor)
        found[name] = "time", sensor.after_clock(seen, rng), dict(data[name].attrs)
    found["key_phasor"] = "time", clock.pulses(key_phasor_angle), {"units": "V", "long_name": "key-phasor"}
    about = {"units": "s", "long_name": "time"}
    return xr.Dataset(found, coords={"time": ("time", clock.time, about)})


class Clock:
    """The clock of a data logger during one case, as of `sense`, at a rate in Hz.

    Attributes
    ----------
    time, turns : (n,), s and 1
        Of each sample, from the beginning of the record: when it is taken, and how far the shaft has turned.
    per_revolution : int
        Samples of the case, not of the clock, a revolution.

    Raises
    ------
    InputError
        The rate is out of range, or gives less than 16 samples.
    """

    def __init__(self, case: xr.Dataset, rate: float) -> None:
        check_rate(rate)
        turns_at, duration, self._n_stored, self.per_revolution = _turning(case)
        if duration * rate < _FEWEST:
            raise InputError(
                f"rate: {rate:g} Hz gives {int(duration * rate)} samples of {duration:.3g} s; raise it"
            )
        at = np.linspace(0.0, duration, 1000)
        highest = self.per_revolution * float(np.gradient(turns_at(at), at).max())  # Hz, of what is stored
        self._rate, self._times = rate, 2 ** math.ceil(math.log2(max(_LEAST_OVERSAMPLING, highest / rate)))
        fine = np.arange(int(duration * rate) * self._times) / (rate * self._times)
        self._fine_turns = turns_at(fine)
        self.time, self.turns = fine[:: self._times], self._fine_turns[:: self._times]

    def before_converter(self, values: ArrayLike, sensor: Sensor) -> Floats:
        """Return what the converter of a sensor is given of a signal (n_sample,) of the case, (n,)."""
        stored = np.asarray(values, dtype=float)[: self._n_stored]
        wave = between(stored)(self._fine_turns * self.per_revolution)
        seen = sensor.before_clock(wave, self._fine_turns, self._rate * self._times)
        return decimated(seen, self._times)

    def pulses(self, angle: float = 0.0) -> Floats:
        """Return the key-phasor, (n,), V, of a mark that passes it at an angle, rad."""
        past = (self.turns - angle / (2.0 * math.pi)) % 1.0
        return np.where(past < _PULSE_WIDTH / 360.0, PULSE, 0.0)


def check_rate(rate: float) -> None:
    """Refuse a sampling rate, Hz, that is none."""
    if not 0.0 < rate < math.inf:
        raise InputError(f"rate: {rate:g} Hz is out of range; give one above 0")


def _known(given: Mapping[str, Any]) -> Mapping[str, Any]:
    """The arguments of a sensor; InputError where there is no such."""
    known = [one.name for one in fields(Sensor)]
    for name in given:
        if name not in known:
            raise InputError(f"sensor: {name}: unknown argument; choose one of {', '.join(known)}")
    return given


def _turning(case: xr.Dataset) -> tuple[Any, float, int, int]:
    """Revolutions as a function of the time (s), duration of the record, its samples, and those a turn."""
    n = samples_per_revolution(case)
    if not is_run_up(case):
        n_sample = case.sizes["sample"]
        rate = abs(float(narrow(case, ["spin_speed"])["spin_speed"])) / (2.0 * math.pi)
        return (lambda time: time * rate), n_sample / (n * rate), n_sample, n
    turning = narrow(case, ["speed", "time"]).load()
    turning = turning.isel(revolution=np.isfinite(turning["speed"].values))
    speeds, begins = turning["speed"].values, turning["time"].values
    ends = np.append(begins, begins[-1] + 2.0 * math.pi / speeds[-1]) - begins[0]
    return CubicSpline(ends, np.arange(ends.size)), float(ends[-1]), n * speeds.size, n
