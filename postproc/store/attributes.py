"""Attributes of an opened store: checked, as it may come from anybody, and such that any file takes them.

Tables (study, rig, versions) are text in JSON, as netCDF and HDF5 know no others; `table_of` reads them.
"""

from __future__ import annotations

import dataclasses
import json
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.errors import InputError, StoreError, printable
from rubhpc.input.fields import key_of, parse_field
from rubhpc.rig.probes import Probe
from rubhpc.study.contact_keys import ContactKeys
from rubhpc.study.drive_keys import DriveKeys
from rubhpc.study.initial import Initial
from rubhpc.study.run_up_keys import RunUpKeys
from rubhpc.study.tables import Integrator, Recording

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import xarray as xr

MEASURED = "measured"  # attribute of what was measured: the file with the data
_OF_ROOT = ("study", "rig", "versions")  # tables
_TEXTS = ("units", "long_name", "flag_meanings")  # of arrays
_FILL = "_FillValue"  # which xarray adds to a copy
_CODED = ("scale_factor", "add_offset", "missing_value", "dtype", "_Unsigned")  # as no array of a store is
KEYS: dict[str, type] = {  # of the tables of a study
    "run_up": RunUpKeys,
    "drive": DriveKeys,
    "contact": ContactKeys,
    "integrator": Integrator,
    "record": Recording,
    "probe": Probe,
    "initial": Initial,
}
_NUMBERS, _LARGEST = (int, float), 2.0**63


def table_of(store: xr.Dataset, name: str) -> dict[str, Any]:
    """Return a table among the attributes of a store, "study" or "rig"; {} where it has none."""
    held = store.attrs.get(name)
    table = _parsed(held) if isinstance(held, str) else held
    return table if isinstance(table, dict) else {}


def with_sound_attributes(store: xr.Dataset, path: Path) -> xr.Dataset:
    """Return a store whose attributes are numbers, lists of them, and printable texts; lazily, as it was.

    StoreError where they are of other types than a run writes, or values of an axis have no meaning.
    """
    try:
        attributes = {name: _parsed(v) if name in _OF_ROOT else v for name, v in store.attrs.items()}
        _check_root(attributes)
        found = store.assign_attrs(_clean(attributes))
        for name, array in found.variables.items():
            _check_array(str(name), array)
            array.attrs = _clean(array.attrs)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError, InputError) as error:
        reason = printable(str(error))[:160]
        raise StoreError(f"{path}: its attributes are not those of a store ({reason}); get it anew") from None
    return found


@lru_cache(maxsize=8)
def _of_text(text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None


def _parsed(table: Any) -> Any:
    return _of_text(table) if isinstance(table, str) else table


def _clean(attributes: dict[str, Any]) -> dict[str, Any]:
    """Return attributes as they can be printed, and written to any file."""
    return {printable(str(name)): _plain(value) for name, value in attributes.items() if name != _FILL}


def _plain(value: Any) -> Any:
    if isinstance(value, str):
        return printable(value)
    if _are_numbers(value if isinstance(value, list | tuple) else [value]):
        return value
    return json.dumps(_printable(value), ensure_ascii=False)


def _printable(value: Any) -> Any:
    """Return a table whose texts are without control characters."""
    if isinstance(value, dict):
        return {printable(str(key)): _printable(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple) and not _are_numbers(value):
        return [_printable(entry) for entry in value]
    return printable(value) if isinstance(value, str) else value


def _are_numbers(values: Sequence[Any]) -> bool:
    return bool(values) and all(type(v) in _NUMBERS and abs(v) < _LARGEST for v in values)


def _check_array(name: str, array: xr.Variable) -> None:
    for key in _TEXTS:
        if not isinstance(array.attrs.get(key, ""), str):
            raise TypeError(f"{key} of {name} is no text")
    for key in ("units", "long_name"):
        if "$" in array.attrs.get(key, ""):
            raise ValueError(f"{key} of {name} is a formula")
    if coded := [key for key in _CODED if key in array.attrs]:
        raise ValueError(f"{name} is coded by {coded[0]}")
    words = array.attrs.get("flag_meanings", "").split()
    if words and not array.chunks and not np.isin(array.values, np.arange(len(words))).all():
        raise ValueError(f"{name} has values without a meaning")


def _check_root(attributes: dict[str, Any]) -> None:
    study, rig, versions = (attributes.get(name, {}) for name in _OF_ROOT)
    if not all(isinstance(table, dict) for table in (study, rig, versions)):
        raise TypeError(f"{', '.join(_OF_ROOT)} are no tables")
    for text in (rig.get("name", ""), attributes.get("title", ""), *versions.values()):
        if not isinstance(text, str):
            raise TypeError("a name or a version is no text")
    for name, about in study.get("grid", {}).items():
        values = about.get("values", [about.get("start", 0), about.get("stop", 0)])
        if not isinstance(about.get("unit", ""), str) or not isinstance(about.get("scale", ""), str):
            raise TypeError(f"unit of {name} is no text")
        if not isinstance(values, list) or not all(isinstance(v, str) or type(v) in _NUMBERS for v in values):
            raise TypeError(f"values of {name} are neither numbers nor texts")
    probes = study.get("record", {}).get("probe", [])
    for name in (*KEYS, "branch", "sample"):
        table = study.get(name, {})
        _check_table({key: v for key, v in table.items() if key != "probe" or name != "record"}, name)
    for probe in probes:
        _check_table(probe, "probe")
        if not isinstance(probe["name"], str):
            raise TypeError("a probe without a name")
    if "branch" in study and not isinstance(study["branch"]["along"], str):
        raise TypeError("branches along no axis")


def _check_table(table: dict[str, Any], where: str) -> None:
    """Refuse values that their keys cannot have, and of unknown keys all but numbers and texts."""
    known = {key_of(field): field for field in dataclasses.fields(KEYS[where])} if where in KEYS else {}
    for key, value in table.items():
        if isinstance(value, str) and key in known and value in known[key].metadata.get("gone", ()):
            continue  # stores keep what was written when they were made
        if key in known and value is not None and known[key].metadata.get("kind"):
            parse_field(known[key], value, f"{where} {key}")
        elif isinstance(value, dict) or (isinstance(value, list) and any(isinstance(v, dict) for v in value)):
            raise TypeError(f"{where} {key} is a table")
