"""What docs/guide/rigs.md shows is so."""

import re
import tomllib
from pathlib import Path

import pytest

from rubhpc import Bore, read_rig
from rubhpc.rig.reading import rig_from_dict

DOCUMENT = (Path(__file__).parents[2] / "docs" / "guide" / "rigs.md").read_text()
SHOWN = {block for block in re.findall(r"```python\n(.*?)```", DOCUMENT, re.DOTALL) if "zarr" not in block}


def shown(word):
    (text,) = (block for block in SHOWN if word in block)
    run = {}
    exec(compile(text, "docs/guide/rigs.md", "exec"), run)
    return run


def test_bodies_by_their_matrices_run(capsys):
    record = shown("MatrixStator")["record"]
    assert record.status == 1
    assert record.contact_force.shape[0] == 2


def test_mass_on_a_stop_prints_what_is_said(capsys):
    shown("stop = ")
    assert [float(word) for word in capsys.readouterr().out.split()] == pytest.approx(
        [31.26e-3, 9950.36], rel=1e-5
    )


def test_oscillator_at_a_wall_prints_what_is_said(capsys):
    shown("w = 2.2")
    assert float(capsys.readouterr().out) == pytest.approx(1.86086, rel=1e-5)


def test_tables_of_stators_are_read():
    tables = (tomllib.loads(text) for text in re.findall(r"```toml\n(\[\[.*?)```", DOCUMENT, re.DOTALL))
    found = [table for table in tables if "stator" in table or "carrier" in table]
    ring, bent, carried, lumped, bores = (table["stator"] for table in found)
    packaged = read_rig("mokhtar2017").with_geometry("linear").as_dict()
    moved = packaged | {"stator": [packaged["stator"][0] | carried[0]], "carrier": found[2]["carrier"]}
    bending = rig_from_dict(packaged | {"stator": [packaged["stator"][0] | bent[0]]})
    assert bending.stator[0].geometry == "second_order"
    assert rig_from_dict(moved).carrier[0].name == rig_from_dict(moved).stator[0].carrier
    rig = rig_from_dict(packaged | {"stator": [packaged["stator"][0] | ring[0], *lumped]})
    assert len(rig.stator) == 14
    assert rig.stator[-1].rigid
    (seal,) = rig_from_dict(packaged | {"stator": bores}).stator
    assert isinstance(seal, Bore)
    assert seal.law.kind == "penalty"
