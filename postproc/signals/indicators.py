"""Rub indicators: how measured vibration shows contact, under noise.

The paper proposes to detect rub from rotor and stator vibration together. Each indicator is a level in dB
that rises with rub and uses only what a test rig measures: both lateral motions of the disc, its torsion, the
lateral vibration of a stator. The contact force is never looked at.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from postproc.signals.sensors import Sensor
from postproc.signals.spectra import samples_per_revolution
from postproc.store.axes import axes_of, refusal, source
from postproc.store.rig_of_case import natural_frequencies, rig_axes, stator_frequencies
from postproc.store.select import narrow
from postproc.store.variables import require_results
from rubhpc.errors import InputError
from rubhpc.schema import DONE, REGIME

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Lines = NDArray[np.complex128]

INDICATORS = {
    "torsion_harmonics": "power density of torsion at multiples of 1/2X and 1/3X near its natural frequency",
    "lateral_subharmonics": "power density of whirl at 1/3X, 1/2X and 2/3X, forward and backward",
    "stator_resonance": "power of the stator's lateral vibration around its natural frequency",
    "contact_periodicity": "periodicity of the bursts of that vibration",
}
CHANNELS = ("vertical", "horizontal", "torsion", "stator_lateral")
LEVELS = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0)
_WHOLE = 6  # revolutions that hold whole periods of half and of third orders
_SUBHARMONICS = (1 / 3, 1 / 2, 2 / 3)
_BENIGN = (1, 2, 3)  # multiples of 1X that misalignment, a drive or the floor bring in without rub
_BANDWIDTH = 1000.0  # Hz in which white noise has the rms that its level says
_BAND = 0.3  # half width of the stator's band, over its natural frequency
_BURSTS = (1 / 3, 1 / 2, 2 / 3, 1.0, 2.0)  # orders at which bursts repeat
_SMALLEST = 1e-300  # power of a line that is exactly zero, of which there is no logarithm


class Noise(NamedTuple):
    """Measurement noise, added to every channel; see `indicator_scores`."""

    levels: Floats  # (n_level,)
    n_draw: int
    seed: int


def indicator_scores(
    store: xr.Dataset, levels: Sequence[float] = LEVELS, n_draw: int = 3, seed: int = 1
) -> xr.Dataset:
    """Return the indicators of every case of a store under measurement noise; lazy.

    Noise of level 1 is, in each channel, white Gaussian noise whose rms in 1 kHz is that channel's median
    vibration over the cases that touch, and, as strong again, benign harmonics: random 1X, 2X and 3X such as
    misalignment or a drive bring in (`sensors.Sensor`). A case's draws depend on `seed` and its place in the
    study only, and are the same at all levels.

    Parameters
    ----------
    store : Dataset
        Waveforms of many cases, some of which touch and some of which do not. Of several stators, an
        indicator is that of the one where it is highest.
    levels : sequence of float
        Of the noise, above 0.
    n_draw : int
        Draws of the noise for each case.

    Returns
    -------
    Dataset over (axes, level, draw)
        The four indicators in dB of SI units squared, for densities a hertz (NaN where a case is not done); a
        density lets white noise read the same however long a revolution takes. Over the axes `rub`, whether
        the case touches; over `channel` `reference`, the rms that corresponds to a level of 1.

    Raises
    ------
    InputError
        No waveforms, no case that touches or none that does not, or sampling too coarse for the stator.
    """
    noise = Noise(np.asarray(levels, dtype=float), n_draw, seed)
    if noise.levels.size == 0 or not (noise.levels > 0).all() or n_draw < 1:
        raise InputError(
            f"levels: {list(levels)}, draws: {n_draw}: give levels above 0 and at least one draw"
        )
    axes = axes_of(store)
    spread = [*axes, "stator"] if store.sizes.get("stator", 1) > 1 else axes
    data = narrow(store, [*CHANNELS, "regime", "spin_speed", "status"], spread)
    data = data.assign({n: data[n].compute() for n in ("regime", "spin_speed", "status")})
    is_done = data["status"] == DONE
    require_results(is_done.where(is_done), store)
    is_free = data["regime"] == REGIME.index("no_contact")  # of all stators, whichever is looked at
    rub, free = is_done & ~is_free, is_done & is_free
    for mask, kind, fix in (
        (rub, "touches", "take smaller clearances"),
        (free, "stays free of contact", "take clearances above the contact-free amplitude"),
    ):
        if not mask.any():
            raise refusal(store, f"no selected case {kind}; {fix} into the study")
    n = samples_per_revolution(data[CHANNELS[0]])
    n_turn = data.sizes["sample"] // n
    data = data.isel(sample=slice(-n * (n_turn // _WHOLE * _WHOLE or n_turn), None))
    frequencies = _natural(data)
    highest = (1 + _BAND) * frequencies["stator"] / (data["spin_speed"] / (2 * math.pi))
    if float(highest.max()) >= n / 2:
        least = math.ceil(2 * float(highest.max())) + 1
        raise refusal(
            store,
            f"{n} samples a revolution do not resolve the stator's vibration at the lowest "
            f"speed; use at least {least}, or select faster cases",
        )
    reference = [float(rms_about_mean(data[name]).where(rub).median()) for name in CHANNELS]
    waves = [data[name] for name in CHANNELS]
    if "stator" not in data.dims:
        waves[-1] = waves[-1].expand_dims("stator")
        frequencies["stator"] = frequencies["stator"].expand_dims("stator")
    place = xr.DataArray(np.arange(rub.size).reshape(rub.shape), dims=rub.dims, coords=rub.coords)
    if data[CHANNELS[0]].chunks is not None:  # blocks of cases as they lie on disk, each with whole records
        place = place.chunk({d: data[CHANNELS[0]].chunksizes[d] for d in axes})
    found: xr.DataArray = xr.apply_ufunc(
        _of_case,
        *waves,
        place,
        data["spin_speed"],
        frequencies["torsion"],
        frequencies["stator"],
        input_core_dims=[*[["sample"]] * 3, ["stator", "sample"], *[[]] * 3, ["stator"]],
        output_core_dims=[["indicator", "level", "draw"]],
        vectorize=True,
        dask="parallelized",
        output_dtypes=[float],
        kwargs={"n": n, "reference": reference, "noise": noise},
        dask_gufunc_kwargs={
            "allow_rechunk": True,
            "output_sizes": {"indicator": len(INDICATORS), "level": noise.levels.size, "draw": n_draw},
        },
    )
    scores = xr.Dataset(
        {
            name: found.isel(indicator=i).assign_attrs(units="dB", long_name=text)
            for i, (name, text) in enumerate(INDICATORS.items())
        },
        attrs=store.attrs,
    ).assign(rub=rub.assign_attrs(units="1", long_name="touches"), reference=("channel", reference))
    scores.encoding["source"] = source(store)
    return scores.assign_coords(
        level=("level", noise.levels, {"units": "1", "long_name": "noise level"}),
        channel=("channel", list(CHANNELS)),
    )


def _natural(data: xr.Dataset) -> dict[str, xr.DataArray]:
    """Return the natural frequencies of torsion and of the stator, Hz, along what sets the rig, if any."""
    keys = [data[key] for key in rig_axes(data) if key in data.coords]
    along = list(dict.fromkeys(str(dim) for key in keys if key.size > 1 for dim in key.dims))
    if len(along) > 1:
        raise refusal(data, f"select one value of {' or of '.join(along)}")
    axis = along[0] if along else None
    rotor = natural_frequencies(data, axis)
    each = [data.isel(stator=i) for i in range(data.sizes["stator"])] if "stator" in data.dims else [data]
    stators = [stator_frequencies(case, axis) for case in each]
    if "torsional" not in rotor or any("lateral" not in stator for stator in stators):
        raise refusal(data, "no natural frequency of torsion or stator; use another rig")
    lateral = [stator["lateral"] for stator in stators]
    stator = xr.concat(lateral, "stator") if "stator" in data.dims else lateral[0]
    return {"torsion": rotor["torsional"], "stator": stator}


def rms_about_mean(wave: xr.DataArray) -> xr.DataArray:
    """Return the rms of a signal (..., sample) about its mean, of several stators the largest; loaded."""
    swing = wave.astype(float) - wave.mean("sample", dtype=float)
    rms: xr.DataArray = (swing**2).mean("sample") ** 0.5  # `std` of a case without a result warns
    return rms.max([d for d in ("stator",) if d in wave.dims]).compute()


def _of_case(
    vertical: NDArray[np.floating[Any]],
    horizontal: NDArray[np.floating[Any]],
    torsion: NDArray[np.floating[Any]],
    lateral: NDArray[np.floating[Any]],
    place: int,
    spin: float,
    torsion_frequency: float,
    stator_frequency: Floats,
    *,
    n: int,
    reference: Sequence[float],
    noise: Noise,
) -> Floats:
    """Indicators of one case, (n_indicator, n_level, n_draw); `lateral` is (n_stator, n_sample)."""
    if not np.isfinite(torsion).all():
        return np.full((len(INDICATORS), noise.levels.size, noise.n_draw), math.nan)
    n_sample, n_turn, rate = torsion.size, torsion.size // n, float(spin) / (2 * math.pi)
    spacing = rate / n_turn  # Hz from line to line
    rng = np.random.default_rng([noise.seed, int(place)])
    turns = np.arange(n_sample) / n
    sizes = [*reference, *[reference[-1]] * (len(lateral) - 1)]
    added = [_noise(turns, n * rate, size, noise.n_draw, rng) for size in sizes]

    def lines_of(wave: NDArray[Any], drawn: Floats, at: NDArray[np.intp]) -> Lines:
        """Lines of a wave under noise, (n_level, n_draw, n_line): two-sided of a complex one."""
        fft, unit = (np.fft.fft, 1.0) if np.iscomplexobj(wave) else (np.fft.rfft, math.sqrt(2))
        own, other = (fft(one, axis=-1)[..., at] * (unit / n_sample) for one in (wave, drawn))
        return np.asarray(own + noise.levels[:, None, None] * other)

    whirl = vertical + 1j * horizontal.astype(float)
    whirling = lines_of(whirl, added[0] + 1j * added[1], _whirl_lines(n_turn, n_sample))
    twisting = lines_of(torsion.astype(float), added[2], _twist_lines(torsion_frequency / rate, n_turn))
    shaking = [
        lines_of(wave.astype(float), drawn, _band_lines(frequency / rate, n_turn))
        for wave, drawn, frequency in zip(lateral, added[3:], stator_frequency, strict=True)
    ]
    return np.array(
        [
            _decibels(_power(twisting) / spacing),
            _decibels(_power(whirling) / spacing),
            np.max([_decibels(_power(band)) for band in shaking], axis=0),
            np.max([_burst_level(band, n_turn) for band in shaking], axis=0),
        ]
    )


def _noise(turns: Floats, rate: float, size: float, n_draw: int, rng: np.random.Generator) -> Floats:
    """Return what sensors add at level 1 to a channel of vibration with an rms of `size`, (n_draw, n_sample).

    White noise and, shared evenly on the average, benign harmonics, whose amplitudes differ as well as their
    phases. `rate` is that of the samples, Hz.
    """
    draws = []
    for _ in range(n_draw):
        benign = rng.standard_normal((len(_BENIGN), 2)) @ (1.0, 1j) * (size / math.sqrt(len(_BENIGN)))
        run_out = tuple(zip(_BENIGN, np.abs(benign).tolist(), np.angle(benign).tolist(), strict=True))
        sensor = Sensor(white=size * math.sqrt(0.5 * rate / _BANDWIDTH), run_out=run_out)
        draws.append(sensor.after_clock(sensor.before_clock(np.zeros(turns.size), turns, rate), rng))
    return np.array(draws)


def _twist_lines(natural: float, n_turn: int) -> NDArray[np.intp]:
    """Return the lines at multiples of 1/2X and 1/3X within 1X of a natural frequency (in orders)."""
    sixths = np.arange(1, math.ceil(6 * (natural + 1)))
    sixths = sixths[(abs(sixths / 6 - natural) <= 1) & ((sixths % 2 == 0) | (sixths % 3 == 0))]
    return np.unique(np.rint(sixths / 6 * n_turn).astype(np.intp))


def _whirl_lines(n_turn: int, n_sample: int) -> NDArray[np.intp]:
    """Return the lines of the whirl at 1/3X, 1/2X and 2/3X, forward, then backward."""
    forward = np.rint(np.array(_SUBHARMONICS) * n_turn).astype(np.intp)
    return np.concatenate((forward, n_sample - forward))


def _band_lines(natural: float, n_turn: int) -> NDArray[np.intp]:
    """Return the lines of the stator's band around its natural frequency (in orders)."""
    low, high = ((1 + side * _BAND) * natural * n_turn for side in (-1, 1))
    return np.arange(max(1, math.ceil(low)), math.floor(high) + 1)


def _power(lines: Lines) -> Floats:
    """(..., n_line) -> (...), the mean square of what they make up."""
    power: Floats = np.sum(np.abs(lines) ** 2, axis=-1)
    return power


def _burst_level(band: Lines, n_turn: int) -> Floats:
    """Return the level (dB) of the envelope's lines at the orders of bursts over its other lines.

    The lines of a band, taken as those of a slow complex signal, are its envelope; its squared magnitude is
    zero-padded so that it is not aliased.
    """
    n_fast = 2 * band.shape[-1]
    envelope = np.abs(np.fft.ifft(band, n=n_fast, axis=-1)) ** 2
    lines = np.abs(np.fft.rfft(envelope, axis=-1)) ** 2
    wanted = np.rint(np.array(_BURSTS) * n_turn).astype(np.intp)
    wanted = wanted[wanted < lines.shape[-1]]
    floor = np.median(lines[..., 1 : min(int(2.5 * n_turn), lines.shape[-1])], axis=-1)
    level: Floats = _decibels(lines[..., wanted].max(axis=-1)) - _decibels(floor)
    return level


def _decibels(power: Floats) -> Floats:
    level: Floats = 10 * np.log10(np.maximum(power, _SMALLEST))
    return level
