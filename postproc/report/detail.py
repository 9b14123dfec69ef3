"""What a page keeps of one case: a period of its waveforms, the lines of its spectra, its section."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from postproc.report.packing import STEPS, WAVE_STEPS, bends, pack_record, quantised, quantised_spectrum
from postproc.signals.spectra import (
    amplitude_spectrum,
    last_revolutions,
    samples_per_revolution,
    whole_periods,
)
from rubhpc.schema import PROBE, SECTION_NAMES, SIGNAL_NAMES

if TYPE_CHECKING:
    from collections.abc import Collection

    from numpy.typing import NDArray

    Arrays = list[NDArray[np.uint16]]

_DISC = ("vertical", "horizontal")  # of the orbit
# A spectrum is shown to the last line above that share of the highest, and a little further.
_FLOOR, _FURTHER = 0.02, 1.15
_LEAST_ORDER = 4.2


@dataclass(frozen=True, kw_only=True)
class Detail:
    """How much of a case is kept.

    Attributes
    ----------
    samples : int
        A revolution, at most.
    revolutions : int
        Of the orbit of a motion without a period, at most; a periodic one needs no more than one period.
    shown : int
        Of the waveforms of such a motion, at most: more of them would overlap.
    lines : int
        Of a spectrum, at most.
    signals : tuple of str
    """

    samples: int
    revolutions: int
    shown: int
    lines: int
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


def pack_case(case: xr.Dataset, detail: Detail, places: list[tuple[float, ...]] | None = None) -> bytes:
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
