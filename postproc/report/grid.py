"""The grid of a study and its measures, as the page is told of them: names, units, cells and colours."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from postproc.cells import cell_edges, is_geometric
from postproc.load import axes_of
from postproc.map_figure import REGIME_COLORS, STATUS_COLORS
from postproc.maps import MAPPABLE, VALIDITY, validity
from postproc.units import Scale, displayed, scale_of, short_name
from rubhpc.schema import DIVERGED, DONE, REGIME, STATUS, VARIABLES

if TYPE_CHECKING:
    from numpy.typing import NDArray

# What is asked for most often: the first are offered first, and the last go first from a page that is small.
_FIRST = (
    "status",
    "validity",
    "regime",
    "peak_contact_force",
    "period",
    "peak_torsion",
    "clearance",
    "spin_speed",
    *VALIDITY,
    "energy_residual",
    "contacts_per_revolution",
    "contact_fraction",
    "contact_duration",
    "peak_to_peak_vertical",
    "peak_to_peak_horizontal",
)
_FLAGS = ("status", "regime", "period", "validity")
_NO_PERIOD = "#D55E00"
_WITHIN, *_BEYOND = ("#009E73", "#E69F00", "#56B4E9", "#CC79A7", "#F0E442", "#0072B2", "#D55E00", "#8C5A2B")
_MATHTEXT = re.compile(r"\s*\$[^$]*\$")


class Measures:
    """Scalars, flags and settings of every case, loaded; those of cases without a result are NaN."""

    def __init__(self, store: xr.Dataset) -> None:
        store = store.assign(validity=validity(store))
        names = [n for n in (*MAPPABLE, "validity") if n in store.data_vars]
        names.sort(key=lambda n: _FIRST.index(n) if n in _FIRST else len(_FIRST))
        self._data = store[names].load()
        self._dims = axes_of(store)
        self.names = tuple(names)
        self._has_result = np.isin(self._data["status"].values, (DONE, DIVERGED))

    def values(self, name: str) -> NDArray[np.float64]:
        """Return a variable in SI units over the axes, and the stators where it tells them apart."""
        data = self._data[name]
        by_stator = self.is_by_stator(name)
        dims = (*self._dims, *(("stator",) if by_stator else ()))
        full = data.broadcast_like(self._data["status"]).transpose(*dims).values.astype(float)
        if name != "status" and not self._is_setting(name):
            done = self._has_result[..., None] if by_stator else self._has_result
            full = np.where(done & ~self._is_fill(name, full), full, np.nan)
        return full

    def is_by_stator(self, name: str) -> bool:
        """Whether a variable tells the stators apart."""
        return "stator" in self._data[name].dims

    def scale(self, name: str) -> Scale:
        """Return how the variable is displayed on the whole page."""
        if name == "spin_speed":
            return Scale(30 / np.pi, "rpm")
        return scale_of(xr.DataArray(self.values(name)), self._unit(name))

    def label(self, name: str) -> str:
        """Return what the variable is called."""
        return plain(short_name(self._data[name]))

    def described(self) -> list[dict[str, Any]]:
        """Return what the page has to know of each variable."""
        told = []
        for name in self.names:
            scale = self.scale(name)
            told.append(
                {
                    "name": name,
                    "label": self.label(name),
                    "unit": scale.unit,
                    "factor": scale.factor,
                    "by_stator": self.is_by_stator(name),
                    "is_setting": self._is_setting(name),
                    "is_flag": name in _FLAGS,
                    "categories": self._categories(name),
                }
            )
        return told

    def _unit(self, name: str) -> str:
        return str(self._data[name].attrs.get("units", "1"))

    def _is_setting(self, name: str) -> bool:
        return name in VARIABLES and VARIABLES[name].role == "setting"

    def _is_fill(self, name: str, values: NDArray[np.float64]) -> NDArray[np.bool_]:
        is_integer = name in VARIABLES and VARIABLES[name].dtype.startswith("int")
        return (values == -1) if is_integer else np.zeros(values.shape, dtype=bool)

    def _categories(self, name: str) -> list[dict[str, Any]]:
        """Return code, name and colour of the values of a flag that occur; [] of what is no flag."""
        if name not in _FLAGS:
            return []
        values = self.values(name)
        codes = [int(c) for c in np.unique(values[np.isfinite(values)])]
        if name == "validity":
            beyond = iter(_BEYOND)
            return [
                {"code": c, "name": validity_text(c), "color": next(beyond) if c else _WITHIN} for c in codes
            ]
        if name == "period":
            return [{"code": c, "name": f"{c}" if c else "none", "color": _period_color(c)} for c in codes]
        meanings, colors = (STATUS, STATUS_COLORS) if name == "status" else (REGIME, REGIME_COLORS)
        return [
            {
                "code": c,
                "name": meanings[c].replace("_", "-" if c == 2 else " "),
                "color": colors[c % len(colors)],
            }
            for c in codes
        ]


def validity_text(code: int) -> str:
    """Name the limits of the model that a case breaks."""
    return ", ".join(text for bit, text, _ in VALIDITY.values() if code & bit) or "within range"


def axes_told(store: xr.Dataset) -> list[dict[str, Any]]:
    """Return name, label, unit, values, cells and study key of each axis of the grid, in its order."""
    study = store.attrs.get("study")
    keys = list(study.get("grid", {})) if isinstance(study, dict) else []
    key_of = {key.replace(".", "_"): key for key in keys}
    told = []
    for dim in axes_of(store):
        axis = store[dim]
        shown, label = displayed(axis)
        name, _, unit = label.partition(" (")
        order = np.argsort(shown, kind="stable")
        told.append(
            {
                "name": dim,
                "key": key_of.get(dim, dim),
                "label": plain(name),
                "unit": unit.rstrip(")"),
                "values": shown.tolist(),
                "typed": [f"{v:.10g}" for v in np.asarray(axis.values, dtype=float)],
                "order": order.tolist(),
                "edges": cell_edges(shown[order]).tolist(),
                "is_log": is_geometric(shown[order]),
            }
        )
    return told


def plain(label: str) -> str:
    """Return a label without the symbols that only mathematical typesetting shows."""
    return _MATHTEXT.sub("", label).strip()


def _period_color(period: int) -> str:
    """Longer periods are darker; none is a colour apart."""
    if period == 0:
        return _NO_PERIOD
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return to_hex(colormaps["viridis_r"](0.05 + 0.75 * min(period - 1, 8) / 8))
