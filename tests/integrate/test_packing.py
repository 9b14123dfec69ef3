"""Packed arrays put back together: the model's own matrices, and nothing lost that is seen."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import read_rig
from scipy.linalg import block_diag

from rubhpc.fem.assemble import assemble
from rubhpc.integrate.packing import pack, pairs_of
from rubhpc.rig.parts import Bearing
from rubhpc.rig.rotors import Unbalance

SPIN, STEP = 350.0, 6e-7
PACKAGED = read_rig("mokhtar2017")
STATOR = PACKAGED.stator[0]
RIG = replace(
    PACKAGED,
    rotor=replace(
        PACKAGED.rotor,
        bearing=(
            Bearing(node=1, kyy=1e6, kzz=2e6, kyz=3e5, kzy=-2e5, cyy=20.0, czz=10.0, cyz=3.0, czy=-1.0),
            Bearing(node=15, stiffness=8e5, damping=5.0),
        ),
        unbalance=(*PACKAGED.rotor.unbalance, Unbalance(node=4, mass=0.01, radius=0.02, phase=1.0)),
    ),
    stator=(
        STATOR,
        replace(STATOR, angle=2.0, lateral=False, youngs_modulus=1e9),
        replace(STATOR, angle=-1.0, node=5, radius=0.03, clearance_offset=2e-5),
    ),
)


@pytest.fixture(scope="module")
def model():
    return assemble(RIG)


@pytest.fixture(scope="module")
def packed(model):
    return pack(model, SPIN, STEP)


def bodies(model):
    return model.bodies


def whole(model):
    """M, C and K of all bodies in the model's order."""
    return (
        block_diag(*(body.mass for body in bodies(model))),
        block_diag(*(body.damping + SPIN * body.gyroscopic for body in bodies(model))),
        block_diag(*(body.stiffness for body in bodies(model))),
    )


def test_only_what_nothing_seen_depends_on_is_left_out(model, packed):
    left_out = np.flatnonzero(packed.row < 0)
    degrees = [degree for body in bodies(model) for degree in body.degrees]
    assert {degrees[i][1] for i in left_out} == {"u"}  # axial motion of the rotor
    assert left_out.size == 14
    kept = np.flatnonzero(packed.row >= 0)
    for matrix in whole(model):
        assert not matrix[np.ix_(left_out, kept)].any()


def test_arrays_are_contiguous_whatever_the_bearings(packed):
    """Kernels are compiled for each layout: other strides would take 16 s with central differences."""
    arrays = {name: values for name, values in packed.linear._asdict().items() if values.size > 1}
    assert "circulation_row" in arrays
    assert [name for name, values in arrays.items() if not values.flags.c_contiguous] == []


@pytest.mark.parametrize("spin", [SPIN, -SPIN])
def test_pairs_take_geometry_from_the_stators_and_sense_from_the_spin(model, packed, spin):
    pairs = pairs_of(
        model,
        row=packed.degree_row,
        block=packed.degree_block,
        compliance=packed.compliance,
        clearance=1e-4,
        friction=0.3,
        spin=spin,
        is_updated=True,
    )
    assert pairs.axis_y + 1j * pairs.axis_z == pytest.approx(np.exp(1j * np.array([0.0, 2.0, -1.0])))
    assert pairs.radius.tolist() == [0.06, 0.06, 0.03]
    assert pairs.clearance == pytest.approx([1e-4, 1e-4, 1.2e-4])
    assert pairs.friction.tolist() == [math.copysign(0.3, spin)] * 3
    assert pairs.is_updated
