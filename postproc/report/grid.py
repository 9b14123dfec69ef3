"""The grid of a study and its measures, as the page needs them: names, units, cells and colours."""

from __future__ import annotations

import re
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.cases.maps import MAPPABLE, is_mappable, validity
from postproc.figures.cells import cell_edges, is_geometric
from postproc.figures.palette import CATEGORIES, categories
from postproc.store.attributes import table_of
from postproc.store.axes import axes_of, drawn_axes
from postproc.store.rig_of_case import unused_monitors
from postproc.store.select import worst_word
from postproc.store.units import displayed, meanings, short_name
from rubhpc.errors import RubError
from rubhpc.schema import DIVERGED, HAS_VALUES, PROBE, SIGNAL_NAMES, VARIABLES
from rubhpc.units import Scale, scale_for
from rubhpc.validity import MONITORS, words

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

# What is asked for most often: the first are offered first, and the last go first from a page that is small.
_FIRST = (
    "status",
    "validity",
    "regime",
    "peak_contact_force",
    "period",
    "settled",
    "peak_torsion",
    "clearance",
    "spin_speed",
    *MONITORS,
    "energy_residual",
    "contacts_per_revolution",
    "contact_fraction",
    "contact_duration",
    "peak_to_peak_vertical",
    "peak_to_peak_horizontal",
)
_WITHIN, *_BEYOND = ("#009E73", "#E69F00", "#56B4E9", "#CC79A7", "#F0E442", "#0072B2", "#D55E00", "#8C5A2B")
_MOTION = ("peak_to_peak_vertical", "peak_to_peak_horizontal")
# Measures of which all that is named has its unit.
_SHARED = (
    (_MOTION, (*_MOTION, "vertical", "horizontal", "stator_axial", "stator_lateral")),
    (("peak_torsion",), ("torsion",)),
    (("peak_contact_force",), ("contact_force",)),
)
_MATHTEXT = re.compile(r"\s*\$[^$]*\$")


