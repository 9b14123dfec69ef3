"""The reduced bodies against what the full ones answer, by solving the full equations."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from closed_form import read_rig
from equal_stators import in_ring
from scipy.linalg import block_diag, eigvals
from trial_rig import trial_rig

from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble
from rubhpc.fem.response import steady_response
from rubhpc.integrate.packing import degrees_of, output_degrees
from rubhpc.integrate.reduced_model.coupling import Grouped, coupled_rows
from rubhpc.integrate.reduced_model.reduction import reduce_model
from rubhpc.kernels.contact_pairs import AXIAL, LATERAL
from rubhpc.rig.parts import Damping, Torsion

SPIN = 210.0
FULL = 1e-30  # accuracy at which no mode that anything sees is left out


def whole(model, spin):
    """Matrices of all bodies, and rows (seen, n) that read the degrees of contact and output."""
    bodies = model.bodies
    mass = block_diag(*(body.mass for body in bodies))
    damping = block_diag(*(body.damping + spin * body.gyroscopic for body in bodies))
    stiffness = block_diag(*(body.stiffness for body in bodies))
    seen = np.concatenate([degrees_of(model).ravel(), output_degrees(model)])
    return mass, damping, stiffness, np.eye(len(mass))[seen] * (seen >= 0)[:, np.newaxis]


def rows_of(reduced):
    """The same rows, in reduced coordinates."""
    return np.vstack([reduced.degree.reshape(-1, reduced.degree.shape[2]), reduced.output])


def full_answer(model, frequency, spin):
    """Displacements of the seen degrees for unit forces on them that vary at a frequency (rad/s)."""
    mass, damping, stiffness, read = whole(model, spin)
    return read @ np.linalg.solve(stiffness - frequency**2 * mass + 1j * frequency * damping, read.T)


def reduced_answer(reduced, frequency):
    system = reduced.stiffness - frequency**2 * np.eye(len(reduced.stiffness))
    return rows_of(reduced) @ np.linalg.solve(system + 1j * frequency * reduced.damping, rows_of(reduced).T)


@pytest.mark.parametrize("accuracy", [1e-1, 1e-3])
def test_static_answers_are_those_of_the_full_bodies(accuracy):
    model = assemble(trial_rig(2))
    known = full_answer(model, 0.0, SPIN).real
    found = reduced_answer(reduce_model(model, SPIN, accuracy), 0.0).real
    size = np.sqrt(np.diag(known))
    # To 1e-6: directions that differ by less than 1e-8 of their size are taken for one.
    assert (found - known) / np.outer(size, size) == pytest.approx(0.0, abs=1e-6)


def test_unseen_modes_of_a_symmetric_rotor_are_left_out():
    """The disc in the middle of the packaged rotor stands at a node of every antisymmetric mode."""
    model = assemble(read_rig("mokhtar2017"))
    reduced = reduce_model(model, 0.0, FULL)
    square = np.linalg.eigvalsh(reduced.stiffness)
    lowest = np.sqrt(square[square < (2 * np.pi * 700) ** 2]) / (2 * np.pi)
    # Of 31.56, 189.41, 293.87, 471.81, 689.60 Hz in two planes, the even ones do not move the disc.
    assert lowest == pytest.approx([31.5596, 31.5596, 128.0471, 293.867, 293.867, 689.602, 689.602], rel=1e-4)


def test_more_accuracy_takes_more_coordinates_and_errs_less():
    model = assemble(trial_rig(2))
    frequencies = (500.0, 2e3, 8e3)
    known = [full_answer(model, frequency, SPIN) for frequency in frequencies]
    size, error = [], []
    for accuracy in (1e-1, 1e-3, 1e-5, 1e-7, 1e-9, FULL):
        reduced = reduce_model(model, SPIN, accuracy)
        size.append(len(reduced.stiffness))
        found = [reduced_answer(reduced, frequency) for frequency in frequencies]
        error.append(max(abs(f - k).max() / abs(k).max() for f, k in zip(found, known, strict=True)))
    assert size == sorted(size)
    assert size[0] < size[1] < size[-1]
    assert error[-1] < 1e-9
    assert error[1] < 0.1 * error[0]
    assert all(later <= earlier for earlier, later in pairwise(error))


@pytest.mark.parametrize("cross", [0.0, 2e5])
def test_dampers_of_bearings_and_drive_slow_the_modes_as_they_should(cross):
    """They act where nothing touches and nothing is recorded, and what they do does not keep modes apart."""
    rig = trial_rig(1, cross=cross)
    drive = Torsion(node=1, stiffness=3e3, damping=0.4)
    shaft = replace(rig.rotor.shaft[0], elements=12)
    disc, unbalance, bearing = (
        replace(part, node={3: 7, 5: 13}[part.node])
        for part in (rig.rotor.disc[0], rig.rotor.unbalance[0], rig.rotor.bearing[1])
    )
    rotor = replace(
        rig.rotor,
        shaft=(shaft,),
        disc=(disc,),
        unbalance=(unbalance,),
        bearing=(rig.rotor.bearing[0], bearing),
        torsion=drive,
    )
    model = assemble(replace(rig, rotor=rotor, stator=(replace(rig.stator[0], node=7),)))
    mass, damping, stiffness, _ = whole(model, SPIN)
    reduced = reduce_model(model, SPIN, 1e-3)
    assert len(reduced.stiffness) < len(mass) / 2
    known = exponents(mass, damping, stiffness)
    found = exponents(np.eye(len(reduced.stiffness)), reduced.damping, reduced.stiffness)
    slow = found[abs(found) < 2e3]
    assert len(slow) > 8
    for exponent in slow:
        assert abs(known - exponent).min() < 3e-5 * abs(exponent)


def exponents(mass, damping, stiffness):
    """Of the free motion, 1/s."""
    zero, one = np.zeros_like(mass), np.eye(len(mass))
    rate = [[zero, one], [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)]]
    return eigvals(np.block(rate))


@pytest.mark.parametrize("alpha", [0.0, 25.0])
@pytest.mark.parametrize("accuracy", [1e-3, FULL])
def test_body_that_nothing_holds_is_refused_with_the_fix(alpha, accuracy):
    rig = trial_rig(1)
    rotor = replace(rig.rotor, torsion=Torsion(free=True), damping=Damping(alpha=alpha))
    with pytest.raises(
        InputError, match=r"free to turn \(torsion\); give it a stiffness, however soft, or set"
    ):
        reduce_model(assemble(replace(rig, rotor=rotor)), SPIN, accuracy)


def test_drive_as_soft_as_a_clock_spring_is_not_taken_for_free():
    """0.01 N m/rad turns the rotor at 0.2 Hz."""
    rig = trial_rig(1)
    rotor = replace(rig.rotor, torsion=Torsion(node=1, stiffness=0.01))
    reduced = reduce_model(assemble(replace(rig, rotor=rotor)), SPIN, 1e-3)
    assert np.sqrt(np.linalg.eigvalsh(reduced.stiffness)[0]) / (2 * np.pi) == pytest.approx(0.2, rel=0.3)


@pytest.mark.parametrize("speed", [150.0, 1050.0, 4000.0, -20_000.0])
def test_unbalance_is_answered_at_any_speed(speed):
    """By the steady response of the full rotor, also where the spin is far above the contact frequency."""
    model = assemble(read_rig("mokhtar2017"))
    reduced = reduce_model(model, speed, 1e-3)
    system = reduced.stiffness - speed**2 * np.eye(len(reduced.stiffness)) + 1j * speed * reduced.damping
    found = reduced.output @ np.linalg.solve(system, reduced.force[0] - 1j * reduced.force[1])
    known = steady_response(model, speed)[output_degrees(model)]
    assert found == pytest.approx(known, abs=1e-3 * abs(known).max())


@pytest.mark.parametrize("n_stator", [1, 8])
def test_answers_of_a_ring_reduced_body_by_body(n_stator):
    """Accelerations over forces, of alike stators too: within the accuracy of those of all bodies at once."""
    model = assemble(in_ring(read_rig("mokhtar2017"), n_stator))
    reduced = reduce_model(model, SPIN, 1e-3)
    for frequency in (0.0, SPIN, 1000.0):
        found, full = reduced_answer(reduced, frequency), full_answer(model, frequency, SPIN)
        assert found == pytest.approx(full, abs=2e-3 * np.abs(full).max())
        apart = degrees_of(model)[:, AXIAL]
        own = np.flatnonzero(
            np.isin(np.concatenate([degrees_of(model).ravel(), output_degrees(model)]), apart)
        )
        assert np.diag(found)[own] == pytest.approx(np.diag(full)[own], rel=1e-4)


def test_products_group_by_group():
    rng = np.random.default_rng(5)
    sizes, widths = (4, 3, 3, 1), (2, 3, 3, 1)
    matrix = block_diag(*(rng.normal(size=(n, n)) for n in sizes))
    columns = block_diag(*(rng.normal(size=(n, m)) for n, m in zip(sizes, widths, strict=True)))
    mixed = rng.permutation(len(matrix))
    matrix, columns = matrix[np.ix_(mixed, mixed)], columns[mixed]
    groups = coupled_rows(matrix != 0.0)
    assert sorted(map(len, groups)) == sorted(sizes)
    assert [rows[0] for rows in groups] == sorted(rows[0] for rows in groups)
    for those in (groups, [np.arange(len(matrix))]):
        grouped = Grouped(those, columns)
        assert grouped.under(matrix) == pytest.approx(matrix @ columns)
        assert grouped.form(matrix) == pytest.approx(columns.T @ matrix @ columns)


def test_a_bent_stator_follows_an_axial_force_along_all_its_length():
    """Foreshortening by a tip's force, and by what an axial force adds to it, is that of all modes."""
    packaged = read_rig("mokhtar2017")
    model = assemble(replace(packaged, stator=(replace(packaged.stator[0], geometry="second_order"),)))
    reduced, stiffness = reduce_model(model, SPIN, 1e-3), whole(model, SPIN)[2]
    assert len(reduced.stiffness) < len(stiffness) / 2
    first, slope = model.stator_start[0], model.stators[0].squared_slope
    square = np.zeros_like(stiffness)
    square[first : first + len(slope), first : first + len(slope)] = slope
    force = np.eye(len(stiffness))[degrees_of(model)[0, LATERAL]]
    answer = np.linalg.inv(stiffness)
    known = reduced.basis @ np.linalg.solve(reduced.stiffness, reduced.basis.T)
    for load in (force, square @ answer @ force):
        found, full = known @ load, answer @ load
        assert found @ square @ found == pytest.approx(full @ square @ full, rel=1e-9)
