"""Attributes of a store as a run writes them, or none: a store may come from anybody."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.errors import InputError, StoreError, printable
from rubhpc.input.fields import key_of, parse_field
from rubhpc.rig.probes import Probe
from rubhpc.study.contact_keys import ContactKeys
from rubhpc.study.drive_keys import DriveKeys
from rubhpc.study.run_up_keys import RunUpKeys
from rubhpc.study.tables import Integrator, Recording

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr

_DEEPEST = 32  # tables and lists inside one another
_TEXTS = ("units", "long_name", "flag_meanings")  # of arrays
_SCALED = ("_FillValue", "scale_factor", "add_offset", "missing_value", "dtype", "_Unsigned")  # no array is
_TABLES: dict[str, type | None] = {
    "contact": ContactKeys,
    "integrator": Integrator,
    "record": Recording,
    "run_up": RunUpKeys,
    "drive": DriveKeys,
    "branch": None,
    "sample": None,
    "initial": None,
}
_NUMBERS = (int, float)


def with_sound_attributes(store: xr.Dataset, path: Path) -> xr.Dataset:
    """Return a store whose texts are printable; lazily, as it was.

    Raises
    ------
    StoreError
        Attributes are of other types than a run writes, or values of an axis that has words are none of them.
    """
    try:
        found = store.assign_attrs(_clean(store.attrs, 0))
        for name, array in found.variables.items():
            array.attrs = {k: v for k, v in _clean(array.attrs, 0).items() if k not in _SCALED}
            _check_array(str(name), array)
        _check_root(found.attrs)
    except (ValueError, TypeError, KeyError, AttributeError, InputError) as error:
        reason = printable(str(error))[:160]
        raise StoreError(f"{path}: its attributes are not those of a store ({reason}); get it anew") from None
    return found


def _clean(value: Any, depth: int) -> Any:
    """Return an attribute without control characters."""
    if isinstance(value, str):
        return printable(value)
    if depth > _DEEPEST:
        raise ValueError("tables inside one another")
    if isinstance(value, dict):
        return {printable(str(key)): _clean(entry, depth + 1) for key, entry in value.items()}
    if isinstance(value, list | tuple) and not all(type(entry) in _NUMBERS for entry in value):
        return [_clean(entry, depth + 1) for entry in value]
    return value


def _check_array(name: str, array: xr.Variable) -> None:
    for key in _TEXTS:
        if not isinstance(array.attrs.get(key, ""), str):
            raise TypeError(f"{key} of {name} is no text")
    for key in ("units", "long_name"):
        if "$" in array.attrs.get(key, ""):
            raise ValueError(f"{key} of {name} is a formula")
    words = array.attrs.get("flag_meanings", "").split()
    if words and not array.chunks and not np.isin(array.values, np.arange(len(words))).all():
        raise ValueError(f"{name} has values without a meaning")


def _check_root(attributes: dict[str, Any]) -> None:
    study, rig = attributes.get("study", {}), attributes.get("rig", {})
    if not isinstance(study, dict) or not isinstance(rig, dict) or not isinstance(rig.get("name", ""), str):
        raise TypeError("study and rig are no tables")
    for name, about in study.get("grid", {}).items():
        values = about.get("values", [about.get("start"), about.get("stop")])
        if not isinstance(about["unit"], str) or not isinstance(about.get("scale", ""), str):
            raise TypeError(f"unit of {name} is no text")
        if not isinstance(values, list) or not all(isinstance(v, str) or type(v) in _NUMBERS for v in values):
            raise TypeError(f"values of {name} are neither numbers nor texts")
    for name, kind in _TABLES.items():
        table = study.get(name, {})
        probes = table.get("probe", []) if name == "record" else []
        known = {} if kind is None else {key_of(field): field for field in dataclasses.fields(kind)}
        _check_table({key: v for key, v in table.items() if key != "probe" or name != "record"}, known, name)
        for probe in probes:
            _check_table(probe, {key_of(field): field for field in dataclasses.fields(Probe)}, "probe")
            if not isinstance(probe["name"], str):
                raise TypeError("a probe without a name")
    if "branch" in study and not isinstance(study["branch"]["along"], str):
        raise TypeError("branches along no axis")


def _check_table(table: dict[str, Any], known: dict[str, Any], where: str) -> None:
    """Refuse values that their keys cannot have, and of unknown keys all but numbers and texts."""
    for key, value in table.items():
        if key in known and value is not None and known[key].metadata.get("kind"):
            parse_field(known[key], value, f"{where} {key}")
        elif isinstance(value, dict) or (isinstance(value, list) and any(isinstance(v, dict) for v in value)):
            raise TypeError(f"{where} {key} is a table")
