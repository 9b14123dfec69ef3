"""Keys as arguments of functions and as axes; tests/project/test_docs_reference.py looks at each key."""

from __future__ import annotations

import dataclasses
import inspect
import tomllib

import pytest

from rubhpc.rig.reading import read_rig
from rubhpc.simulate import simulate
from rubhpc.study import axes, axis_reading, contact_keys


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
