"""Colours of measures, regimes, periods and statuses, the same in every figure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from postproc.store.units import in_words, plain_number, scale_of, short_name
from rubhpc.errors import InputError
from rubhpc.schema import (
    DIVERGED,
    FAILED,
    HAS_VALUES,
    MISSING,
    RECORD_END,
    REGIME,
    RUB_KIND,
    SCHEMES,
    SETTLED,
    STATUS,
    role_of,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from matplotlib.colors import Normalize
    from numpy.typing import NDArray

# Cases without a result: name, grey, hatch.
NOT_DONE = {
    MISSING: ("missing", "0.93", "...."),
    FAILED: ("failed", "0.8", "xxxx"),
    DIVERGED: ("diverged", "0.6", "////"),
}
REGIME_COLORS = ("#56B4E9", "#009E73", "#E69F00", "#D55E00", "#CC79A7")
_PERIOD_COLORS = ("#D55E00", "#88CCEE", "#332288", "#999933", "#CC79A7")  # none, P1 to P4
_SCHEME_COLORS = ("#56B4E9", "#E69F00", "#009E73", "#CC79A7", "#0072B2")
_FLAGS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "status": (STATUS, ("#ededed", "#009E73", "#000000", "#D55E00", "#B8DFD2")),
    "regime": (REGIME, REGIME_COLORS),
    "settled": (SETTLED, ("#D55E00", "#56B4E9")),
    "scheme": (SCHEMES, _SCHEME_COLORS),
    "record_end": (RECORD_END, _SCHEME_COLORS),
    "rub_kind": (RUB_KIND, ("#ededed", "#56B4E9", "#009E73", "#E69F00", "#D55E00")),
}
CATEGORIES = ("period", *_FLAGS)
# Motions that starts reach, by number; the contact-free one has the colour of its regime.
MOTION_COLORS = (
    *("#E69F00", "#009E73", "#CC79A7", "#0072B2", "#D55E00", "#F0E442", "#332288", "#999933", "#882255"),
)
NOT_SETTLED = in_words(SETTLED[0])
WARNING = "#D55E00"  # seen on the dark and on the light end of the colour bar


class Paint(NamedTuple):
    """How values become colours, the same on every panel."""

    cells: Callable[[NDArray[Any]], np.ma.MaskedArray[Any, Any]]  # values to what is drawn
    norm: Normalize
    cmap: Any
    label: str
    ticks: list[int] | None = None
    names: list[str] | None = None

    @property
    def has_bar(self) -> bool:
        """Whether colours need a scale: not those of a flag that no case has, nor of a single number."""
        return self.names != [] and self.constant is None

    @property
    def constant(self) -> str | None:
        """What is said instead of a scale, where a number is the same in all cases."""
        if self.names is not None or self.norm.vmin != self.norm.vmax:
            return None
        return f"{self.label}:\n{plain_number(self.norm.vmin or 0.0)} in all cases"

    def note(self, cells: np.ma.MaskedArray[Any, Any]) -> str | None:
        """Return what is written over a panel: the number that all its cases share, if that is zero."""
        if self.names is not None or not cells.count():
            return None
        return self.constant or ("0 in all cases" if not cells.any() else None)


def coloured(data: xr.Dataset, value: str) -> tuple[xr.DataArray, bool]:
    """Return the values that have a colour, and whether all have, being known before any case is done."""
    is_known = value == "status" or role_of(value) == "setting"
    return (data[value] if is_known else data[value].where(data["status"].isin(HAS_VALUES))), is_known


def paint_of(shown: xr.DataArray, log: bool) -> Paint:
    """Return how values become colours: those of a flag or a period distinct ones, others of a scale.

    InputError of a logarithmic scale for what has none, or where there is no value to show.
    """
    if log and shown.name in CATEGORIES:
        raise InputError(f"map: {shown.name} has no scale; draw it without --log")
    return _category_paint(shown) if shown.name in CATEGORIES else _scalar_paint(shown, log)


def categories(variable: str, codes: NDArray[np.integer]) -> dict[int, tuple[str, Any]]:
    """Return name and colour of each code of a flag, or of each period, that occurs; those below 0 do not."""
    import matplotlib

    present = [int(c) for c in np.unique(codes) if c >= 0]
    if variable == "period":
        # The short ones have colours of their own, the longer ones darken, and 0, none, is distinct.
        longer = [c for c in present if c >= len(_PERIOD_COLORS)]
        ramp = matplotlib.colormaps["Greys"](np.linspace(0.45, 1.0, max(len(longer), 2)))
        colors = {**dict(enumerate(_PERIOD_COLORS)), **dict(zip(longer, ramp, strict=False))}
        return {c: ("none" if c == 0 else f"P{c}", colors[c]) for c in present}
    meanings, palette = _FLAGS[variable]
    return {c: (in_words(meanings[c]), palette[c]) for c in present}


def _scalar_paint(shown: xr.DataArray, log: bool) -> Paint:
    from matplotlib.colors import LogNorm, Normalize

    scale = scale_of(shown)

    def cells(values: NDArray[Any]) -> np.ma.MaskedArray[Any, Any]:
        drawn = np.ma.masked_invalid(np.asarray(values, dtype=float) * scale.factor)
        return np.ma.masked_less_equal(drawn, 0.0) if log else drawn

    everything = cells(shown.values)
    if not np.isfinite(np.asarray(shown.values, dtype=float)).any():
        raise InputError(
            f"map: no selected case has a value of {shown.name}; run the study, or select other cases"
        )
    if everything.count() == 0:
        raise InputError(f"map: {shown.name} is nowhere positive; draw it without --log")
    limits = float(everything.min()), float(everything.max())
    norm = LogNorm(*limits) if log else Normalize(*limits)
    return Paint(cells, norm, "cividis", scale.label(short_name(shown)))


def _category_paint(shown: xr.DataArray) -> Paint:
    from matplotlib.colors import ListedColormap, Normalize

    def coded(values: NDArray[Any]) -> NDArray[np.int64]:
        codes: NDArray[np.int64] = np.nan_to_num(np.asarray(values, dtype=float), nan=-1).astype(np.int64)
        return codes

    known = categories(str(shown.name), coded(shown.values))
    present = list(known)

    def cells(values: NDArray[Any]) -> np.ma.MaskedArray[Any, Any]:
        codes = coded(values)
        return np.ma.masked_where(codes < 0, np.searchsorted(present, codes).clip(max=len(present) - 1))

    return Paint(
        cells,
        Normalize(-0.5, max(len(present), 1) - 0.5),
        ListedColormap([color for _, color in known.values()] or ["white"]),
        short_name(shown),
        list(range(len(present))),
        [name for name, _ in known.values()],
    )
