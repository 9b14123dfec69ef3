"""The tables of a study file that depend on its rig or on each other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rubhpc.errors import InputError
from rubhpc.input.messages import brief, nearest, place
from rubhpc.input.quantity import parse_quantity
from rubhpc.input.reading import build
from rubhpc.rig.reading import with_keys
from rubhpc.study.axis_reading import flatten, make_axis, make_range, unit_of
from rubhpc.study.branch_keys import BranchKeys, branch_axis
from rubhpc.study.sampling import draw

if TYPE_CHECKING:
    from rubhpc.rig.rig import Rig
    from rubhpc.study.axes import Axis
    from rubhpc.study.tables import Sample

_MOST_AXES = 32  # arrays have 64 dimensions at most


def line_of_text(table: dict[str, Any], key: str, default: str, file: str) -> str:
    """A key whose value is one line of text."""
    value = table.get(key, default)
    if not isinstance(value, str) or not value.strip() or not value.isprintable():
        raise InputError(f'{place(file, "", key)}: {brief(value)} is not a line of text; write {key} = "..."')
    return value


def table_of(table: dict[str, Any], key: str, file: str) -> dict[str, Any]:
    """A table by its name; empty where it is left out."""
    value = table.get(key, {})
    if not isinstance(value, dict):
        raise InputError(
            f"{place(file, key)}: {brief(value)} is not a table; write [{key}] and its keys below"
        )
    return value


def overridden(rig: Rig, table: dict[str, Any], file: str) -> Rig:
    """The rig with the values of [override]."""
    try:
        return with_keys(rig, dict(flatten(table)))
    except InputError as error:
        raise InputError(f"{place(file, 'override')} {error}") from None


def read_branch(
    table: dict[str, Any],
    grid: dict[str, Any],
    rig: Rig,
    sample: Sample | None,
    file: str,
    *,
    is_refined: bool,
) -> BranchKeys:
    """Return the table [branch], its step in the unit of its axis."""
    along, step = table.get("along"), table.get("step")
    axes = dict(flatten(grid))
    if isinstance(along, str) and along not in axes:
        meant = nearest(along, axes)
        fix = meant if meant.startswith("did") else "add it as { start, stop }"
        raise InputError(f"{place(file, 'branch', 'along')}: {along} is not an axis of the grid; {fix}")
    if sample is not None:
        fix = "a sample has no axis to follow; remove [sample] or [branch]"
        raise InputError(f"{place(file, 'branch')}: {fix}")
    if is_refined:
        raise InputError(f"{place(file, 'branch')}: branches are not refined; remove [refine] or [branch]")
    if isinstance(along, str) and isinstance(step, str):
        where = place(file, "branch", "step")
        try:
            table = {**table, "step": parse_quantity(step, unit_of(along, rig), where)}
        except InputError as error:
            raise InputError(str(error) if where in str(error) else f"{where}: {error}") from None
    return build(BranchKeys, table, file, "branch")


def read_axes(
    table: dict[str, Any], rig: Rig, sample: Sample | None, file: str, along: str
) -> tuple[Axis, ...]:
    """The axes of [grid], those of a sample drawn; `along` is the axis of a branch."""
    pairs = flatten(table)
    names = [name for name, _ in pairs]
    if len(names) > _MOST_AXES:
        problem = f"{len(names)} axes are too many; use at most {_MOST_AXES}, and [override] for the others"
        raise InputError(f"{place(file, 'grid')}: {problem}")
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{place(file, 'grid', name)}: is duplicated; remove one")
    if sample is None:
        return tuple(
            (branch_axis if name == along else make_axis)(name, values, rig, file) for name, values in pairs
        )
    axes = [(make_range if isinstance(v, dict) else make_axis)(name, v, rig, file) for name, v in pairs]
    try:
        return draw(axes, sample)
    except InputError as error:
        raise InputError(f"{place(file)}: {error}") from None
