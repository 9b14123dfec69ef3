"""Every declared kind of rotor, stator and force has its assembly."""

from __future__ import annotations

from typing import get_args

from rubhpc.fem.assemble import lateral_force
from rubhpc.fem.rotor import assemble_rotor
from rubhpc.fem.stator import assemble_stator
from rubhpc.rig.rotors import AnyRotor, NodeForce
from rubhpc.rig.stators import AnyStator


def test_every_kind_is_registered():
    for union, assembly in (
        (AnyRotor, assemble_rotor),
        (AnyStator, assemble_stator),
        (NodeForce, lateral_force),
    ):
        assert set(get_args(union)) <= set(assembly.registry)
