"""The columns of a data set: parameters and labels of cases, and what each window has besides."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from postproc.cases.maps import validity
from postproc.store.axes import axes_of
from postproc.store.case_table import case_table
from postproc.store.run_ups import is_run_up
from rubhpc.schema import VARIABLES
from rubhpc.study.sampling import CASE
from rubhpc.validity import words

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

INT, FLOAT, FLAG, TEXT, WAVE = "int64", "float64", "bool", "string", "float32"
_SETTINGS = ("spin_speed", "clearance", "contact_free_amplitude")
LABELS = (
    *("regime", "period", "settled", "contact_fraction", "contacts_per_revolution", "contact_duration"),
    *("peak_contact_force", "contact_impulse", "friction_work"),
)
# Of a run-up, over the revolutions that a window touches: where each is stored, and its meaning.
OF_REVOLUTIONS = {
    "contact_fraction": ("revolution_contact_fraction", "fraction of these revolutions in contact"),
    "peak_contact_force": ("revolution_peak_contact_force", "peak contact force in these revolutions"),
    "friction_work": ("revolution_friction_work", "work of friction per revolution, mean of these"),
}


class Column(NamedTuple):
    """A column of the table of windows: its type, SI unit and meaning."""

    name: str
    kind: str
    unit: str
    meaning: str


@dataclass(frozen=True, kw_only=True)
class CaseColumns:
    """What is known of each case, in the order of the grid."""

    columns: list[Column]  # parameters, labels, and which limits of the model a case leaves
    values: dict[str, NDArray[Any]]  # of the columns, (n_case,)
    parameters: dict[str, NDArray[Any]]  # what was varied, (n_case,)
    touches: NDArray[np.bool_]  # whether there is any contact, (n_case,)

    def of(self, i: int) -> dict[str, Any]:
        """Return the values of a case, None where there is none."""
        found: dict[str, Any] = {}
        for column in self.columns:
            value = self.values[column.name][i]
            is_missing = isinstance(value, float) and math.isnan(value)
            found[column.name] = None if is_missing else int(value) if column.kind == INT else value
        return found


def case_columns(store: xr.Dataset) -> CaseColumns:
    """Return parameters and labels of the cases of a store; of several stators a label is that of the worst.

    Labels of run-ups are those of windows alone.
    """
    wanted = ("clearance",) if is_run_up(store) else (*_SETTINGS, *LABELS)
    axes = [str(axis) for axis in axes_of(store) if axis != CASE]
    names = [name for name in wanted if name in store.data_vars and name not in axes]
    table = case_table(store, names or ["status"])
    table = table.drop_vars([name for name in ("status", CASE) if name in table])
    varied = [n for n in (*axes, *map(str, store.coords)) if n in table and n not in names]
    parameters = {name: table[name].values for name in varied}
    columns, values = [], {}
    for name, column in table.items():
        of_schema = VARIABLES.get(str(name))
        is_int = of_schema is not None and of_schema.dtype.startswith("int")
        kind = TEXT if column.dtype == object else INT if is_int else FLOAT
        unit = column.attrs.get("units", "1") if kind != TEXT else ""
        columns.append(Column(str(name), kind, unit, column.attrs.get("long_name", str(name))))
        values[str(name)] = column.values
    codes = validity(store).transpose(*axes_of(store)).values.ravel()
    values["out_of_range"] = np.array([words(code) for code in codes.tolist()], dtype=object)
    columns.append(Column("out_of_range", TEXT, "", "limits of the model that the case leaves (empty: none)"))
    force = store["peak_contact_force"]
    peak = force.max([dim for dim in ("stator",) if dim in force.dims]).transpose(*axes_of(store))
    return CaseColumns(columns=columns, values=values, parameters=parameters, touches=peak.values.ravel() > 0)


def window_columns(store: xr.Dataset, signals: dict[str, xr.DataArray], *, has_levels: bool) -> list[Column]:
    """Return the columns of a window before those of its case."""
    found = [
        Column("case", INT, "1", "number of the case in the selected grid, from 0"),
        Column("draw", INT, "1", "number of the draw of place and noise, from 0"),
        *([Column("noise", FLOAT, "1", "rms of white noise over the reference of each signal")] * has_levels),
        Column("start", FLOAT, "s", "first sample, from the beginning of the record"),
        Column("rate", FLOAT, "Hz", "sampling rate"),
    ]
    for name, signal in signals.items():
        unit, meaning = (str(signal.attrs.get(*about)) for about in (("units", "1"), ("long_name", name)))
        found.append(Column(name, WAVE, unit, meaning))
    found += [
        Column("key_phasor", WAVE, "V", "key-phasor, a pulse a revolution"),
        Column("contact", FLAG, "", "whether any stator is touched within the window"),
        Column("window_contact_fraction", FLOAT, "1", "fraction of the window with a contact"),
    ]
    if is_run_up(store):
        found.append(Column("spin_speed", FLOAT, "rad s-1", "mean speed of the window"))
        for name, (stored, meaning) in OF_REVOLUTIONS.items():
            if stored in store:
                found.append(Column(name, FLOAT, VARIABLES[name].unit, meaning))
    return found
