"""Stators of a ring share their body; those that differ do not."""

from dataclasses import replace

import numpy as np
import pytest
from closed_form import read_rig

from rubhpc.fem import statics
from rubhpc.fem.assemble import assemble
from rubhpc.fem.stator import assemble_stator

RIG = read_rig("mokhtar2017")


def ring(n, **changes):
    """The packaged rig in a ring of n stators, of which the last has some keys changed."""
    angles = 2.0 * np.pi * np.arange(n) / n
    stators = [replace(RIG.stator[0], angle=float(angle)) for angle in angles]
    stators[-1] = replace(stators[-1], **changes)
    return replace(RIG, stator=tuple(stators))


def test_stators_of_a_ring_are_those_assembled_alone():
    rig = ring(8, height=6e-3)
    model = assemble(rig)
    for stator, found in zip(rig.stator, model.stators, strict=True):
        alone = assemble_stator(stator, rig.contact_radius(stator))
        assert (found.angle, found.axial, found.lateral) == (stator.angle, alone.axial, alone.lateral)
        assert found.euler_load == alone.euler_load
        for name in ("mass", "damping", "gyroscopic", "stiffness"):
            np.testing.assert_array_equal(getattr(found.body, name), getattr(alone.body, name))
    assert len({id(stator.body) for stator in model.stators}) == 2


@pytest.mark.parametrize(
    "changes", [{"clearance_offset": 1e-5}, {"radius": 0.05}, {"node": 7, "radius": 0.06}]
)
def test_a_place_of_its_own_is_kept(changes):
    last = assemble(ring(3, **changes)).stators[-1]
    assert {name: getattr(last, name) for name in changes} == changes


def test_a_body_of_several_stators_is_searched_once(monkeypatch):
    asked = []
    monkeypatch.setattr(statics, "rigid_body_row", lambda body, rows: asked.append(body) or 0)
    model = assemble(ring(8, height=6e-3))
    assert statics.find_rigid_body_mode(model) == ""
    assert asked == [model.rotor, model.stators[0].body, model.stators[-1].body]
