"""Fields of the study and rig files: each is declared once, and read, checked and documented from there."""

from __future__ import annotations

import dataclasses
import difflib
import operator
from dataclasses import MISSING, field
from typing import TYPE_CHECKING, Any

from rubhpc.errors import InputError, printable
from rubhpc.input.matrix import parse_matrix
from rubhpc.input.quantity import brief, out_of_range, parse_quantity

if TYPE_CHECKING:
    from collections.abc import Iterable


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
) -> Any:
    """Declare a field that holds a finite number in `unit` (SI, readable by pint), within its bounds.

    Parameters
    ----------
    doc, example : str
        Meaning in one line; a value as in a TOML file, `'"0.8 m"'`; for messages and the reference of keys,
        as in all declarations below.
    """
    bounds = {"above": above, "at_least": at_least, "below": below}
    return _declare("quantity", doc, example, default, unit=unit, **bounds)


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
) -> Any:
    """Declare a field that holds a bounded whole number, or one of some words; a study may set a key."""
    bounds = {"at_least": at_least, "at_most": at_most, "or_words": or_words}
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
    return _declare("selection", doc, example, ())


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
    kind = declared.metadata.get("kind")
    if kind == "quantity":
        return parse_quantity(value, declared.metadata["unit"], where)
    if kind == "series":
        values = value if isinstance(value, list | tuple) else [value]
        unit = declared.metadata["unit"]
        return tuple(parse_quantity(v, unit, f"{where}: value {i}") for i, v in enumerate(values, 1))
    if kind == "count":
        return _parse_count(value, where, declared.metadata["or_words"])
    if kind == "matrix":
        return parse_matrix(value, where)
    if kind == "degrees":
        return _parse_degrees(value, where)
    if kind == "words":
        if not isinstance(value, list | tuple) or not all(isinstance(word, str) for word in value):
            raise InputError(f'{where}: {brief(value)} is not a list of words; write ["axial", "lateral"]')
        return tuple(value)
    if kind == "criteria":
        return _parse_criteria(value, declared, where)
    if kind == "selection":
        return _parse_selection(value, declared, where)
    if kind == "flag":
        if isinstance(value, float) and value in (0.0, 1.0):
            return bool(value)  # an axis holds floats
        if not isinstance(value, bool):
            raise InputError(
                f"{where}: {brief(value)} is neither true nor false; write one of them, without quotes"
            )
        return value
    if kind == "choices":
        if not isinstance(value, list | tuple):
            words = _listed(declared.metadata["of"])
            raise InputError(f"{where}: {brief(value)} is not a list; write [{words}] or part of it")
        return tuple(value)
    if not isinstance(value, str):
        raise InputError(
            f'{where}: {brief(value)} is not text; write it in quotes, {key_of(declared)} = "..."'
        )
    return value


def check_fields(owner: Any) -> None:
    """Refuse values that the declarations of a dataclass exclude; call it in `__post_init__`.

    Raises
    ------
    FieldError
        Names the field, what is wrong and how to fix it.
    """
    for declared in dataclasses.fields(owner):
        problem = check_value(declared, getattr(owner, declared.name))
        if problem:
            raise FieldError(key_of(declared), problem)


def check_value(declared: dataclasses.Field[Any], value: Any) -> str:
    """Return what is wrong with the value of a field and how to fix it; "" if nothing is."""
    check = _CHECKS.get(declared.metadata.get("kind", ""))
    if check is None or (value is None and declared.default is None):
        return ""
    return check(value, declared.metadata)


def place(file: str, table: str = "", key: str = "") -> str:
    """Return "file: [table] key", the start of a message about an input, on one line."""
    name = " ".join(p for p in (f"[{table[:80]}]" if table else "", key[:80]) if p)
    head = ": ".join(p for p in (file, name) if p)
    return printable(head)


def nearest(word: str, known: Iterable[str]) -> str:
    """Return how to fix an unknown word: the known word most like it, or the whole list."""
    known = list(known)
    close = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    if not close:  # letters aside, people leave a word out
        close = [k for k in known if word and (word.lower() in k.lower() or k.lower() in word.lower())][:1]
    return f"did you mean {close[0]}?" if close else f"choose one of {', '.join(known)}"


def _parse_count(value: object, where: str, or_words: tuple[str, ...]) -> int | str:
    if isinstance(value, str) and value in or_words:
        return value
    if isinstance(value, float) and value.is_integer():
        return int(value)  # an axis holds floats
    if isinstance(value, bool) or not isinstance(value, int):
        raise InputError(
            f"{where}: {brief(value)} is not a whole number; write one such as 12, without quotes"
            + "".join(f', or "{word}"' for word in or_words)
        )
    return value


def _parse_degrees(value: object, where: str) -> tuple[tuple[int, str], ...]:
    fix = 'write a node and a name for each row, [[1, "v"], [1, "w"]]'
    try:
        pairs = [(node, name) for node, name in value]  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise InputError(f"{where}: {brief(value)} is not a list of degrees; {fix}") from None
    degrees = []
    for node, name in pairs:
        try:
            number = 0 if isinstance(node, bool) else operator.index(node)  # numpy's whole numbers too
        except TypeError:
            number = 0
        if number < 1 or not isinstance(name, str):
            raise InputError(f"{where}: {brief((node, name))} is not a degree; {fix}")
        degrees.append((number, str(name)))
    return tuple(degrees)


