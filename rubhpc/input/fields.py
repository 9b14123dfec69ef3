"""Fields of the study and rig files: each is declared once, and read, checked and documented from there."""

from __future__ import annotations

import dataclasses
from dataclasses import MISSING, field
from numbers import Integral
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from rubhpc.errors import InputError
from rubhpc.input.kinds import KINDS
from rubhpc.input.messages import place

if TYPE_CHECKING:
    from collections.abc import Mapping


class FieldError(InputError):
    """A value that its field cannot hold; `within` adds the file and table."""

    def __init__(self, key: str, problem: str) -> None:
        super().__init__(f"{key}: {problem}")
        self.key = key  # dotted, from the dataclass that refuses
        self.problem = problem

    def within(self, file: str, table: str = "") -> InputError:
        """Return the error as it reads for a table of a file."""
        *inner, key = self.key.rsplit(".", 1)
        return InputError(f"{place(file, '.'.join(p for p in (table, *inner) if p), key)}: {self.problem}")


def quantity(
    unit: str,
    *,
    doc: str,
    example: str,
    default: Any = MISSING,
    above: float | None = None,
    at_least: float | None = None,
    below: float | None = None,
    or_words: tuple[str, ...] = (),
    added: bool = False,
) -> Any:
    """Declare a field that holds a finite number in `unit` (SI, readable by pint), or one of some words.

    Parameters
    ----------
    doc, example : str
        Meaning in one line; a value as in a TOML file, `'"0.8 m"'`; for messages and the reference of keys,
        as in all declarations below.
    added : bool
        Whether rigs of older stores have no such key.
    """
    limits = {"above": above, "at_least": at_least, "below": below, "or_words": or_words, "added": added}
    return _declare("quantity", doc, example, default, unit=unit, **limits)


def series(
    unit: str, *, doc: str, example: str, default: Any = MISSING, at_least: float | None = None
) -> Any:
    """Declare a field that holds a tuple of finite numbers in `unit` (SI), none below a bound."""
    bounds = {"above": None, "at_least": at_least, "below": None}
    return _declare("series", doc, example, default, unit=unit, **bounds)


def count(
    *,
    doc: str,
    example: str,
    default: Any = MISSING,
    at_least: int = 1,
    at_most: int | None = None,
    is_key: bool = True,
    or_words: tuple[str, ...] = (),
    gone: Mapping[str, str] = MappingProxyType({}),
) -> Any:
    """Declare a field that holds a bounded whole number, or one of some words; a study may set a key.

    `gone` are words of older versions, with what a message says of each.
    """
    bounds = {"at_least": at_least, "at_most": at_most, "or_words": or_words, "gone": gone}
    return _declare("count", doc, example, default, is_key=is_key, **bounds)


def flag(*, doc: str, example: str, default: bool) -> Any:
    """Declare a field that is true or false."""
    return _declare("flag", doc, example, default)


def text(*, doc: str, example: str, default: Any = MISSING) -> Any:
    """Declare a field that holds one line of text."""
    return _declare("text", doc, example, default)


def choice(*, of: tuple[str, ...], doc: str, example: str, default: str, added: bool = False) -> Any:
    """Declare a field that holds one word of a list; `added`: rigs of older stores have no such key."""
    return _declare("choice", doc, example, default, of=of, added=added)


def choices(*, of: tuple[str, ...], doc: str, example: str, default: tuple[str, ...]) -> Any:
    """Declare a field that holds some words of a list, each at most once."""
    return _declare("choices", doc, example, default, of=of)


def words(*, doc: str, example: str, default: tuple[str, ...]) -> Any:
    """Declare a field that holds a list of words."""
    return _declare("words", doc, example, default)


def criteria(
    *, flags: tuple[str, ...], measures: tuple[str, ...], doc: str, example: str, default: Any = MISSING
) -> Any:
    """Declare a field that holds flags, and measures with a tolerance: pairs, with 0 for a flag."""
    return _declare("criteria", doc, example, default, flags=flags, measures=measures)


def selection(*, doc: str, example: str) -> Any:
    """Declare a field that holds pairs of an axis and a value, `{ friction = 0.3 }`; none by default."""
    return _declare("selection", doc, example, (), added=True)


def pairs(units: tuple[str, str], *, doc: str, example: str) -> Any:
    """Declare a field that holds pairs of numbers, written as a table `{ 31.56 = 0.09 }`; none by default."""
    return _declare("pairs", doc, example, (), units=units)


def matrix(*, doc: str, example: str, default: Any = MISSING) -> Any:
    """Declare a field that holds a square matrix, (n_dof, n_dof), SI units."""
    return _declare("matrix", doc, example, default)


def degrees(*, doc: str, example: str) -> Any:
    """Declare a field that holds a node and a name for every row of a matrix."""
    return _declare("degrees", doc, example, MISSING)


def key_of(declared: dataclasses.Field[Any]) -> str:
    """Return the key of a field in a file: its name, without the underscore that keeps `from_` a name."""
    return declared.name.rstrip("_")


def table(*, doc: str, default: Any = MISSING, added: bool = False) -> Any:
    """Declare a field that holds another dataclass, or a tuple of them: a table of its own in the file.

    `added`: older stores do not have it, and a rig with its default is described without it.
    """
    return field(default=default, metadata={"doc": doc, "added": added})


def _declare(kind: str, doc: str, example: str, default: Any, **limits: Any) -> Any:
    return field(default=default, metadata={"kind": kind, "doc": doc, "example": example, **limits})


def parse_field(declared: dataclasses.Field[Any], value: object, where: str) -> Any:
    """Return the value of a field from that of a file or caller; `check_fields` checks its bounds."""
    return KINDS[declared.metadata["kind"]].parse(value, declared.metadata, where)


def check_fields(owner: Any) -> None:
    """Refuse values that the declarations of a dataclass exclude; call it in `__post_init__`.

    Raises
    ------
    FieldError
        Names the field, what is wrong and how to fix it.
    """
    for declared in dataclasses.fields(owner):
        value = getattr(owner, declared.name)
        problem = check_value(declared, value)
        if problem:
            raise FieldError(key_of(declared), problem)
        kind = declared.metadata.get("kind")
        if kind == "count" and type(value) is not int and isinstance(value, Integral):
            object.__setattr__(owner, declared.name, int(value))  # numpy's whole numbers


def check_value(declared: dataclasses.Field[Any], value: Any) -> str:
    """Return what is wrong with the value of a field and how to fix it; "" if nothing is."""
    kind = declared.metadata.get("kind")
    if kind is None or (value is None and declared.default is None):
        return ""
    return KINDS[kind].check(value, declared.metadata)
