"""Fields of the study and rig files: each is declared once, and read, checked and documented from there."""

from __future__ import annotations

import dataclasses
import operator
from contextlib import suppress
from dataclasses import MISSING, field
from functools import partial
from numbers import Integral
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from rubhpc.errors import InputError, printable
from rubhpc.input.matrix import encode_matrix, parse_matrix
from rubhpc.input.messages import brief, nearest, place, quoted
from rubhpc.input.quantity import WithUnit, example_of, out_of_range, parse_quantity

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    Limits = Mapping[str, Any]  # what the declaration says: unit, bounds, words, example


class Kind(NamedTuple):
    """What a kind of field does with a value."""

    parse: Callable[[Any, Limits, str], Any]  # value, limits, start of messages
    check: Callable[[Any, Limits], str] = lambda value, limits: ""  # the problem
    encode: Callable[[Any], Any] = lambda value: value  # to what TOML and JSON hold


def _parse_quantity(value: object, limits: Limits, where: str) -> float | str:
    words = limits.get("or_words", ())
    if isinstance(value, str) and value in words:
        return value
    if (other := limits.get("or_unit")) and isinstance(value, str):
        for unit in (limits["unit"], other):
            with suppress(InputError):
                return WithUnit.of(parse_quantity(value, unit, where), unit)
    try:
        return parse_quantity(value, limits["unit"], where)
    except InputError as error:
        if not words:
            raise
        raise InputError(f"{error}, or {quoted(words)}") from None


def _check_quantity(value: object, limits: Limits) -> str:
    if isinstance(value, str) and value in limits.get("or_words", ()):
        return ""
    unit = f" {limits['unit']}" if limits["unit"] else ""
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return f"{brief(value)} is not a number; give one in SI units"
    if problem := out_of_range(number):
        return f"{brief(value)} {problem}"
    for word, holds in (("above", number.__gt__), ("at_least", number.__ge__), ("below", number.__lt__)):
        limit = limits[word]
        if limit is not None and not holds(limit):
            return f"{number:g}{unit} is out of range; it must be {word.replace('_', ' ')} {limit:g}"
    return ""


def _parse_series(value: Any, limits: Limits, where: str) -> tuple[float, ...]:
    listed = value.tolist() if hasattr(value, "tolist") else value  # an array
    values = listed if isinstance(listed, list | tuple) else [listed]
    return tuple(parse_quantity(v, limits["unit"], f"{where}: value {i}") for i, v in enumerate(values, 1))


def _check_series(values: Any, limits: Limits) -> str:
    if not isinstance(values, tuple) or not values:
        return f"{brief(values)} is not a list of numbers; give one or more"
    problems = (
        f"value {i}: {problem}" for i, v in enumerate(values, 1) if (problem := _check_quantity(v, limits))
    )
    return next(problems, "")


def _parse_count(value: Any, limits: Limits, where: str) -> int | str:
    if isinstance(value, float) and value.is_integer():
        return int(value)  # an axis holds floats
    if problem := _not_a_count(value, limits):
        raise InputError(f"{where}: {problem}")
    return value if isinstance(value, str) else int(value)


def _not_a_count(value: object, limits: Limits) -> str:
    if isinstance(value, str) and value in limits["gone"]:
        return str(limits["gone"][value])
    is_number = isinstance(value, Integral) and not isinstance(value, bool)
    if is_number or (isinstance(value, str) and value in limits["or_words"]):
        return ""
    words = "".join(f', or "{word}"' for word in limits["or_words"])
    return f"{brief(value)} is not a whole number; write one such as 12, without quotes{words}"


def _check_count(value: Any, limits: Limits) -> str:
    problem = _not_a_count(value, limits)
    if problem or isinstance(value, str):
        return problem
    if int(value) < limits["at_least"]:
        return f"{brief(value)} is out of range; it must be at least {limits['at_least']}"
    if limits["at_most"] is not None and int(value) > limits["at_most"]:
        return f"{brief(value)} is out of range; it must be at most {limits['at_most']}"
    return ""


def _parse_flag(value: object, limits: Limits, where: str) -> bool:
    if isinstance(value, float) and value in (0.0, 1.0):
        return bool(value)  # an axis holds floats
    if problem := _check_flag(value, limits):
        raise InputError(f"{where}: {problem}")
    return bool(value)


def _check_flag(value: object, _: Limits) -> str:
    fix = "write one of them, without quotes"
    return "" if isinstance(value, bool) else f"{brief(value)} is neither true nor false; {fix}"


def _parse_text(value: object, limits: Limits, where: str) -> str:
    if not isinstance(value, str):
        raise InputError(f"{where}: {brief(value)} is not text; write it in quotes, {limits['example']}")
    return value


def _check_text(value: object, _: Limits) -> str:
    if not isinstance(value, str):
        return f"{brief(value)} is not text; write it in quotes"
    if not value.strip() or not value.isprintable():
        return f"{brief(value)} is not a line of text; give one without control characters"
    return ""


