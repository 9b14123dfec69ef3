"""A file of sensors: a table for each signal, with the arguments of `Sensor` in any unit."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from postproc.signals.sensors import Sensor
from rubhpc.errors import InputError
from rubhpc.input.messages import brief, place
from rubhpc.input.quantity import parse_quantity
from rubhpc.input.reading import read_toml, refuse_unknown
from rubhpc.study.axes import study_unit

if TYPE_CHECKING:
    from collections.abc import Mapping

_OWN_UNITS = {"band": "Hz", "drop_outs": "", "drop_out_length": ""}  # the others have the unit of the signal


def read_sensors(path: str | Path, units: Mapping[str, str]) -> dict[str, Sensor]:
    """Return the sensors of a file; a signal without a table has one without noise.

    `units` are those of the signals that there are, as in a store. InputError where the file cannot be read,
    a signal or key is unknown, or a value has another unit.
    """
    tables, file = read_toml(Path(path)), str(path)
    refuse_unknown(tables, units, file, "")
    return {name: _sensor(tables.get(name, {}), study_unit(unit), file, name) for name, unit in units.items()}


def _sensor(table: object, unit: str, file: str, name: str) -> Sensor:
    if not isinstance(table, dict):
        raise InputError(f"{place(file, name)}: {brief(table)} is not a table; write [{name}] and its keys")
    refuse_unknown(table, {known.name: None for known in fields(Sensor)}, file, name)
    found: dict[str, Any] = {}
    for key, value in table.items():
        where = place(file, name, key)
        if key != "run_out":
            found[key] = parse_quantity(value, _OWN_UNITS.get(key, unit), where)
            continue
        lines = value if isinstance(value, list) else []
        if not lines or not all(isinstance(line, list) and len(line) == 3 for line in lines):
            example = '[[1, "4 um", "40 deg"]]'
            raise InputError(
                f"{where}: {brief(value)} is no list of order, amplitude and phase; write {example}"
            )
        units = ("", unit, "rad")
        found[key] = tuple(tuple(map(parse_quantity, line, units, [where] * 3)) for line in lines)
    try:
        return Sensor(**found)
    except InputError as error:
        raise InputError(f"{place(file, name)}: {error}") from None
