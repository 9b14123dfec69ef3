"""Dotted keys of nested dataclasses: "stator.length" sets all stators, "stator.1.angle" the first."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, TypeVar

from rubhpc.errors import InputError
from rubhpc.input.fields import FieldError, parse_field
from rubhpc.input.messages import nearest

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

T = TypeVar("T")

_FEW = 12  # keys that an error lists
_SETTABLE = ("quantity", "count", "flag", "choice")  # kinds of fields that one value can set


def find_key(owner: object, dotted: str) -> dataclasses.Field[Any]:
    """Return the field that a dotted key names.

    Raises
    ------
    InputError
        When there is no such key; the message names the nearest.
    """
    current: Any = owner
    declared = None
    for part in dotted.split("."):
        if isinstance(current, tuple) and current and part.isdigit():
            current, declared = (current[int(part) - 1] if 0 < int(part) <= len(current) else None), None
            continue
        if isinstance(current, tuple) and current:  # a key of all items: each must have it
            current = min(current, key=lambda item: _has(item, part))
        declared = _fields(type(current)).get(part)
        current = getattr(current, part) if declared else None
    if declared is not None and _is_settable(declared):
        return declared
    if declared is not None and declared.metadata.get("kind") in _SETTABLE:
        raise InputError("cannot be set by a study; write it in the rig")
    known = list(_keys(owner))
    inside = [k for k in known if k.startswith(f"{dotted}.")]
    if inside:
        raise InputError(f"is a table, not a value; did you mean {inside[0]}?")
    fix = nearest(dotted, known)
    is_short = "?" in fix or len(known) <= _FEW
    raise InputError(f"unknown key; {fix if is_short else 'see the rig file for its keys'}")


def replace_keys(owner: T, values: Mapping[str, object]) -> T:
    """Return a nested dataclass with some dotted keys set, all at once.

    A dataclass that can give one thing in two ways has a method `displaced(keys)`, which returns the changes
    of other fields when those in `keys` are set.

    Raises
    ------
    InputError
        When a key is unknown or a value is invalid.
    """
    parsed = {}
    for dotted, value in values.items():
        try:
            declared = find_key(owner, dotted)
        except InputError as error:
            raise InputError(f"{dotted}: {error}") from None
        parsed[tuple(dotted.split("."))] = parse_field(declared, value, dotted)
    result: T = _replaced(owner, parsed, ())
    return result


def _replaced(owner: Any, values: Mapping[tuple[str, ...], Any], path: tuple[str, ...]) -> Any:
    leaves = {key[0]: value for key, value in values.items() if len(key) == 1}
    changes = owner.displaced(set(leaves)) if leaves and hasattr(owner, "displaced") else {}
    changes |= leaves
    for name in {key[0] for key in values if len(key) > 1}:
        inner = {key[1:]: value for key, value in values.items() if key[0] == name}
        replaced = _replaced_items if isinstance(getattr(owner, name), tuple) else _replaced
        changes[name] = replaced(getattr(owner, name), inner, (*path, name))
    try:
        return dataclasses.replace(owner, **changes)
    except FieldError as error:
        if not path:
            raise
        raise FieldError(".".join((*path, error.key)), error.problem) from None


def _replaced_items(items: Any, values: Mapping[tuple[str, ...], Any], path: tuple[str, ...]) -> Any:
    """Set keys in all items, then those that name one item by its number, from 1."""
    result = []
    for i, item in enumerate(items, 1):
        for_all = {key: value for key, value in values.items() if not key[0].isdigit()}
        for_this = {key[1:]: value for key, value in values.items() if key[0] == str(i)}
        both = for_all | for_this
        result.append(_replaced(item, both, (*path, str(i))) if both else item)
    return tuple(result)


def _keys(owner: Any, prefix: str = "") -> Iterator[str]:
    """Every dotted key that names a single value, in reading order."""
    for declared in dataclasses.fields(owner):
        value = getattr(owner, declared.name)
        name = f"{prefix}{declared.name}"
        if dataclasses.is_dataclass(value):
            yield from _keys(value, f"{name}.")
        elif isinstance(value, tuple) and value and dataclasses.is_dataclass(value[0]):
            common = set.intersection(*({*_keys(item, f"{name}.")} for item in value))
            yield from (key for key in _keys(value[0], f"{name}.") if key in common)
            for i, item in enumerate(value, 1):
                yield from _keys(item, f"{name}.{i}.")
        elif _is_settable(declared):
            yield name


def _is_settable(declared: dataclasses.Field[Any]) -> bool:
    return declared.metadata.get("kind") in _SETTABLE and declared.metadata.get("is_key", True)


def _has(item: Any, part: str) -> bool:
    """Whether an item has a key, or a table that may be left out."""
    declared = _fields(type(item)).get(part)
    return declared is not None and ("kind" in declared.metadata or getattr(item, part) is not None)


def _fields(cls: Any) -> dict[str, dataclasses.Field[Any]]:
    return {f.name: f for f in dataclasses.fields(cls)} if dataclasses.is_dataclass(cls) else {}