def _check_choice(value: object, limits: Limits) -> str:
    if value in limits["of"]:
        return ""
    return f"{brief(value)} is not available; choose one of {quoted(limits['of'])}"


def _parse_choices(value: object, limits: Limits, where: str) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple):
        raise InputError(
            f"{where}: {brief(value)} is not a list; write [{quoted(limits['of'])}] or part of it"
        )
    return tuple(value)


def _check_choices(value: Any, limits: Limits) -> str:
    for word in value:
        if problem := _check_choice(word, limits):
            return problem
        if value.count(word) > 1:
            return f"{brief(word)} is duplicated; remove one"
    return ""


def _parse_words(value: object, limits: Limits, where: str) -> tuple[str, ...]:
    if not isinstance(value, list | tuple) or not all(isinstance(word, str) for word in value):
        raise InputError(f"{where}: {brief(value)} is not a list of words; write {limits['example']}")
    return tuple(value)


def _parse_degrees(value: object, _: Limits, where: str) -> tuple[tuple[int, str], ...]:
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


def _parse_criteria(value: object, limits: Limits, where: str) -> tuple[tuple[str, float], ...]:
    """Flags by name, measures as tables `{ name = tolerance }`; one of them needs no list."""
    pairs: list[tuple[str, float]] = []
    for entry in value if isinstance(value, list | tuple) else [value]:
        if isinstance(entry, str):
            pairs.append((entry, 0.0))
        elif isinstance(entry, dict):
            pairs += [(name, parse_quantity(share, "", f"{where}: {name}")) for name, share in entry.items()]
        else:
            raise InputError(
                f"{where}: {brief(entry)} is neither a flag nor a measure; write {limits['example']}"
            )
    return tuple(pairs)


def _check_criteria(value: Any, limits: Limits) -> str:
    if not value:
        return "empty; give at least one flag or measure"
    flags, measures = limits["flags"], limits["measures"]
    names = [name for name, _ in value]
    for name, share in value:
        if names.count(name) > 1:
            return f"{name} is duplicated; remove one"
        if name in measures and not 0.0 < share < 1.0:
            return f"{name} needs a relative difference between 0 and 1; write {{ {name} = 0.1 }}"
        if name in flags and share:
            return f'{name} is a flag, which has no difference; write "{name}"'
        if name not in flags and name not in measures:
            return f"{brief(name)} is neither a flag nor a measure; {nearest(name, [*flags, *measures])}"
    return ""


def _parse_selection(value: object, limits: Limits, where: str) -> tuple[tuple[str, str | float], ...]:
    if not isinstance(value, dict):
        raise InputError(f"{where}: {brief(value)} is not a table; write {limits['example']}")
    found: list[tuple[str, str | float]] = []
    for name, one in value.items():
        if isinstance(one, dict):  # `stator.angle = 0` without quotes
            found += [(f"{name}.{rest}", entry) for rest, entry in _parse_selection(one, limits, where)]
        elif isinstance(one, bool) or not isinstance(one, str | int | float):
            raise InputError(f"{where}.{name}: {brief(one)} is not a value; write {limits['example']}")
        else:
            found.append((name, one if isinstance(one, str) else float(one)))
    return tuple(found)


def _parse_pairs(value: object, limits: Limits, where: str) -> tuple[tuple[float, float], ...]:
    """Pairs from a table of numbers; to TOML a bare `31.56` is the table 31 with the key 56."""
    key_unit, unit = limits["units"]
    if isinstance(value, list) and all(isinstance(pair, list) and len(pair) == 2 for pair in value):
        return tuple((parse_quantity(a, key_unit, where), parse_quantity(b, unit, where)) for a, b in value)
    if not isinstance(value, dict):
        raise InputError(f"{where}: {brief(value)} contains no pairs; write {limits['example']}")
    flat: dict[str, object] = {}
    for key, entry in value.items():
        inner = entry.items() if isinstance(entry, dict) else [(None, entry)]
        flat.update({key if tail is None else f"{key}.{tail}": v for tail, v in inner})
    return tuple(
        (parse_quantity(_spelled(key), key_unit, at), parse_quantity(entry, unit, at))
        for key, entry in flat.items()
        for at in [f"{where} {printable(key[:80])}"]
    )


def _spelled(text: str) -> object:
    """Return the number that a key spells, or the key itself if it has a unit."""
    try:
        return float(text)
    except ValueError:
        return text


def _encode_quantity(value: float | str) -> float | str:
    if isinstance(value, WithUnit):
        return f"{float(value)!r} {value.unit}"
    return value if isinstance(value, str) else float(value)


