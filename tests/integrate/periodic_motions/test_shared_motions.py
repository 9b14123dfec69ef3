"""Transients that end on a motion that was solved once for all starts of an operating point."""

import math

import numpy as np
import pytest

from rubhpc import simulate
from rubhpc.integrate.case import run_case
from rubhpc.integrate.periodic_motions import shared_motions
from rubhpc.integrate.periodic_motions.known_motions import Approach
from rubhpc.integrate.setup import prepare
from rubhpc.rig.reading import read_rig, with_keys
from rubhpc.schema import REGIME
from rubhpc.study.initial import Initial
from rubhpc.study.study import Contact, Integrator, Recording

SPEED, CLEARANCE, FRICTION = 1.5 * 2.0 * math.pi * 31.56, 300e-6, 0.1  # rub and no contact coexist
SHORT = {"revolutions": 4, "samples_per_revolution": 32, "keep": ("section",)}
STARTS = [
    Initial(from_="contact_free", vertical=vertical, vertical_velocity=velocity)
    for vertical in (-1.5e-3, -0.5e-3, 0.7e-3)
    for velocity in (-0.3, -0.05, 0.2)
]


def set_up():
    rig = with_keys(read_rig("mokhtar2017"), {"stator.youngs_modulus": 30e9})
    return prepare(rig, SPEED, contact=Contact(), integrator=Integrator(), samples_per_revolution=32)


def run(setup, initial, transient):
    recording = Recording(transient=transient, **SHORT)
    return run_case(setup, clearance=CLEARANCE, friction=FRICTION, recording=recording, initial=initial)


def test_starts_settle_on_the_motions_that_a_long_transient_leads_to():
    setup = set_up()
    reached = set()
    for initial in STARTS:
        found, settled = (run(setup, initial, transient) for transient in ("shared", 200))
        assert (found.regime, found.period) == (settled.regime, settled.period)
        assert found.settled == 1
        assert found.transient_revolutions < 60
        assert found.section_vertical == pytest.approx(settled.section_vertical, rel=1e-5)
        reached.add(REGIME[found.regime])
    assert reached == {"no_contact", "periodic"}


def test_records_are_of_the_start_alone_not_of_those_before():
    first, second = set_up(), set_up()
    forth = [run(first, initial, "shared") for initial in STARTS]
    back = [run(second, initial, "shared") for initial in reversed(STARTS)][::-1]
    for one, other in zip(forth, back, strict=True):
        assert one.final.packed().tobytes() == other.final.packed().tobytes()
        assert {k: np.asarray(v).tobytes() for k, v in one.measures.items() if k != "wall_time"} == {
            k: np.asarray(v).tobytes() for k, v in other.measures.items() if k != "wall_time"
        }


def test_a_motion_that_no_fixed_start_reaches_is_solved_for(monkeypatch):
    monkeypatch.setattr(shared_motions, "_starts", lambda *_: iter(()))
    setup = set_up()
    found, settled = (run(setup, STARTS[-1], transient) for transient in ("shared", 200))
    assert (found.regime, found.period) == (settled.regime, settled.period)
    assert found.section_vertical == pytest.approx(settled.section_vertical, rel=1e-5)


def test_one_case_by_itself_has_the_same_bits():
    setup = set_up()
    one = run(setup, STARTS[0], "shared")
    run(setup, STARTS[1], "shared")
    other = simulate(
        "mokhtar2017", speed=SPEED, clearance=CLEARANCE, friction=FRICTION, transient="shared",
        overrides={"stator.youngs_modulus": 30e9}, **SHORT,
        initial={"from": "contact_free", "vertical": -1.5e-3, "vertical_velocity": -0.3},
    )  # fmt: skip
    assert one.section_vertical.tobytes() == other.section_vertical.tobytes()
    one.section_vertical[:] = np.nan  # a record may be changed: it is no one else's
    one.measures["contact_fraction"][:] = np.nan
    again = run(setup, STARTS[0], "shared")
    assert again.section_vertical.tobytes() == other.section_vertical.tobytes()
    assert again.contact_fraction.tobytes() == other.contact_fraction.tobytes()


def test_near_means_that_the_linear_theory_holds():
    """A map whose second order sends far disturbances elsewhere."""
    monodromy = np.array([[0.5, 0.3], [0.0, 0.6]])
    approach = Approach(monodromy, np.ones(2))

    def after(apart, n):
        for _ in range(n):
            apart = monodromy @ apart + 2.0 * apart**2
        return apart

    near, far = np.array([0.01, 0.01]), np.array([0.4, 0.1])
    assert approach.obeys(near, after(near, 1), 1)
    assert approach.obeys(near, after(near, 2), 2)
    assert not approach.obeys(far, after(far, 1), 1)
    assert not approach.obeys(near, near, 1)  # it stays away


@pytest.mark.parametrize("size", [1e-3, 0.9, 1.0 - 1e-6, 1.0, 1.0 + 1e-6, 1.2])
@pytest.mark.parametrize("angle", [0.0, 0.7, math.pi])
def test_stable_are_multipliers_within_the_unit_circle(size, angle):
    """Of a matrix of rank three, whose other multiplier lies well within."""
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    matrix = np.zeros((5, 5))
    matrix[:2, :2], matrix[2, 2] = size * turn, 0.3 * size
    random = np.random.default_rng(1).standard_normal((5, 5))
    approach = Approach(random @ matrix @ np.linalg.inv(random), np.ones(5))
    assert approach.is_stable == (size < 1.0)
    if approach.is_stable:
        found = approach.multiplier
        assert abs(found.real + 1j * abs(found.imag) - size * np.exp(1j * angle)) < 1e-7 * size
