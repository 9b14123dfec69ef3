"""The tables of a study in words, each number with the unit in which its key is declared."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

from rubhpc.rig.probes import Probe
from rubhpc.schema import WAVEFORM
from rubhpc.study.contact_keys import Contact
from rubhpc.study.drive_keys import DriveKeys
from rubhpc.study.run_up_keys import RunUpKeys
from rubhpc.study.tables import Integrator, Recording
from rubhpc.units import scale_for

if TYPE_CHECKING:
    from collections.abc import Iterable

_TABLES = {
    "run_up": RunUpKeys,
    "drive": DriveKeys,
    "contact": Contact,
    "integrator": Integrator,
    "record": Recording,
    "probe": Probe,
}
_OF_ONE_SPEED = ("transient", "transient_limit", "transient_tolerance", "revolutions")  # of [record]


def setting_rows(study: dict[str, Any]) -> list[tuple[str, str]]:
    """Return how speed, contact, integration and recording were set, from the study in a store."""
    unused = _OF_ONE_SPEED if any(isinstance(study.get(name), dict) for name in ("run_up", "drive")) else ()
    rows = []
    for table in ("run_up", "drive", "contact", "integrator", "record"):
        settings = study.get(table)
        if isinstance(settings, dict):
            shown = {k: v for k, v in settings.items() if table != "record" or k not in unused}
            if table == "record" and unused and isinstance(shown.get("keep"), list):
                shown["keep"] = [name for name in shown["keep"] if name == WAVEFORM]
            rows.append((table.replace("_", "-").capitalize(), _text(table, shown)))
    return rows


def _text(table: str, settings: dict[str, Any]) -> str:
    units = {
        field.name: field.metadata.get("unit", field.metadata.get("units", ""))
        for field in dataclasses.fields(_TABLES[table])
    }
    parts = []
    for key, value in settings.items():
        if value is None or value == []:
            continue
        if key in _TABLES and isinstance(value, list):
            parts += [f"{key} ({_text(key, one)})" for one in value]
        else:
            parts.append(f"{key.replace('_', ' ')} {_value(value, units.get(key, ''))}")
    return ", ".join(parts)


def _value(value: object, unit: str | tuple[str, str]) -> str:
    if isinstance(value, list):
        if isinstance(unit, tuple):
            return " and ".join(" at ".join(map(_value, pair[::-1], unit[::-1])) for pair in value)
        return _listed(_value(v, unit) for v in value)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or isinstance(unit, tuple):
        return str(value)
    if unit == "rad/s":
        return f"{value * 30.0 / math.pi:.6g} rpm"
    if unit == "rad":
        return f"{math.degrees(value):.6g}°"
    scale = scale_for(unit, abs(value))
    return f"{value * scale.factor:.6g} {scale.unit.replace('*', ' ')}".rstrip()


def _listed(words: Iterable[str]) -> str:
    *first, last = words
    return f"{', '.join(first)} and {last}" if first else last
