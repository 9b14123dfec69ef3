"""TOML files to frozen dataclasses, by the declarations of their fields.

A file is data: nothing in it is evaluated, imported or run.
"""

from __future__ import annotations

import dataclasses
import functools
import re
import tomllib
from typing import TYPE_CHECKING, Any, TypeVar, get_args, get_origin, get_type_hints

from rubhpc.errors import InputError, located, printable
from rubhpc.input.fields import KINDS, FieldError, check_value, key_of, parse_field
from rubhpc.input.messages import brief, nearest, place

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

T = TypeVar("T")

_QUOTED = re.compile(r'"(?:[^"\\\n]|\\.)*+"?|\'[^\'\n]*+\'?|#[^\n]*+')  # texts, quoted keys, comments
_DEEPEST = 32  # parts of a key: the parser takes memory as their square
_DEEP = re.compile(rf"(?<![\w-])(?:[\w-]++[ \t]*+\.[ \t]*+){{{_DEEPEST}}}")


def read_toml(path: Path, where: str = "") -> dict[str, Any]:
    """Return the tables of a TOML file.

    Parameters
    ----------
    path : Path
    where : str
        Start of error messages: the file and key that name the file, "study.toml: rig".

    Raises
    ------
    InputError
        When the file is missing, unreadable, not UTF-8 or not TOML; the message gives line and column.
    """
    named = place(": ".join(p for p in (where, str(path)) if p))
    try:
        if not path.exists():
            raise InputError(f"{named}: no such file; check the path")
        if not path.is_file():
            raise InputError(f"{named}: not a file; give the path of a TOML file")
        content = path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "not a path"
        raise InputError(f"{named}: cannot be read ({reason}); check the path") from None
    return _parse_toml(content, str(path))


def build(cls: type[T], table: object, file: str, name: str = "") -> T:
    """Return a dataclass built from a table of a file.

    Parameters
    ----------
    cls : type
        Dataclass with fields declared by `rubhpc.input.fields`, other dataclasses, or tuples of them.
    table : dict
        As TOML gives it.
    file, name : str
        Start of error messages: the file, and the dotted name of the table in it.
    """
    if not isinstance(table, dict):
        raise InputError(
            f"{place(file, name)}: {brief(table)} is not a table; write [{name}] and its keys below"
        )
    fields = {key_of(f): f for f in dataclasses.fields(cls) if not f.metadata.get("derived")}  # type: ignore[arg-type]
    for key, declared in fields.items():  # first: an unknown choice explains unknown keys
        if declared.metadata.get("kind") == "choice" and (
            problem := check_value(declared, table.get(key, declared.default))
        ):
            raise FieldError(key, problem).within(file, name)
    refuse_unknown(table, fields, file, name)
    values, hints = {}, _hints(cls)  # type: ignore[arg-type]
    for key, declared in fields.items():
        if key in table:
            values[declared.name] = _parse(declared, hints[declared.name], table[key], file, name)
        elif declared.default is dataclasses.MISSING:
            raise InputError(
                f"{place(file, name, key)}: missing; add {_missing(declared, hints[declared.name], name)}"
            )
    try:
        return cls(**values)
    except FieldError as error:
        raise error.within(file, name) from None


@functools.cache
def _hints(cls: type) -> dict[str, Any]:
    """Types of the fields of a dataclass: looking them up takes a tenth of a millisecond."""
    return get_type_hints(cls)


def refuse_unknown(table: Mapping[str, object], known: Mapping[str, object], file: str, name: str) -> None:
    """Refuse keys that are not known, naming the nearest."""
    for key in table:
        if key not in known:
            raise InputError(f"{place(file, name, str(key))}: unknown key; {nearest(str(key), known)}")


