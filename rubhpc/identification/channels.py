"""What was measured, as signals of a simulation: which signal each is, and how far its orders reach."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, compress
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.signals.places import see_motion
from postproc.signals.resampling import between
from postproc.signals.spectra import samples_per_revolution
from postproc.store.attributes import MEASURED
from rubhpc.errors import InputError
from rubhpc.schema import PROBE, is_signal

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

_BAND = 0.4  # of the sampling rate: beyond, the filter of the logger has taken what there was
_FEWEST = 24  # revolutions
_MOVED = "measured_"  # what probes at the node of a measured orbit are called
_ANGLES = {"vertical": 0.0, "horizontal": 0.5 * math.pi}
_POINTING = math.radians(1.0)  # by which the direction of a key-phasor is known
_PLACED = 0.3  # of a sample, by which its pulses are placed (standard deviation)
_DEAD = 1e-9  # of the largest value: a signal that varies by less is constant
_PARTS = 4  # of a record, in which signals have about the same size
_FADED = 1 / 3  # of the largest rms of a part
_SLIP = 0.02  # by which a speed that is given may be wrong
_HARMONICS = 4  # by which the true speed is found
_TRIALS = 20  # a bin of the spectrum


@dataclass(frozen=True, kw_only=True)
class Channels:
    """Measured signals of one record at a constant speed.

    Attributes
    ----------
    names : tuple of str
        In the dataset that was measured.
    simulated : tuple of str
        The same in a record.
    units, long_names : tuple of str
    probes : tuple of dict
        What a simulation has to measure for it, as tables [[record.probe]].
    waves : (n_channel, n_sample)
        SI units.
    n : int
        Samples per revolution.
    spin : float
        rad/s.
    highest_order : float
        Up to which the data logger can see.
    angle_error : float
        rad, standard deviation of the angle of the shaft, by which phases are those of a simulation; infinite
        where it is unknown.
    note : str
        Signals that are left out, one a line.
    """

    names: tuple[str, ...]
    simulated: tuple[str, ...]
    units: tuple[str, ...]
    long_names: tuple[str, ...]
    probes: tuple[dict[str, Any], ...]
    waves: Floats
    n: int
    spin: float
    highest_order: float
    angle_error: float
    note: str = ""

    @property
    def revolutions(self) -> int:
        """Of the record."""
        return int(self.waves.shape[1]) // self.n

    @cached_property
    def orbit(self) -> Floats | None:
        """Shares (2, n_channel) of signals in the vertical and horizontal motion that two of them see."""
        own = {name: {"angle": angle, "quantity": "displacement"} for name, angle in _ANGLES.items()}
        known = own | {PROBE + probe["name"]: probe for probe in self.probes}
        looks = [(i, known[name]) for i, name in enumerate(self.simulated) if name in known]
        for (i, one), (j, other) in combinations(looks, 2):
            if see_motion(one, other):
                seen = [[math.cos(probe["angle"]), math.sin(probe["angle"])] for probe in (one, other)]
                shares = np.zeros((2, len(self.names)))
                shares[:, [i, j]] = np.linalg.inv(seen)
                return shares
        return None

    @property
    def deflection(self) -> float:
        """Largest amplitude of a displacement, m; 0 where none is measured."""
        sizes = self.waves.std(axis=1)
        return math.sqrt(2.0) * max(
            (size for size, unit in zip(sizes, self.units, strict=True) if unit == "m"), default=0.0
        )

    def of_record(self, signals: Mapping[str, Floats]) -> Floats:
        """Return these signals of a record, (n_channel, n_sample)."""
        return np.stack([np.atleast_2d(signals[name])[0] for name in self.simulated])


def channels_of(measured: xr.Dataset) -> Channels:
    """Return the channels of a measured dataset.

    Signals with the name of a stored one are that; those of a stator are of the first. Of two probes whose
    orbit is derived the probes themselves are used. Signals that are constant are left out, and those that
    change their size while others do not, as of a broken sensor.

    Raises
    ------
    InputError
        The speed or the motion changes, the speed is another than stated, there are several records, too few
        revolutions, or a probe states no place.
    """
    where = str(measured.attrs.get(MEASURED, "measured"))
    if "spin_speed" not in measured:
        fix = "give a record at a constant speed, or a part of this one"
        raise InputError(f"{where}: the speed changes by more than 2 %; {fix}")
    if measured["spin_speed"].ndim:
        raise InputError(f"{where}: data: several records at several speeds; identify from one of them")
    known = {PROBE + probe["name"]: probe for probe in measured.attrs["study"]["record"]["probe"]}
    derived = set(_ANGLES) if "probes" in measured.attrs else set()
    names, simulated, probes = [], [], []
    for name in (str(key) for key, of in measured.data_vars.items() if of.dims == ("sample",)):
        if name in derived or not is_signal(name):
            continue
        if np.ptp(values := measured[name].values) <= _DEAD * np.abs(values).max():
            continue  # a dead sensor
        probe = known.get(name)
        if probe is not None and not {"node", "stator"} & set(probe):
            fix = f"add node = 8 to [signal.{probe['name']}], or stator = 1"
            raise InputError(f"{where}: signal {probe['name']}: states no place; {fix}")
        if probe is None and name in _ANGLES and "node" in measured.attrs:
            node = int(measured.attrs["node"])
            probe = {"name": _MOVED + name, "node": node, "angle": _ANGLES[name], "quantity": "displacement"}
        names.append(name)
        simulated.append(name if probe is None else PROBE + probe["name"])
        probes += [] if probe is None else [probe]
    if not names:
        raise InputError(f"{where}: all signals are constant; choose other columns")
    n = samples_per_revolution(measured["revolution"])
    revolutions = measured.sizes["sample"] // n
    if revolutions < _FEWEST:
        problem = f"has {revolutions} revolutions, fewer than {_FEWEST}"
        raise InputError(f"{where}: {problem}; give a longer record")
    waves = np.stack([measured[name].values.astype(float) for name in names])
    parts = waves[:, : revolutions // _PARTS * _PARTS * n].reshape(len(names), _PARTS, -1).std(axis=2)
    is_steady = parts.min(axis=1) >= _FADED * parts.max(axis=1)
    if not is_steady.any():
        fix = "give a part of the record in which it does not"
        raise InputError(f"{where}: the size of the motion changes by more than a factor of 3; {fix}")
    unsteady = [name for name, steady in zip(names, is_steady, strict=True) if not steady]
    names, simulated = (list(compress(one, is_steady)) for one in (names, simulated))
    spin = float(measured["spin_speed"])
    rate = float(measured.attrs.get("rate", math.inf))
    waves = waves[is_steady]
    if measured.attrs.get("has_absolute_phase", 0):
        angle_error = math.hypot(_POINTING, _PLACED * spin / rate)
    else:  # the speed may be a nominal one
        slip = _slip(waves, n, where)
        spin, waves, angle_error = spin * slip, _turned_by(waves, n, slip), math.inf
    seen = _BAND * min(rate * 2.0 * math.pi / spin, n)
    return Channels(
        names=tuple(names),
        simulated=tuple(simulated),
        units=tuple(str(measured[name].attrs.get("units", "1")) for name in names),
        long_names=tuple(str(measured[name].attrs.get("long_name", name)) for name in names),
        probes=tuple(probe for probe in probes if PROBE + probe["name"] in simulated),
        waves=waves,
        n=n,
        spin=spin,
        highest_order=seen,
        angle_error=angle_error,
        note="\n".join(
            f"{where}: {name}: changes its size by more than a factor of 3; left out" for name in unsteady
        ),
    )


def _slip(waves: Floats, n: int, where: str) -> float:
    """Return the true speed over the one that was taken, by the place of the lines at 1X to 4X."""
    size = np.maximum(waves.std(axis=1, keepdims=True), np.finfo(float).tiny)
    whole = waves / size * np.hanning(waves.shape[1])
    revolutions = waves.shape[1] / n
    turns = np.arange(waves.shape[1]) / n

    def power(slip: float, orders: range) -> float:
        wheel = np.exp(-2j * math.pi * slip * turns)
        return float(sum((np.abs(whole @ wheel**order) ** 2).sum() for order in orders))

    def best(around: float, reach: float, orders: range) -> float:
        trials = around + np.linspace(-reach, reach, 2 * max(1, math.ceil(reach * revolutions * _TRIALS)) + 1)
        return float(max(trials, key=lambda slip: power(slip, orders)))

    bin_width = 1.0 / revolutions
    first = best(1.0, _SLIP, range(1, 2))
    if abs(first - 1.0) >= (1.0 - 1e-9) * _SLIP:
        raise InputError(f"{where}: [speed]: no line is within 2 % of it; state the speed of the record")
    near = best(first, 0.5 * bin_width, range(1, _HARMONICS + 1))
    step = bin_width / _TRIALS
    low, middle, high = (power(near + i * step, range(1, _HARMONICS + 1)) for i in (-1, 0, 1))
    bend = low - 2.0 * middle + high
    return near if bend >= 0.0 else near + 0.5 * step * (low - high) / bend


def _turned_by(waves: Floats, n: int, slip: float) -> Floats:
    """Return signals over the true angle of the shaft, whole revolutions of them."""
    size = math.floor((waves.shape[1] - 1) * slip / n) * n
    at = np.arange(size) / slip
    return np.stack([between(wave)(at) for wave in waves])
