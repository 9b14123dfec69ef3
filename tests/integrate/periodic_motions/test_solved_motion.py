"""Motions that the cases of an operating point share: the same bits, whatever case has led to them."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from closed_form import read_rig, simulate
from set_ups import prepared

from rubhpc.integrate.case import run_case
from rubhpc.integrate.periodic_motions.approach import Approach
from rubhpc.integrate.periodic_motions.solved_motion import MOST_KEPT, SolvedMotions, rounded, solved_motions
from rubhpc.integrate.periodic_motions.tolerances import TO_ROUNDING
from rubhpc.rig.reading import with_keys
from rubhpc.schema import REGIME
from rubhpc.study.initial import Initial
from rubhpc.study.study import Recording

SPEED, CLEARANCE, FRICTION = 1.5 * 2.0 * math.pi * 31.56, 300e-6, 0.1  # rub and no contact coexist
SHORT = {"revolutions": 4, "samples_per_revolution": 32, "keep": ("section",)}
STARTS = [
    Initial(from_="contact_free", vertical=vertical, vertical_velocity=velocity)
    for vertical in (-1.5e-3, -0.5e-3, 0.7e-3)
    for velocity in (-0.3, -0.05, 0.2)
]


def set_up():
    rig = with_keys(read_rig("mokhtar2017"), {"stator.youngs_modulus": 30e9})
    return prepared(rig, SPEED, samples=32)


def run(setup, initial, transient="direct"):
    recording = Recording(transient=transient, **SHORT)
    return run_case(setup, clearance=CLEARANCE, friction=FRICTION, recording=recording, initial=initial)


def bits(record):
    measures = {k: np.asarray(v).tobytes() for k, v in record.measures.items() if k != "wall_time"}
    sections = {k: v.tobytes() for k, v in record.sections.items()}
    return measures | sections | {"final": record.final.packed().tobytes()}


def test_starts_settle_on_the_motions_that_a_long_transient_leads_to():
    setup = set_up()
    reached = set()
    for initial in STARTS:
        found, settled = (run(setup, initial, transient) for transient in ("direct", 200))
        assert (found.regime, found.period, found.settled) == (settled.regime, settled.period, 1)
        assert found.section_vertical == pytest.approx(settled.section_vertical, rel=1e-5)
        reached.add(REGIME[found.regime])
    assert reached == {"no_contact", "periodic"}
    kept = solved_motions(setup, (CLEARANCE, FRICTION, Recording(transient="direct", **SHORT)))
    assert len(kept) == 2


def test_records_are_of_the_start_alone_not_of_those_before():
    """First to last, last to first, and each with a set-up of its own."""
    first, second = set_up(), set_up()
    forth = [run(first, initial) for initial in STARTS]
    back = [run(second, initial) for initial in reversed(STARTS)][::-1]
    for initial, one, other in zip(STARTS, forth, back, strict=True):
        assert bits(one) == bits(other) == bits(run(set_up(), initial))


def test_one_case_by_itself_has_the_same_bits():
    setup = set_up()
    one = run(setup, STARTS[0])
    other = simulate(
        "mokhtar2017", speed=SPEED, clearance=CLEARANCE, friction=FRICTION, transient="direct",
        overrides={"stator.youngs_modulus": 30e9}, **SHORT,
        initial={"from": "contact_free", "vertical": -1.5e-3, "vertical_velocity": -0.3},
    )  # fmt: skip
    assert one.section_vertical.tobytes() == other.section_vertical.tobytes()
    for _ in range(2):  # a record may be changed: it is no one else's
        one.section_vertical[:] = np.nan
        one.measures["contact_fraction"][:] = np.nan
        one = run(setup, STARTS[0])
        assert one.section_vertical.tobytes() == other.section_vertical.tobytes()
        assert one.contact_fraction.tobytes() == other.contact_fraction.tobytes()


def test_motions_of_another_operating_point_take_their_place():
    setup = set_up()
    kept = solved_motions(setup, (1e-4, 0.1))
    assert solved_motions(setup, (1e-4, 0.1)) is kept
    assert solved_motions(setup, (2e-4, 0.1)) is not kept
    assert solved_motions(setup, (1e-4, 0.1)) is not kept


SPRING = SimpleNamespace(
    energy=np.array([100.0, 1.0]), size=lambda x: math.hypot(10.0 * x[0], x[1]), n=1,
    tolerances=TO_ROUNDING,
)  # fmt: skip


def orbit_at(motion):
    return SimpleNamespace(motion=np.array(motion), states=1, period=1, monodromy=0.5 * np.eye(2))


def test_solutions_a_rounding_apart_are_one_and_the_oldest_are_forgotten():
    kept, shot = SolvedMotions(), []

    def shoot_from(motion, states, period):
        shot.append(motion)
        return orbit_at(motion)

    def of(motion):
        return kept.of(SPRING, orbit_at(motion), shoot_from)

    one = of([0.03, -1e-14])
    assert of([0.03 + 1e-12, 1e-13]) is one
    assert len(shot) == 1
    assert shot[0] == pytest.approx([0.03, 0.0], abs=2.0**-20)
    assert of([0.03 + 1e-6, 0.0]) is not one
    for k in range(MOST_KEPT):
        of([0.04 + 1e-3 * k, 0.0])
    assert len(kept) == MOST_KEPT
    assert of([0.03, 0.0]) is not one


def test_rounding_leaves_displacements_and_velocities_as_exact_as_each_other():
    motion = np.array([1.0 / 30.0, 1.0 / 3.0])
    apart = (rounded(motion, SPRING) - motion) * np.sqrt(SPRING.energy)
    assert apart == pytest.approx(0.0, abs=2.0**-22)


def test_distances_are_the_energies_of_all_periods_to_come():
    """Of a matrix of low rank whose largest multipliers are a pair of modulus 0.97, in unlike components."""
    random, n = np.random.default_rng(5), 12
    block = np.zeros((n, n))
    block[:2, :2] = 0.97 * np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    block[2:7, 2:7] = np.diag(np.linspace(0.1, 0.9, 5))
    basis, scale = np.eye(n) + 0.2 * random.standard_normal((n, n)), np.repeat([1e4, 1.0], n // 2)
    matrix = basis @ block @ np.linalg.inv(basis) * scale / scale[:, np.newaxis]
    moved = apart = np.cos(np.arange(n)) / scale
    total = 0.0
    for _ in range(1200):
        total += scale**2 @ moved**2
        moved = matrix @ moved
    approach = Approach(matrix, scale**2)
    assert approach.is_stable
    assert approach.squares(apart[np.newaxis]) == pytest.approx([total], rel=1e-10)
    for largest in (1.0, 1.001, 1e3, 1e60):
        assert not Approach(largest / 0.97 * matrix, scale**2).is_stable
    assert Approach(0.0 * matrix, scale**2).is_stable
