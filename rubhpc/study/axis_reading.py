"""Axes from a study file: lists, ranges and single values become values in SI units."""

from __future__ import annotations

import re
from dataclasses import Field, replace
from typing import TYPE_CHECKING, Any

from rubhpc.errors import InputError
from rubhpc.input.fields import check_value, parse_field
from rubhpc.input.messages import brief, nearest, place
from rubhpc.input.quantity import MOST_VALUES, RANGE_KEYS, read_ends, read_range
from rubhpc.input.reading import find_key
from rubhpc.study.axes import (
    FROM_REST,
    NO_NEIGHBOURS,
    OF_TABLES,
    OWN,
    SPEED_AXES,
    SWEEPS,
    TABLES,
    Axis,
    axis_table,
    coordinate_of,
    problem_of,
    unknown_sweep,
    why_not_swept,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rubhpc.rig.rig import Rig

_TABLE_KEYS = ("values", *RANGE_KEYS, "sweep")
NORMAL_KEYS = ("mean", "std")  # of a normal prior, which an identification reads


def make_axis(name: str, values: object, rig: Rig, file: str = "") -> Axis:
    """Return an axis from its entry in a file: a list, a range or a single value.

    Parameters
    ----------
    name : str
        A dotted key of the rig, "contact." and a key of [contact], "initial." and one of [initial],
        "run_up.time", "drive." and torque, start or inertia, or one of speed_ratio, speed, clearance_ratio,
        clearance, friction.
    values : list, dict or single value
        A dict is a range, stop included: `{start, stop, step}`, or `{start, stop, num}` with the `scale`
        "lin" or "log"; or it holds `values`. Either may say how the axis is swept: `{values, sweep}`.
    rig : Rig
        Whose keys the axis may name.
    file : str
        What errors name.
    """
    where = place(file, "grid", name)
    declared = declared_axis(name, rig, where)
    sweep, is_range = FROM_REST, False
    if isinstance(values, dict):
        values, sweep = _read_table(values, where)
        is_range = isinstance(values, dict)
    if sweep != FROM_REST and (problem := why_not_swept(name)):
        raise InputError(f"{where}: sweep: {problem}")
    return replace(
        _axis(name, declared, _read(declared, values, where), where), sweep=sweep, is_range=is_range
    )


def unit_of(name: str, rig: Rig) -> str:
    """Return the unit of an axis as quantities are written: "kg/m^3"; "" without dimension."""
    declared = declared_axis(name, rig, name)
    if declared.metadata["kind"] != "quantity":
        raise InputError(f"{name}: is not a quantity; give one, such as friction")
    return str(declared.metadata["unit"])


def make_range(name: str, table: Mapping[str, object], rig: Rig, file: str = "") -> Axis:
    """Return an axis whose values are yet to be drawn, from `{start, stop}` and the `scale` "lin" or "log".

    Until then they are the two ends (`rubhpc.study.sampling.draw`).
    """
    where = place(file, "grid", name)
    if "sweep" in table:
        raise InputError(f"{where}: sweep: {NO_NEIGHBOURS}")
    declared = declared_axis(name, rig, where)
    if declared.metadata["kind"] != "quantity":
        raise InputError(f"{where}: none but a quantity is drawn from a range; write a list of values")
    ends = read_ends(table, declared.metadata["unit"], where)
    if name in SPEED_AXES and ends.start * ends.stop < 0:
        span = f"from {ends.start:g} to {ends.stop:g}"
        raise InputError(
            f"{where}: the range {span} contains 0, which is not a valid speed; use one sign only"
        )
    return replace(_axis(name, declared, (ends.start, ends.stop), where), drawn_from=ends)


def _axis(name: str, declared: Field[Any], values: tuple[float, ...], where: str) -> Axis:
    if problem := problem_of(name, values):
        raise InputError(f"{where}: {problem}")
    return Axis(
        name=name,
        dimension=coordinate_of(name),
        unit=_store_unit(declared.metadata.get("unit", "")),
        values=values,
        long_name=_long_name(name),
    )


def _long_name(name: str) -> str:
    if name not in OWN:
        return name.replace("_", " ").replace(".", " ")
    doc: str = OWN[name].metadata["doc"].rstrip(".")
    return doc[0].lower() + doc[1:]


def flatten(table: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    """Return dotted keys and values of a table in which `stator.angle = 0` may be written without quotes."""
    pairs: list[tuple[str, Any]] = []
    for key, value in table.items():
        is_table = isinstance(value, dict) and value and not set(value) & {*_TABLE_KEYS, *NORMAL_KEYS}
        is_table = is_table and prefix + key not in OWN and prefix.count(".") < 8
        pairs += flatten(value, f"{prefix}{key}.") if is_table else [(prefix + key, value)]
    return pairs


def declared_axis(name: str, rig: Rig, where: str) -> Field[Any]:
    """Return the declaration of what an axis sets; InputError where it sets nothing."""
    known = OWN | OF_TABLES
    if name in known:
        return known[name]
    if table := axis_table(name):
        raise InputError(f"{where}: unknown axis; {nearest(name, TABLES[table])}")
    try:
        declared = find_key(rig, name)
    except InputError as error:
        hint = nearest(name, OWN)
        if "." not in name and "?" in hint:
            raise InputError(f"{where}: unknown axis; {hint}") from None
        if str(error).startswith("unknown key") and "?" not in str(error):
            raise InputError(
                f"{where}: unknown axis; there is {', '.join(OWN)} and any key of the rig"
            ) from None
        raise InputError(f"{where}: {str(error).replace('unknown key', 'unknown axis')}") from None
    if declared.metadata["kind"] == "choice":
        raise InputError(
            f"{where}: a key with text values cannot be an axis; set it in [override], one study per value"
        )
    return declared


def _read_table(table: Mapping[str, object], where: str) -> tuple[object, str]:
    """The values in `{values, sweep}` or a range with a sweep, and how they are swept."""
    for key in table:
        if key not in _TABLE_KEYS:
            raise InputError(f"{where}: unknown key {brief(key)} in a range; {nearest(key, _TABLE_KEYS)}")
    sweep = table.get("sweep", FROM_REST)
    if sweep not in SWEEPS:
        raise InputError(f"{where}: sweep: {unknown_sweep(sweep)}")
    rest = {key: value for key, value in table.items() if key != "sweep"}
    if "values" not in rest:
        return rest, str(sweep)
    if len(rest) > 1:
        other = next(key for key in rest if key != "values")
        raise InputError(f"{where}: {other} conflicts with values; give either a range or values")
    if isinstance(rest["values"], dict):
        raise InputError(f"{where}: values: {brief(rest['values'])} is not a list; write values = [...]")
    return rest["values"], str(sweep)


def _read(declared: Field[Any], values: object, where: str) -> tuple[float, ...]:
    if isinstance(values, dict):
        if declared.metadata["kind"] == "flag":
            raise InputError(f"{where}: a range between true and false; write [true, false]")
        if words := declared.metadata.get("of"):
            listed = ", ".join(f'"{word}"' for word in words)
            raise InputError(f"{where}: a range of words; write a list of them, such as [{listed}]")
        return tuple(read_range(values, declared.metadata.get("unit", ""), where))
    if not isinstance(values, list | tuple):
        values = [values]
    if len(values) > MOST_VALUES:
        raise InputError(f"{where}: {len(values)} values are too many; at most {MOST_VALUES}")
    return tuple(_number(declared, value, where) for value in values)


def _number(declared: Field[Any], value: object, where: str) -> float:
    """A value of a file as an axis holds it: of a word its place among the choices."""
    parsed = parse_field(declared, value, where)
    if declared.metadata["kind"] != "choice":
        if isinstance(parsed, str):
            raise InputError(f"{where}: {brief(parsed)} is a word; an axis has numbers, override takes words")
        return float(parsed)
    if problem := check_value(declared, parsed):
        raise InputError(f"{where}: {problem}")
    return float(declared.metadata["of"].index(parsed))


def _store_unit(unit: str) -> str:
    """Return a pint-readable unit in the notation of the store: "kg/m^3" becomes "kg m-3"."""
    over, _, under = unit.partition("/")
    factors = [f for f in over.replace("^", "").replace("*", " ").split() if f != "1"]
    for factor in under.split():
        symbol, power = re.fullmatch(r"(\D+?)\^?(\d*)", factor).groups()  # type: ignore[union-attr]
        factors.append(f"{symbol}-{power or 1}")
    return " ".join(factors) or "1"
