"""Every key of the study and rig files is declared with its meaning and an example that its field takes."""

from __future__ import annotations

import dataclasses
import inspect
import tomllib

import pytest

from rubhpc.input.fields import check_value, parse_field
from rubhpc.input.reading import build
from rubhpc.rig import bearing_table, parts, rig, rotors, stators, supports
from rubhpc.rig.reading import read_rig
from rubhpc.simulate import simulate
from rubhpc.study import axes, axis_reading, branch_keys, contact_keys, initial, refine, run_up_keys, tables

TABLES = {
    cls
    for module in (
        *(bearing_table, rig, rotors, parts, stators, supports),
        *(contact_keys, tables, initial, refine, run_up_keys, branch_keys),
    )
    for cls in vars(module).values()
    if isinstance(cls, type) and dataclasses.is_dataclass(cls) and cls.__module__.startswith("rubhpc.")
    if any("doc" in declared.metadata for declared in dataclasses.fields(cls))
}
FIELDS = [
    pytest.param(cls, field, id=f"{cls.__name__}.{field.name}")
    for cls in sorted(TABLES, key=lambda cls: cls.__name__)
    for field in dataclasses.fields(cls)
    if not field.metadata.get("derived")
]


@pytest.mark.parametrize(("cls", "field"), FIELDS)
def test_a_key_has_a_meaning_and_an_example(cls, field):
    assert field.metadata["doc"].endswith(".")
    assert "\n" not in field.metadata["doc"]
    kind = field.metadata.get("kind")
    if kind is None:
        return  # a table, whose keys have examples
    table = tomllib.loads(f"{field.name} = {field.metadata['example']}")
    if kind == "pairs":
        assert build(cls, table, "a.toml")
    else:
        assert check_value(field, parse_field(field, table[field.name], "a.toml")) == ""


def test_keys_of_contact_are_arguments_of_functions():
    declared = {field.name for field in dataclasses.fields(contact_keys.ContactKeys)}
    assert set(contact_keys.ContactArguments.__annotations__) == declared
    assert declared <= set(inspect.signature(simulate).parameters)


@pytest.mark.parametrize("field", [pytest.param(f, id=f.name) for f in dataclasses.fields(axes.OwnAxes)])
def test_an_axis_has_a_meaning_and_an_example(field):
    assert field.metadata["doc"].endswith(".")
    example = tomllib.loads(f"axis = {field.metadata['example']}")["axis"]
    axis = axis_reading.make_axis(field.name, example, read_rig("mokhtar2017"))
    assert len(axis.values) > 1
