"""Packed arrays put back together: the model's own matrices, and nothing lost that is seen."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import block_diag

from rubhpc import read_rig
from rubhpc.fem.assemble import assemble
from rubhpc.integrate.packing import pack, pairs_of
from rubhpc.kernels.contact_pairs import N_DEGREE
from rubhpc.rig.forces import Unbalance
from rubhpc.rig.parts import Bearing

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
NAMES = ("v", "w", "thx", "axial", "lateral")


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


def from_diagonals(values, span, n):
    matrix = np.zeros((n, n))
    for row, (offset, first, last) in zip(values, span, strict=True):
        for column in range(first, last):
            matrix[column - offset, column] = row[column]
    return matrix


def test_diagonals_hold_the_matrices(model, packed):
    n = packed.mass.shape[0]
    order = np.argsort(packed.row)[-n:]  # the model's degree in each row
    assert np.array_equal(packed.row[order], np.arange(n))
    M, C, K = (matrix[np.ix_(order, order)] for matrix in whole(model))
    linear = packed.linear
    assert np.array_equal(packed.mass, M)
    assert np.array_equal(from_diagonals(linear.stiffness, linear.stiffness_span, n), K)
    assert np.array_equal(from_diagonals(linear.damping, linear.damping_span, n), C)
    assert len(linear.stiffness_span) < 20  # banded, so that a product costs little


def test_blocks_invert_the_effective_mass(packed):
    effective = packed.mass + STEP / 2 * packed.damping
    inverse = np.zeros_like(effective)
    start = packed.linear.start
    for b, (first, last) in enumerate(pairwise(start)):
        size = last - first
        inverse[first:last, first:last] = packed.linear.inverse[b, :size, :size].T
        assert not packed.linear.inverse[b, size:].any()
    assert inverse @ effective == pytest.approx(np.eye(len(effective)), abs=1e-9)
    # rotor bending, torsion, and each stator's axial and lateral motion; the second has no lateral one
    assert np.diff(start).max() == 4 * 15
    assert len(start) - 1 == 2 + 2 + 1 + 2


def test_only_what_nothing_seen_depends_on_is_left_out(model, packed):
    left_out = np.flatnonzero(packed.row < 0)
    degrees = [degree for body in bodies(model) for degree in body.degrees]
    assert {degrees[i][1] for i in left_out} == {"u"}  # axial motion of the rotor
    assert left_out.size == 14
    kept = np.flatnonzero(packed.row >= 0)
    for matrix in whole(model):
        assert not matrix[np.ix_(left_out, kept)].any()


def degree_positions(model):
    """Place of each pair's degrees in the model's order, None where held."""
    first = model.rotor.n_dof
    for stator in model.stators:
        rotor = [model.rotor.index(stator.node, name) for name in NAMES[:3]]
        tip = stator.body.n_dof // len({name for _, name in stator.body.degrees}) + 1
        yield [
            *rotor,
            *(
                first + stator.body.degrees.index((tip, name)) if (tip, name) in stator.body.degrees else None
                for name in NAMES[3:]
            ),
        ]
        first += stator.body.n_dof


def test_pairs_find_their_degrees(model, packed):
    for i, positions in enumerate(degree_positions(model)):
        for a, position in enumerate(positions):
            expected = -1 if position is None else packed.row[position]
            assert packed.degree_row[i, a] == expected, (i, NAMES[a])
            if expected >= 0:
                b = packed.degree_block[i, a]
                assert packed.linear.start[b] <= expected < packed.linear.start[b + 1]
    assert packed.degree_row[1, 4] == -1
    expected = [packed.row[model.rotor.index(8, name)] for name in NAMES[:3]]
    assert packed.output_row.tolist() == expected


def test_compliance_is_the_answer_to_a_force_over_a_step(model, packed):
    M, C, _ = whole(model)
    answer = STEP**2 * np.linalg.inv(M + STEP / 2 * C)
    positions = list(degree_positions(model))
    for i, a, j, b in np.ndindex(3, N_DEGREE, 3, N_DEGREE):
        one, other = positions[i][a], positions[j][b]
        expected = 0.0 if one is None or other is None else answer[one, other]
        assert packed.compliance[i, a, j, b] == pytest.approx(expected, rel=1e-9, abs=1e-25), (i, a, j, b)
    assert packed.compliance[0, 0, 2, 0] != 0.0  # the disc gives way to a force at another node


def test_arrays_are_contiguous_whatever_the_bearings(packed):
    """Kernels are compiled for each layout: other strides would take 16 s with central differences."""
    arrays = {name: values for name, values in packed.linear._asdict().items() if values.size > 1}
    assert "circulation_row" in arrays
    assert [name for name, values in arrays.items() if not values.flags.c_contiguous] == []


def test_unbalance_and_circulation_act_where_they_should(model, packed):
    linear, row = packed.linear, packed.row
    force = np.zeros((2, len(packed.mass)))
    force[:, linear.force_row] = linear.force_cosine, linear.force_sine
    assert np.array_equal(force, packed.force)
    for unbalance in RIG.rotor.unbalance:
        v, w = (row[model.rotor.index(unbalance.node, name)] for name in ("v", "w"))
        pull = unbalance.mass * unbalance.radius * SPIN**2 * np.exp(1j * unbalance.phase)
        for angle in (0.0, 1.0, 2.5):
            found = force[0] * math.cos(angle) + force[1] * math.sin(angle)
            assert complex(found[v], found[w]) == pytest.approx(pull * np.exp(1j * angle))
    assert linear.force_row.size == 4
    v, w = (row[model.rotor.index(1, name)] for name in ("v", "w"))
    places = zip(linear.circulation_row, linear.circulation_column, strict=True)
    skew = dict(zip(places, linear.circulation, strict=True))
    assert skew == {(v, w): pytest.approx(2.5e5), (w, v): pytest.approx(-2.5e5)}


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