def plain(value: Any) -> Any:
    """Return a dataclass as dicts, lists, numbers and text, which `build` reads back.

    A field with `added` among its metadata is omitted at its default, or at what is meant where it is
    `absent`, as rigs of older stores have no such key; one with `derived`, which is no key, always.
    """
    if not dataclasses.is_dataclass(value):
        return [plain(v) for v in value] if isinstance(value, tuple) else value
    result: dict[str, Any] = {}
    for declared in dataclasses.fields(value):
        limits, entry = declared.metadata, getattr(value, declared.name)
        if entry is None or limits.get("derived"):
            continue
        if limits.get("added") and entry == (limits.get("absent") or declared.default):
            continue
        kind = limits.get("kind")
        result[key_of(declared)] = KINDS[kind].encode(entry) if kind else plain(entry)
    return result


def _parse(declared: dataclasses.Field[Any], hint: Any, value: object, file: str, name: str) -> Any:
    where = place(file, name, key_of(declared))
    inner = f"{name}.{declared.name}" if name else declared.name
    if kind := declared.metadata.get("kind"):
        return parse_field(declared, value, place(file, inner) if kind == "pairs" else where)
    if get_origin(hint) is not tuple:
        return build(_kind_of(hint, value), value, file, inner)
    if not isinstance(value, list):
        raise InputError(f"{where}: not a list of tables; write [[{inner}]], in two brackets")
    item = get_args(hint)[0]
    return tuple(build(_kind_of(item, v), v, file, f"{inner}.{i}") for i, v in enumerate(value, 1))


def _kind_of(hint: Any, table: object) -> Any:
    """Return the dataclass of a union that a table describes.

    The one whose `KIND` its key `kind` names; else the one with most of its keys; of several the one that
    lacks the fewest required ones, or the first.
    """
    keys = set(table) if isinstance(table, dict) else set()
    named = table.get("kind") if isinstance(table, dict) else None

    def likeness(kind: Any) -> tuple[int, int]:
        declared = dataclasses.fields(kind)
        required = {key_of(f) for f in declared if f.default is dataclasses.MISSING}
        return len(keys & {key_of(f) for f in declared}), -len(required - keys)

    kinds = [kind for kind in get_args(hint) or (hint,) if kind is not type(None)]  # None: it may be left out
    kinds = [kind for kind in kinds if named and getattr(kind, "KIND", None) == named] or kinds
    return max(kinds, key=likeness)


def _missing(declared: dataclasses.Field[Any], hint: Any, name: str) -> str:
    if example := declared.metadata.get("example"):
        return f"{declared.name} = {example}"
    inner = f"{name}.{declared.name}" if name else declared.name
    return f"[{inner}]" if dataclasses.is_dataclass(hint) else f"[[{inner}]]"


def _parse_toml(content: bytes, file: str) -> dict[str, Any]:
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(f"{file}: line {line}: not UTF-8 text; save the file as UTF-8") from None
    bare = _QUOTED.sub("q", text)
    if deep := _DEEP.search(bare):
        line = bare.count("\n", 0, deep.start()) + 1
        raise InputError(f"{file}: line {line}: a key of over {_DEEPEST} parts; no key has so many")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        message = str(error)
        at = re.search(r" \(at (?:line (\d+), column (\d+)|end of document)\)$", message)
        lines = text.splitlines() or [""]
        end = (str(len(lines)), str(len(lines[-1]) + 1))
        where = (at[1], at[2]) if at and at[1] else end
        reason = printable((message[: at.start()] if at else message)[:120])
        raise InputError(
            f"{file}: line {where[0]}, column {where[1]}: not TOML: {reason}; correct that line"
        ) from None
    except RecursionError:
        raise InputError(f"{file}: tables nested too deeply; write them flat") from None
    except ValueError:
        raise InputError(f"{file}: contains a number that is too long; shorten it") from None


_FEW = 12  # keys that an error lists
_SETTABLE = ("quantity", "count", "flag", "choice")  # kinds of fields that one value can set


def find_key(owner: object, dotted: str) -> dataclasses.Field[Any]:
    """Return the field that a dotted key names."""
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
    """
    parsed = {}
    for dotted, value in values.items():
        with located(f"{dotted}: "):
            declared = find_key(owner, dotted)
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
