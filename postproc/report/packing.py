"""What a page keeps of a case, and its numbers as a page carries them; undone in the browser by `data.js`."""

from __future__ import annotations

import base64
import json
import math
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from postproc.signals.spectra import (
    amplitude_spectrum,
    last_revolutions,
    samples_per_revolution,
    whole_periods,
)
from rubhpc.schema import PROBE, SECTION_NAMES, SIGNAL_NAMES

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from postproc.store.rig_of_case import Place

    Arrays = list[NDArray[np.uint16]]

DECADES = 5.0  # of a spectrum, below its highest line; what is lower is not carried
STEPS = 65535  # of the range of a section
WAVE_STEPS = 4095  # of the range of a waveform: a figure is some 300 pixels high
RATIOS = 2047  # of a spectrum's decades: half a percent each
_DISC = ("vertical", "horizontal")  # of the orbit
# A spectrum is shown to the last line above that share of the highest, and a little further.
_FLOOR, _FURTHER = 0.02, 1.15
_LEAST_ORDER = 4.2


def pack_floats(values: ArrayLike) -> bytes:
    """Return numbers to four digits (12 bits, single precision), compressed; NaN stays NaN.

    Bytes of equal weight lie together, as zarr's shuffle has them, so that what is alike compresses.
    """
    with np.errstate(over="ignore"):  # infinite then
        bits = np.ascontiguousarray(values, dtype="<f4").ravel().view("<u4")
    # Rounding the significand of the largest NaN would make it a zero.
    rounded = np.where(bits & 0x7FFFFFFF > 0x7F800000, 0x7FC00000, bits + 0x400 & 0xFFFFF800).astype("<u4")
    return zlib.compress(rounded.view(np.uint8).reshape(-1, 4).T.tobytes(), 6)


def quantised(
    values: NDArray[np.floating[Any]], steps: int = STEPS
) -> tuple[dict[str, float], NDArray[np.uint16]]:
    """Return values in equal steps from the lowest to the highest, and what undoes it; n stays n."""
    low, high = float(values.min()), float(values.max())
    step = (high - low) / steps
    codes = np.rint((values.astype(float) - low) / step) if step > 0 else np.zeros(values.shape)
    return {"low": low, "step": step, "n": values.size}, codes.astype("<u2")


