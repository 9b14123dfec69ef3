"""What a page keeps of one case: a period of its waveforms, the lines of its spectra, its section."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from postproc.report.packing import pack_record, quantised, quantised_spectrum
from postproc.spectra import amplitude_spectrum, last_revolutions, samples_per_revolution, whole_periods
from postproc.units import scale_for
from rubhpc.schema import SECTION_NAMES, SIGNAL_NAMES, VARIABLES

if TYPE_CHECKING:
    from collections.abc import Collection

    from numpy.typing import NDArray

    Arrays = list[NDArray[np.uint16]]

_DISC = ("vertical", "horizontal")  # share their scale, so that an orbit is round where it is
_FLOOR = 1e-3  # of the highest line: those beyond the last one above it are left out
_LEAST_ORDER = 6.0


@dataclass(frozen=True, kw_only=True)
class Detail:
    """How much of a case is kept.

    Attributes
    ----------
    samples : int
        A revolution, at most.
    revolutions : int
        Of a motion without a period, at most; a periodic one needs no more than one period.
    lines : int
        Of a spectrum, at most.
    signals : tuple of str
    """

    samples: int
    revolutions: int
    lines: int
    signals: tuple[str, ...]

    def text(self, kept: Collection[str]) -> str:
        """What is kept of a store that has these roles, in words."""
        parts = []
        if "waveform" in kept:
            parts.append(
                f"waveforms of a period (two revolutions at least), or {self.revolutions} revolutions of a "
                f"motion without one, at most {self.samples} samples each (of forces, the highest of some)"
            )
        if {"waveform", "spectrum"} & set(kept):
            parts.append(f"spectra up to their last line above {_FLOOR:.1%}, at most {self.lines} lines")
        if {"waveform", "section"} & set(kept):
            parts.append("all section points")
        if self.signals != SIGNAL_NAMES:
            parts.append(f"only {', '.join(self.signals).replace('_', ' ')}")
        return "; ".join(parts)


FULL = Detail(samples=1024, revolutions=64, lines=8192, signals=SIGNAL_NAMES)
_MAIN = ("vertical", "horizontal", "torsion", "contact_force")
LEVELS = (  # of a page with a limited size, from the best
    Detail(samples=128, revolutions=32, lines=1024, signals=SIGNAL_NAMES),
    Detail(samples=64, revolutions=24, lines=512, signals=SIGNAL_NAMES),
    Detail(samples=128, revolutions=16, lines=512, signals=_MAIN),
    Detail(samples=64, revolutions=12, lines=256, signals=_MAIN),
    Detail(samples=64, revolutions=6, lines=160, signals=_MAIN[:3]),
)


def pack_case(case: xr.Dataset, detail: Detail, places: list[tuple[float, float]] | None = None) -> bytes:
    """Return one case, loaded, as a record for the page.

    What the store does not keep is left out; spectra are taken over whole periods where waveforms are kept.
    `places` are the stators around the disc, as of `stator_places`, where they are the case's own.
    """
    header: dict[str, Any] = {"waves": [], "spectra": [], "section": []}
    if places is not None:
        header["places"] = places
    arrays: Arrays = []
    waves = _stacked(case, [s for s in detail.signals if s in case], "sample")
    spectra = _stacked(case, [f"spectrum_{s}" for s in detail.signals if f"spectrum_{s}" in case], "order")
    if waves is not None:
        _add_waves(waves, case, detail, header, arrays)
        whole = whole_periods(waves, case.get("period"))
        if spectra is None or whole.sizes["sample"] < waves.sizes["sample"]:
            spectra = amplitude_spectrum(whole)
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
    revolutions = period * math.ceil(2 / period) if period > 0 else detail.revolutions
    kept = last_revolutions(waves, revolutions).values
    # Samples fall on whole revolutions only where their number divides those recorded.
    samples = max(n for n in range(1, min(detail.samples, recorded) + 1) if recorded % n == 0)
    held = kept.reshape(len(kept), -1, recorded // samples)
    header |= {"period": period, "samples": samples}
    disc = [
        np.abs(row).max() for row, name in zip(kept, waves["signal"].values, strict=True) if name in _DISC
    ]
    for groups, name, stator in _rows(held, waves):
        values = groups.max(axis=-1) if name == "contact_force" else groups[:, 0]
        size = float(max(disc)) if name in _DISC else float(np.abs(values).max())
        _add(header["waves"], arrays, values, name, stator, size)


def _add_spectra(spectra: xr.DataArray, detail: Detail, header: dict[str, Any], arrays: Arrays) -> None:
    orders = spectra["order"].values
    header["spacing"] = float(orders[1] - orders[0]) if orders.size > 1 else 1.0
    for amplitude, name, stator in _rows(np.nan_to_num(spectra.values), spectra):
        lines = amplitude[1:]  # the mean is no line
        last = np.flatnonzero(lines > _FLOOR * lines.max(initial=0.0))[-1:]
        least = math.ceil(_LEAST_ORDER / header["spacing"])
        lines = lines[: min(max([*(last + 1), least]), detail.lines)]
        scale = scale_for(VARIABLES[name].unit, float(lines.max(initial=0.0)))
        quantum, codes = quantised_spectrum(lines * scale.factor)
        header["spectra"].append({"name": name, "stator": stator, "unit": scale.unit, **quantum})
        arrays.append(codes)


def _add_sections(sections: xr.DataArray, header: dict[str, Any], arrays: Arrays) -> None:
    disc = [np.abs(row).max() for row, name, _ in _rows(sections.values, sections) if name in _DISC]
    for values, name, stator in _rows(sections.values, sections):
        size = float(max(disc)) if name in _DISC else float(np.abs(values).max())
        _add(header["section"], arrays, values, name, stator, size)


def _add(
    entries: list[dict[str, Any]],
    arrays: Arrays,
    values: NDArray[np.floating[Any]],
    name: str,
    stator: int,
    size: float,
) -> None:
    """Add an array in the display unit that suits `size`, SI."""
    scale = scale_for(VARIABLES[name].unit, size)
    quantum, codes = quantised(values * scale.factor)
    entries.append({"name": name, "stator": stator, "unit": scale.unit, "factor": scale.factor, **quantum})
    arrays.append(codes)


def _rows(values: NDArray[Any], stacked: xr.DataArray) -> list[tuple[NDArray[Any], str, int]]:
    names, stators = stacked["signal"].values.tolist(), stacked["stator"].values.tolist()
    return list(zip(values, names, stators, strict=True))
