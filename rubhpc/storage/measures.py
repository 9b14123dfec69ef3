"""The measures a store holds: listed by the store itself, packed into one binary record a case.

A store keeps the list it was made with. A measure added to the schema later is appended to the list when the
store is resumed, so the list of an older journal is a prefix of the store's. A measure that this version does
not know stays in the list.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.schema import VARIABLES, Variable, case_measures

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Measures = Sequence[Variable]

_STATOR = (
    "contact_fraction contacts_per_revolution contact_duration peak_contact_force contact_impulse "
    "friction_work minimum_slip_speed force_over_euler_load tip_deflection_ratio"
)
# Measures of every store whose manifest lists none: name, type and dimensions. Never to be changed.
_UNLISTED = (
    ("regime", "int8", ()),
    ("period", "int16", ()),
    ("lyapunov_exponent", "float64", ()),
    ("whirl_ratio", "float64", ()),
    *((name, "float64", ("stator",)) for name in _STATOR.split()),
    ("peak_torsion", "float64", ()),
    ("peak_to_peak_vertical", "float64", ()),
    ("peak_to_peak_horizontal", "float64", ()),
    ("energy_residual", "float64", ()),
    ("contact_iterations", "int64", ()),
    ("contact_residual", "float64", ()),
    ("transient_revolutions", "int64", ()),
    ("steps", "int64", ()),
    ("wall_time", "float64", ()),
)


def unlisted_measures() -> tuple[Variable, ...]:
    """Measures of a store whose manifest does not list them."""
    return tuple(
        VARIABLES.get(name) or Variable(name=name, role="measure", dims=dims, dtype=dtype, long_name=name)
        for name, dtype, dims in _UNLISTED
    )


def added_measures(stored: Measures) -> tuple[Variable, ...]:
    """Measures of the schema that are not among those stored."""
    names = {variable.name for variable in stored}
    return tuple(variable for variable in case_measures() if variable.name not in names)


def to_json(measures: Measures) -> list[dict[str, Any]]:
    """The measures as a manifest lists them: what is stored, not how it is shown."""
    return [{k: v for k, v in asdict(variable).items() if k != "worst"} for variable in measures]


def from_json(listed: list[dict[str, Any]]) -> tuple[Variable, ...]:
    """The measures that a manifest lists."""
    return tuple(
        Variable(**{**entry, "dims": tuple(entry["dims"]), "flags": tuple(entry["flags"])})
        for entry in listed
    )


def columns(measures: Measures, n_stator: int) -> list[list[Any]]:
    """Name, type and number of values (0: one, not along the stators) of each, as a journal lists them."""
    return [[v.name, v.dtype, n_stator if "stator" in v.dims else 0] for v in measures]


def record_type(listed: Sequence[Sequence[Any]]) -> np.dtype[np.void]:
    """Packed record of a case from such a list of columns."""
    return np.dtype([(name, np.dtype(kind).newbyteorder("<"), (n,) if n else ()) for name, kind, n in listed])


def measures_type(measures: Measures, n_stator: int) -> np.dtype[np.void]:
    """Packed record of the measures of a case."""
    return record_type(columns(measures, n_stator))


def missing_value(kind: np.dtype[Any]) -> float:
    """Value of a measure that a case does not have: NaN, or -1 in integers."""
    return np.nan if kind.base.kind == "f" else -1


def blank_records(shape: int | tuple[int, ...], kind: np.dtype[np.void]) -> NDArray[np.void]:
    """Records in which every measure is missing: NaN, or -1 in integers."""
    records = np.zeros(shape, kind)
    for name in kind.names or ():
        records[name] = missing_value(kind[name])
    return records


def converted(records: NDArray[np.void], kind: np.dtype[np.void]) -> NDArray[np.void]:
    """The records with the measures of another list; those they do not have are missing."""
    if records.dtype == kind:
        return records
    result = blank_records(records.shape, kind)
    for name in set(kind.names or ()) & set(records.dtype.names or ()):
        result[name] = records[name]
    return result
