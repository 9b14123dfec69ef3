"""A file of sensors: a table for each signal, with the arguments of `Sensor` in any unit."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from postproc.signals.sensors import Sensor
from rubhpc.errors import InputError
from rubhpc.input.messages import brief, nearest, place
from rubhpc.input.quantity import parse_quantity
from rubhpc.input.reading import read_toml
from rubhpc.study.axes import study_unit

if TYPE_CHECKING:
    from collections.abc import Mapping

_OWN_UNITS = {"band": "Hz", "drop_outs": "", "drop_out_length": ""}  # the others have the unit of the signal
_RUN_OUT = {"order": "", "amplitude": None, "phase": "rad"}  # None: the unit of the signal


def read_sensors(path: str | Path, units: Mapping[str, str]) -> dict[str, Sensor]:
    """Return the sensors of a file; a signal without a table has one without noise.

    Parameters
    ----------
    units : mapping
        Signals that there are, and the unit of each, as in a store.

    Raises
    ------
    InputError
        The file cannot be read, a signal or key is unknown, or a value has another unit.
    """
    tables, file = read_toml(Path(path)), str(path)
    for name in tables:
        if name not in units:
            raise InputError(f"{place(file, name)}: no such signal of this data set; {nearest(name, units)}")
    return {name: _sensor(tables.get(name, {}), study_unit(unit), file, name) for name, unit in units.items()}


def _sensor(table: object, unit: str, file: str, name: str) -> Sensor:
    if not isinstance(table, dict):
        raise InputError(f"{place(file, name)}: {brief(table)} is not a table; write [{name}] and its keys")
    known = [one.name for one in fields(Sensor)]
    found: dict[str, Any] = {}
    for key, value in table.items():
        where = place(file, name, key)
        if key not in known:
            raise InputError(f"{where}: unknown key; {nearest(key, known)}")
        if key == "run_out":
            found[key] = _run_out(value, unit, where)
        else:
            found[key] = parse_quantity(value, _OWN_UNITS.get(key, unit), where)
    try:
        return Sensor(**found)
    except InputError as error:
        raise InputError(f"{place(file, name)}: {error}") from None


def _run_out(value: object, unit: str, where: str) -> tuple[tuple[float, ...], ...]:
    lines: list[Any] = value if isinstance(value, list) else [value]
    if not all(isinstance(line, dict) and set(line) == set(_RUN_OUT) for line in lines):
        example = '[{ order = 1, amplitude = "4 um", phase = "40 deg" }]'
        raise InputError(f"{where}: {brief(value)} is not a list of orders; write {example}")
    return tuple(
        tuple(parse_quantity(line[key], unit if of is None else of, where) for key, of in _RUN_OUT.items())
        for line in lines
    )