class Measures:
    """Measures, flags and settings of every case, loaded; those of cases without a result are NaN."""

    def __init__(self, store: xr.Dataset) -> None:
        self._drawn = drawn_axes(store)
        store = store.assign(validity=validity(store)).reset_coords(self._drawn)
        of_probes = [n for n in map(str, store.data_vars) if n not in MAPPABLE and is_mappable(n)]
        names = [n for n in (*MAPPABLE, "validity", *of_probes, *self._drawn) if n in store.data_vars]
        names = [n for n in names if n not in _unused(store)]
        names.sort(key=lambda n: _FIRST.index(n) if n in _FIRST else len(_FIRST))
        self._data = store[names].load()
        self._dims = axes_of(store)
        self.names = tuple(names)
        self._has_result = np.isin(self._data["status"].values, (*HAS_VALUES, DIVERGED))

    def values(self, name: str) -> NDArray[np.float64]:
        """Return a variable in SI units over the axes, and the stators where it depends on them."""
        by_stator = self.is_by_stator(name)
        sizes = {dim: self._data.sizes[dim] for dim in (*self._dims, *(["stator"] if by_stator else []))}
        # Coordinates are left out: to align them with themselves takes most of the time of a page.
        whole = self._data[name].variable.set_dims(sizes)  # type: ignore[no-untyped-call]
        full: NDArray[np.float64] = whole.values.astype(float)
        if name != "status" and not self._is_setting(name):
            done = self._has_result[..., None] if by_stator else self._has_result
            full = np.where(done & ~self._is_fill(name, full), full, np.nan)
        return full

    def is_by_stator(self, name: str) -> bool:
        """Whether a variable depends on the stator."""
        return "stator" in self._data[name].dims

    def scale(self, name: str) -> Scale:
        """Return how the variable, or the signal, is displayed on the whole page.

        Its unit suits nine cases in ten; both directions of the disc, and the stators, have the same.
        """
        if name in ("spin_speed", "last_speed"):
            return Scale(30 / np.pi, "rpm")
        unit = VARIABLES[name].unit if name in SIGNAL_NAMES else self._unit(_measured(name))
        described = next((group for group, names in _SHARED if name in names), (_measured(name),))
        sizes = np.abs(
            np.concatenate([np.zeros(1), *(self.values(n).ravel() for n in described if n in self.names)])
        )
        sizes = sizes[np.isfinite(sizes) & (sizes > 0)]
        return scale_for(unit, float(np.quantile(sizes, 0.9)) if sizes.size else 0.0)

    def described_signals(self, store: xr.Dataset) -> dict[str, dict[str, Any]]:
        """Return name, unit and factor from SI of each signal that the store keeps anything of."""
        kept = {str(n).removeprefix("spectrum_").removeprefix("section_"): n for n in store.data_vars}
        described = {}
        for name in (*SIGNAL_NAMES, *(n for n in kept if n.startswith(PROBE))):
            if name in kept:
                scale = self.scale(name)
                label = plain(short_name(store[kept[name]].rename(name)))
                described[name] = {"label": label, "unit": scale.unit, "factor": scale.factor}
        return described

    def label(self, name: str) -> str:
        """Return what the variable is called."""
        return plain(short_name(self._data[name]))

    def described(self) -> list[dict[str, Any]]:
        """Return what the page has to know of each variable."""
        described = []
        for name in self.names:
            scale = self.scale(name)
            described.append(
                {
                    "name": name,
                    "label": self.label(name),
                    "unit": scale.unit,
                    "factor": scale.factor,
                    "by_stator": self.is_by_stator(name),
                    "worst": worst_word(name),
                    "is_setting": self._is_setting(name),
                    "is_flag": name in (*CATEGORIES, "validity"),
                    "categories": self._categories(name),
                }
            )
        return described

    def _unit(self, name: str) -> str:
        return str(self._data[name].attrs.get("units", "1"))

    def _is_setting(self, name: str) -> bool:
        return name in self._drawn or (name in VARIABLES and VARIABLES[name].role == "setting")

    def _is_fill(self, name: str, values: NDArray[np.float64]) -> NDArray[np.bool_]:
        is_integer = self._data[name].dtype.kind == "i"
        return (values == -1) if is_integer else np.zeros(values.shape, dtype=bool)

    def _categories(self, name: str) -> list[dict[str, Any]]:
        """Return code, name and colour of the values of a flag that occur; [] of what is no flag."""
        if name not in (*CATEGORIES, "validity"):
            return []
        from matplotlib.colors import to_hex

        values = self.values(name)
        codes = [int(c) for c in np.unique(values[np.isfinite(values)])]
        if name == "validity":
            beyond = cycle(_BEYOND)
            return [
                {"code": c, "name": validity_text(c), "color": next(beyond) if c else _WITHIN} for c in codes
            ]
        return [
            {"code": c, "name": text, "color": to_hex(color)}
            for c, (text, color) in categories(name, np.array(codes)).items()
        ]


def _unused(store: xr.Dataset) -> set[str]:
    """Return the monitors of what the rig does not have, which are not worth showing."""
    try:
        return unused_monitors(store)
    except RubError:  # the page says elsewhere that the rig cannot be read
        return set()


def _measured(name: str) -> str:
    """Name of the measure by whose size a signal of a probe is displayed; other names are their own."""
    return f"peak_to_peak_{name}" if name.startswith(PROBE) else name


def validity_text(code: int) -> str:
    """Name the limits of the model that a case breaks."""
    return words(code) or "within range"


def described_axes(store: xr.Dataset) -> list[dict[str, Any]]:
    """Return name, label, unit, values, cells and study key of each axis of the grid, in its order."""
    keys = list(table_of(store, "study").get("grid", {}))
    key_of = {key.replace(".", "_"): key for key in keys}
    described = []
    for dim in axes_of(store):
        axis = store[dim]
        shown, label = displayed(axis)
        name, _, unit = label.partition(" (")
        order = np.argsort(shown, kind="stable")
        described.append(
            {
                "name": dim,
                "key": key_of.get(dim, dim),
                "label": plain(name),
                "unit": unit.rstrip(")"),
                "values": shown.tolist(),
                "names": [meanings(axis)[int(v)] for v in axis.values] if meanings(axis) else [],
                "typed": [f"{v:.10g}" for v in np.asarray(axis.values, dtype=float)],
                "order": order.tolist(),
                "edges": cell_edges(shown[order]).tolist(),
                "is_log": is_geometric(shown[order]),
            }
        )
    return described


def plain(label: str) -> str:
    """Return a label without the symbols that only mathematical typesetting shows."""
    return _MATHTEXT.sub("", label).strip()
