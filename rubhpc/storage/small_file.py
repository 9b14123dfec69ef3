"""Small JSON files that hold one record: what lies there is checked before it is believed."""

from __future__ import annotations

import json
from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeVar

from rubhpc.storage.disk import read_regular

if TYPE_CHECKING:
    from pathlib import Path

T = TypeVar("T")

_MOST = 2**16  # bytes
_NUMBERS: dict[str, tuple[type, ...]] = {"int": (int,), "float": (int, float)}


def read_record(path: Path, kind: type[T]) -> T | None:
    """The record of a dataclass of texts and numbers at `path`; None where it is absent or damaged."""
    try:
        content = json.loads(read_regular(path, _MOST))
        if not isinstance(content, dict):
            return None
        record: T = kind(**content)
    except (OSError, ValueError, TypeError, RecursionError):
        return None
    types: dict[str, Any] = {f.name: f.type for f in fields(record)}  # type: ignore[arg-type]
    return record if all(_is_sound(getattr(record, n), t) for n, t in types.items()) else None


def _is_sound(value: object, kind: str) -> bool:
    """Whether a value is of its type, a text printable and a number not beyond any clock or count."""
    if isinstance(value, str):
        return kind == "str" and value.isprintable()
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return kind in _NUMBERS and isinstance(value, _NUMBERS[kind]) and abs(value) < 2**63
