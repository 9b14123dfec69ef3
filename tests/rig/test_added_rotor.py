"""A rotor of another kind, added as CONTRIBUTING says: a class of keys and its assembly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import get_type_hints

import numpy as np
import pytest
from closed_form import read_rig, simulate

from rubhpc.errors import InputError
from rubhpc.fem.model import Body
from rubhpc.fem.rotor import assemble_rotor
from rubhpc.input import reading
from rubhpc.input.fields import FieldError, check_fields, quantity
from rubhpc.rig import rig as rig_module
from rubhpc.rig.rig import Rig
from rubhpc.rig.rotors import AnyRotor, RotorForces

DEGREES = ((1, "v"), (1, "w"))
JEFFCOTT = {"mass": 2.65, "stiffness": 1.43e5, "damping": 84.0}


@dataclass(frozen=True, kw_only=True, eq=False)
class Jeffcott(RotorForces):
    """A disc in the middle of a massless shaft."""

    mass: float = quantity("kg", doc="Mass of the disc.", example='"2.65 kg"', above=0)
    stiffness: float = quantity("N/m", doc="Stiffness of the shaft.", example='"1.43e5 N/m"', above=0)
    damping: float = quantity("N s/m", doc="Damping.", example='"84 N s/m"', default=0.0, at_least=0)
    displacement_limit = 0.1  # m

    def __post_init__(self) -> None:
        check_fields(self)
        for key, force in self.node_forces():
            self.check_node(f"{key}.node", force.node)

    def check_node(self, key, node):
        if node != 1:
            raise FieldError(key, f"{node} is no node; a Jeffcott rotor has one, 1")

    def can_move(self, node, angle):
        return True

    def rim_radius(self, node):
        return None

    def recorded_node(self, stator_nodes):
        return 1


@assemble_rotor.register(Jeffcott)
def _(rotor: Jeffcott) -> Body:
    one = np.eye(2)
    return Body(
        mass=rotor.mass * one,
        damping=rotor.damping * one,
        gyroscopic=0.0 * one,
        stiffness=rotor.stiffness * one,
        degrees=DEGREES,
    )


RIG = """
name = "jeffcott"
[rotor]
mass = "2650 g"
stiffness = 1.43e5
damping = 84.0
gravity = 9.81
[[rotor.unbalance]]
node = {node}
mass = "8 g"
radius = "4.5 cm"
[[stator]]
node = 1
count = 8
radius = "5 cm"
mass = "0.5 g"
stiffness = 1.9e6
damping = 2.0
"""


@pytest.fixture
def known(monkeypatch):
    """Have rig files read the new kind: the one line that a source tree would change."""
    monkeypatch.setattr(rig_module, "AnyRotor", AnyRotor | Jeffcott)
    monkeypatch.setattr(reading, "_hints", get_type_hints)  # which remembers what was read before


def written(tmp_path, **values):
    path = tmp_path / "jeffcott.toml"
    path.write_text(RIG.format(**({"node": 1} | values)))
    return path


def test_it_rubs_as_the_rotor_of_the_same_matrices_does(known, tmp_path):
    """A ring of eight stators under gravity."""
    given = read_rig(written(tmp_path))
    assert isinstance(given.rotor, Jeffcott)
    one = np.eye(2)
    same = Rig.from_matrices(
        *(JEFFCOTT[key] * one for key in ("mass", "damping", "stiffness")),
        degrees=DEGREES,
        stators=given.stator,
        unbalance=given.rotor.unbalance,
        gravity=given.rotor.gravity,
    )
    case = {"speed_ratio": 0.9, "clearance": "250 um", "friction": 0.02, "transient": 10, "revolutions": 8}
    new, old = simulate(given, **case), simulate(same, **case)
    assert new.peak_contact_force.max() > 10.0
    assert np.array_equal(new.peak_contact_force, old.peak_contact_force)
    assert np.array_equal(new.vertical, old.vertical)


def test_its_own_checks_name_the_key(known, tmp_path):
    with pytest.raises(
        InputError, match=r"\[rotor.unbalance.1\] node: 3 is no node; a Jeffcott rotor has one, 1"
    ):
        read_rig(written(tmp_path, node=3))