KINDS = {
    "quantity": Kind(_parse_quantity, _check_quantity, encode=_encode_quantity),
    "series": Kind(_parse_series, _check_series, encode=list),
    "count": Kind(_parse_count, _check_count),
    "flag": Kind(_parse_flag, _check_flag),
    "text": Kind(_parse_text, _check_text),
    "choice": Kind(_parse_text, _check_choice),
    "choices": Kind(_parse_choices, _check_choices, encode=list),
    "words": Kind(_parse_words, encode=list),
    "criteria": Kind(_parse_criteria, _check_criteria, encode=lambda value: [list(pair) for pair in value]),
    "selection": Kind(_parse_selection, encode=dict),
    "pairs": Kind(_parse_pairs, encode=lambda value: {repr(float(a)): float(b) for a, b in value}),
    "matrix": Kind(lambda value, _, where: parse_matrix(value, where), encode=encode_matrix),
    "degrees": Kind(_parse_degrees, encode=lambda value: [list(degree) for degree in value]),
}


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


def _declare(kind: str, *, doc: str, example: str, default: Any = MISSING, **limits: Any) -> Any:
    """Declare a field of a kind.

    Parameters
    ----------
    doc, example : str
        Meaning in one line; a value as in a TOML file, `'"0.8 m"'`; for messages and the reference of keys.
    """
    return field(default=default, metadata={"kind": kind, "doc": doc, "example": example, **limits})


flag = partial(_declare, "flag")  # true or false
text = partial(_declare, "text")  # one line of text
choices = partial(_declare, "choices")  # some words among `of`, each at most once
words = partial(_declare, "words")  # a list of words
criteria = partial(_declare, "criteria")  # `flags`, and `measures` with a tolerance: pairs, with 0 for a flag
selection = partial(_declare, "selection", default=(), added=True)  # pairs of an axis and a value
pairs = partial(_declare, "pairs", default=())  # numbers in two `units`, as a table `{ 31.56 = 0.09 }`
matrix = partial(_declare, "matrix")  # square, (n_dof, n_dof), SI units
degrees = partial(_declare, "degrees")  # node and name of every row of a matrix


def quantity(
    unit: str,
    *,
    doc: str,
    example: str = "",
    default: Any = MISSING,
    above: float | None = None,
    at_least: float | None = None,
    below: float | None = None,
    or_words: tuple[str, ...] = (),
    or_unit: str = "",
    added: bool = False,
) -> Any:
    """Declare a field that holds a finite number in `unit` (SI, readable by pint), or one of some words.

    Parameters
    ----------
    doc, example : str
        As of any field (`_declare`); the example is by default that of the unit.
    or_unit : str
        Another unit that the number may have, as another key says; text keeps its unit (`WithUnit`).
    added : bool
        Whether rigs of older stores have no such key.
    """
    limits = {"above": above, "at_least": at_least, "below": below, "or_words": or_words, "added": added}
    other = {"or_unit": or_unit} if or_unit else {}
    example = example or example_of(unit)
    return _declare("quantity", doc=doc, example=example, default=default, unit=unit, **limits, **other)


def series(unit: str, *, at_least: float | None = None, **declared: Any) -> Any:
    """Declare a field that holds a tuple of finite numbers in `unit` (SI), none below a bound."""
    return _declare("series", unit=unit, above=None, at_least=at_least, below=None, **declared)


def count(
    *,
    at_least: int = 1,
    at_most: int | None = None,
    is_key: bool = True,
    or_words: tuple[str, ...] = (),
    gone: Mapping[str, str] = MappingProxyType({}),
    **declared: Any,
) -> Any:
    """Declare a field that holds a bounded whole number, or one of some words; a study may set a key.

    `gone` are words of older versions, with what a message says of each.
    """
    bounds: Any = {"at_least": at_least, "at_most": at_most, "or_words": or_words, "gone": gone}
    return _declare("count", is_key=is_key, **bounds, **declared)


def choice(*, of: tuple[str, ...], absent: str | None = None, **declared: Any) -> Any:
    """Declare a field that holds one word of a list; `absent`: what it means that a stored rig lacks it."""
    return _declare("choice", of=of, added=absent is not None, absent=absent, **declared)


def table(*, doc: str, default: Any = MISSING, added: bool = False) -> Any:
    """Declare a field that holds another dataclass, or a tuple of them: a table of its own in the file.

    `added`: older stores do not have it, and a rig with its default is described without it.
    """
    return field(default=default, metadata={"doc": doc, "added": added})


def key_of(declared: dataclasses.Field[Any]) -> str:
    """Return the key of a field in a file: its name, without the underscore that keeps `from_` a name."""
    return declared.name.rstrip("_")


def parse_field(declared: dataclasses.Field[Any], value: object, where: str) -> Any:
    """Return the value of a field from that of a file or caller; `check_fields` checks its bounds."""
    return KINDS[declared.metadata["kind"]].parse(value, declared.metadata, where)


def check_fields(owner: Any) -> None:
    """Refuse values that the declarations of a dataclass exclude; call it in `__post_init__`."""
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