def _parse_criteria(value: object, declared: Any, where: str) -> tuple[tuple[str, float], ...]:
    """Flags by name, measures as tables `{ name = tolerance }`; one of them needs no list."""
    pairs: list[tuple[str, float]] = []
    for entry in value if isinstance(value, list | tuple) else [value]:
        if isinstance(entry, str):
            pairs.append((entry, 0.0))
        elif isinstance(entry, dict):
            pairs += [(name, parse_quantity(share, "", f"{where}: {name}")) for name, share in entry.items()]
        else:
            example = declared.metadata["example"]
            raise InputError(f"{where}: {brief(entry)} is no flag and no measure; write {example}")
    return tuple(pairs)


def _parse_selection(value: object, declared: Any, where: str) -> tuple[tuple[str, str | float], ...]:
    if not isinstance(value, dict):
        raise InputError(f"{where}: {brief(value)} is not a table; write {declared.metadata['example']}")
    found: list[tuple[str, str | float]] = []
    for name, one in value.items():
        if isinstance(one, dict):  # `stator.angle = 0` without quotes
            inner = _parse_selection(one, declared, where)
            found += [(f"{name}.{rest}", entry) for rest, entry in inner]
        elif isinstance(one, bool) or not isinstance(one, str | int | float):
            raise InputError(
                f"{where}.{name}: {brief(one)} is no value; write {declared.metadata['example']}"
            )
        else:
            found.append((name, one if isinstance(one, str) else float(one)))
    return tuple(found)


def _check_criteria(value: Any, bounds: Any) -> str:
    if not value:
        return "empty; give at least one flag or measure"
    flags, measures = bounds["flags"], bounds["measures"]
    names = [name for name, _ in value]
    for name, share in value:
        if names.count(name) > 1:
            return f"{name} is duplicated; remove one"
        if name in measures and not 0.0 < share < 1.0:
            return f"{name} needs a relative difference between 0 and 1; write {{ {name} = 0.1 }}"
        if name in flags and share:
            return f'{name} is a flag, which has no difference; write "{name}"'
        if name not in flags and name not in measures:
            return f"{brief(name)} is no flag or measure; {nearest(name, [*flags, *measures])}"
    return ""


def _check_quantity(value: object, bounds: Any) -> str:
    unit = f" {bounds['unit']}" if bounds["unit"] else ""
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return f"{brief(value)} is not a number; give one in SI units"
    if problem := out_of_range(number):
        return f"{brief(value)} {problem}"
    for word, holds in (("above", number.__gt__), ("at_least", number.__ge__), ("below", number.__lt__)):
        limit = bounds[word]
        if limit is not None and not holds(limit):
            return f"{number:g}{unit} is out of range; it must be {word.replace('_', ' ')} {limit:g}"
    return ""


def _check_series(values: Any, bounds: Any) -> str:
    if not isinstance(values, tuple) or not values:
        return f"{brief(values)} is not a list of numbers; give one or more"
    problems = (
        f"value {i}: {problem}" for i, v in enumerate(values, 1) if (problem := _check_quantity(v, bounds))
    )
    return next(problems, "")


def _check_count(value: object, bounds: Any) -> str:
    if isinstance(value, str) and value in bounds["or_words"]:
        return ""
    if isinstance(value, bool) or not isinstance(value, int):
        words = "".join(f', or "{word}"' for word in bounds["or_words"])
        return f"{brief(value)} is not a whole number; give one such as 12{words}"
    if value < bounds["at_least"]:
        return f"{brief(value)} is out of range; it must be at least {bounds['at_least']}"
    if bounds["at_most"] is not None and value > bounds["at_most"]:
        return f"{brief(value)} is out of range; it must be at most {bounds['at_most']}"
    return ""


def _check_flag(value: object, _: Any) -> str:
    return "" if isinstance(value, bool) else f"{brief(value)} is neither true nor false"


def _check_text(value: object, _: Any) -> str:
    if not isinstance(value, str):
        return f"{brief(value)} is not text; write it in quotes"
    if not value.strip() or not value.isprintable():
        return f"{brief(value)} is not a line of text; give one without control characters"
    return ""


def _check_choice(value: object, bounds: Any) -> str:
    if value in bounds["of"]:
        return ""
    return f"{brief(value)} is not available; choose one of {_listed(bounds['of'])}"


def _check_choices(value: Any, bounds: Any) -> str:
    for word in value:
        if problem := _check_choice(word, bounds):
            return problem
        if value.count(word) > 1:
            return f"{brief(word)} is duplicated; remove one"
    return ""


def _listed(words: Iterable[str]) -> str:
    return ", ".join(f'"{w}"' for w in words)


_CHECKS = {
    "quantity": _check_quantity,
    "series": _check_series,
    "count": _check_count,
    "flag": _check_flag,
    "text": _check_text,
    "choice": _check_choice,
    "choices": _check_choices,
    "criteria": _check_criteria,
}