def bends(codes: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Return the second differences of `WAVE_STEPS`, from 0 on: small numbers where a curve is smooth.

    Negative integers alternate with the others: 0, -1, 1, -2, ...
    """
    second = np.diff(codes.astype(np.int64), n=2, prepend=[0, 0])
    return np.where(second < 0, -2 * second - 1, 2 * second).astype("<u2")


def quantised_spectrum(amplitude: NDArray[np.floating[Any]]) -> tuple[dict[str, float], NDArray[np.uint16]]:
    """Return amplitudes in 2047 equal ratios over five decades below the highest, and what undoes it.

    Lower lines are 0; the others are kept within 0.3 %.
    """
    top = float(amplitude.max(initial=0.0))
    codes = np.zeros(amplitude.shape)
    if top > 0:
        with np.errstate(divide="ignore"):
            codes = np.rint(RATIOS * (1 + np.log10(amplitude.astype(float) / top) / DECADES))
        codes = np.clip(codes, 0, RATIOS)
    return {"top": top, "n": amplitude.size}, codes.astype("<u2")


def pack_record(header: Mapping[str, Any], arrays: Sequence[NDArray[np.uint16]]) -> bytes:
    """Return a header and the arrays it describes as one compressed record.

    It has the header's length, the header as JSON, the low bytes of all arrays and then the high ones.
    """
    text = json.dumps(_shortened(header), separators=(",", ":"), allow_nan=False).encode()
    body = np.concatenate([*arrays, np.empty(0, "<u2")]).astype("<u2").view(np.uint8).reshape(-1, 2).T
    return zlib.compress(len(text).to_bytes(4, "little") + text + body.tobytes(), 9)


def _shortened(header: Any) -> Any:
    """Return the header with its numbers to nine digits."""
    if isinstance(header, float):
        return float(f"{header:.9g}")
    if isinstance(header, dict):
        return {name: _shortened(value) for name, value in header.items()}
    return [_shortened(value) for value in header] if isinstance(header, list | tuple) else header


def as_text(data: bytes) -> str:
    """Return bytes as a page carries them."""
    return base64.b64encode(data).decode()


@dataclass(frozen=True, kw_only=True)
class Detail:
    """How much of a case is kept, at most."""

    samples: int  # a revolution
    revolutions: int  # of the orbit of a motion without a period; a periodic one needs one period
    shown: int  # revolutions of the waveforms of such a motion: more of them would overlap
    lines: int  # of a spectrum
    signals: tuple[str, ...]

    def text(self, kept: Collection[str]) -> str:
        """Describe what is kept of a store that has these roles."""
        parts = []
        if "waveform" in kept:
            parts.append(
                f"waveforms of one period, two revolutions at least, with at most {self.samples} samples per "
                f"revolution (of forces, local maxima); for motions without a period, orbits of "
                f"{self.revolutions} and waveforms of {self.shown} revolutions"
            )
        if {"waveform", "spectrum"} & set(kept):
            parts.append(f"spectra up to their last line above {_FLOOR:.0%}, at most {self.lines} lines")
        if {"waveform", "section"} & set(kept):
            parts.append("all section points")
        if self.signals != SIGNAL_NAMES:
            parts.append(f"only {', '.join(self.signals).replace('_', ' ')}")
        return "; ".join(parts)


FULL = Detail(samples=1024, revolutions=64, shown=32, lines=8192, signals=SIGNAL_NAMES)
_MAIN = ("vertical", "horizontal", "torsion", "contact_force")
LEVELS = (  # of a page with a limited size, from the best
    Detail(samples=128, revolutions=24, shown=12, lines=1024, signals=SIGNAL_NAMES),
    Detail(samples=64, revolutions=16, shown=8, lines=512, signals=SIGNAL_NAMES),
    Detail(samples=64, revolutions=16, shown=8, lines=512, signals=_MAIN),
    Detail(samples=64, revolutions=8, shown=6, lines=256, signals=_MAIN),
    Detail(samples=64, revolutions=6, shown=4, lines=160, signals=_MAIN[:3]),
)


def pack_case(case: xr.Dataset, detail: Detail, places: list[Place] | None = None) -> bytes:
    """Return one case, loaded, as a record for the page.

    Values are SI. What the store does not keep is left out; spectra are taken over whole periods where
    waveforms are kept. `places` are the stators around the disc, as of `stator_places`, where they are the
    case's own.
    """
    header: dict[str, Any] = {"waves": [], "spectra": [], "section": []}
    if places is not None:
        header["places"] = places
    arrays: Arrays = []
    probes = [
        str(n).removeprefix("spectrum_")
        for n in case.data_vars
        if str(n).removeprefix("spectrum_")[:6] == PROBE
    ]
    signals = (*detail.signals, *dict.fromkeys(probes))
    waves = _stacked(case, [s for s in signals if s in case], "sample")
    if waves is not None:
        _add_waves(waves, case, detail, header, arrays)
        spectra: xr.DataArray | None = amplitude_spectrum(whole_periods(waves, case.get("period")))
    else:
        spectra = _stacked(case, [f"spectrum_{s}" for s in signals if f"spectrum_{s}" in case], "order")
    if spectra is not None:
        _add_spectra(spectra, detail, header, arrays)
    sections = _stacked(case, [f"section_{s}" for s in SECTION_NAMES if f"section_{s}" in case], "section")
    if sections is None and waves is not None:
        kept = [n for n in waves["signal"].values if n in SECTION_NAMES]
        sections = waves.sel(signal=kept).isel(sample=slice(None, None, samples_per_revolution(waves)))
    if sections is not None:
        _add_sections(sections, header, arrays)
    return pack_record(header, arrays)


def _stacked(case: xr.Dataset, names: list[str], dim: str) -> xr.DataArray | None:
    """Return variables of one case above one another, those of several stators one a stator; None of none."""
    rows: list[NDArray[np.floating[Any]]] = []
    labels: list[str] = []
    stators: list[int] = []
    for name in names:
        stored = case.variables[name]
        values = stored.values
        if not np.isfinite(values).all():  # a chunk that has been lost
            continue
        signal = name.removeprefix("spectrum_").removeprefix("section_")
        if "stator" in stored.dims:
            rows += list(values)
            labels += [signal] * len(values)
            stators += case["stator"].values.tolist()
        else:
            rows.append(values)
            labels.append(signal)
            stators.append(0)
    if not rows:
        return None
    coords: dict[str, Any] = {"signal": labels, "stator": ("signal", stators)}
    own = "revolution" if dim == "sample" else dim
    if own in case.variables:  # sections of the points of branches are not counted
        coords[own] = (dim, case.variables[own].values)
    return xr.DataArray(np.stack(rows), dims=("signal", dim), coords=coords)


def _add_waves(
    waves: xr.DataArray, case: xr.Dataset, detail: Detail, header: dict[str, Any], arrays: Arrays
) -> None:
    recorded = samples_per_revolution(waves)
    period = int(case["period"].values) if "period" in case else 0
    whole = period * math.ceil(2 / period) if period > 0 else 0
    kept = last_revolutions(waves, whole or detail.revolutions).values
    # Samples fall on whole revolutions only where their number divides those recorded.
    samples = max(n for n in range(1, min(detail.samples, recorded) + 1) if recorded % n == 0)
    held = kept.reshape(len(kept), -1, recorded // samples)
    shown = samples * (whole or detail.shown)
    header |= {"period": period, "samples": samples, "shown": whole or detail.shown}
    for groups, name, stator in _rows(held, waves):
        values = groups.max(axis=-1) if name == "contact_force" else groups[:, 0]
        quantum, codes = quantised(values if name in _DISC else values[-shown:], WAVE_STEPS)
        header["waves"].append({"name": name, "stator": stator, **quantum})
        arrays.append(bends(codes))


def _add_spectra(spectra: xr.DataArray, detail: Detail, header: dict[str, Any], arrays: Arrays) -> None:
    orders = spectra["order"].values
    header["spacing"] = float(orders[1] - orders[0]) if orders.size > 1 else 1.0
    least = math.ceil(_LEAST_ORDER / header["spacing"])
    for amplitude, name, stator in _rows(np.nan_to_num(spectra.values), spectra):
        lines = amplitude[1:]  # the mean is no line
        strong = np.flatnonzero(lines > _FLOOR * lines.max(initial=0.0)) + 1
        last = math.ceil(_FURTHER * strong.max(initial=0))
        quantum, codes = quantised_spectrum(lines[: min(max(last, least), detail.lines)])
        header["spectra"].append({"name": name, "stator": stator, **quantum})
        arrays.append(codes)


def _add_sections(sections: xr.DataArray, header: dict[str, Any], arrays: Arrays) -> None:
    for values, name, stator in _rows(sections.values, sections):
        quantum, codes = quantised(values, STEPS)
        header["section"].append({"name": name, "stator": stator, **quantum})
        arrays.append(codes)


def _rows(values: NDArray[Any], stacked: xr.DataArray) -> list[tuple[NDArray[Any], str, int]]:
    names, stators = stacked["signal"].values.tolist(), stacked["stator"].values.tolist()
    return list(zip(values, names, stators, strict=True))
