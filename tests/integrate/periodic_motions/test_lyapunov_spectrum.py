"""Lyapunov spectra: damping, impacts and multipliers as known answers, and an independent map."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import periodic, simulate
from impact_map import RESTITUTION, next_impact
from set_ups import prepared

import rubhpc
from rubhpc import LumpedStator, Rig, State, Unbalance
from rubhpc.errors import InputError
from rubhpc.integrate.periodic_motions.collocated_motion import followed_motion
from rubhpc.integrate.periodic_motions.lyapunov_spectrum import exponents, kaplan_yorke_dimension
from rubhpc.study.study import Recording

SPIN = 2.8  # period doublings have led to chaos there


def oscillator(damping=0.0):
    """x'' + damping x' + x = cos(spin t), and a wall at 0."""
    return Rig.from_matrices(
        [[1.0]], [[damping]], [[1.0]],
        degrees=[(1, "v")],
        stators=[LumpedStator(node=1, rigid=True, radius=1.0)],
        unbalance=[Unbalance(node=1, mass=1.0, radius=1 / SPIN**2)],
    )  # fmt: skip


def exponents_of(record, n):
    return np.array([getattr(record, f"lyapunov_{k}") for k in range(1, n + 1)])


def free(n):
    return simulate(
        oscillator(0.2), speed=SPIN, clearance=5.0, friction=0.0, transient=4, revolutions=2, keep=(),
        samples_per_revolution=64, lyapunov=n,
    )  # fmt: skip


def test_sum_is_the_trace_of_the_flow():
    """Without contact: both exponents are -damping / 2 times a revolution; a third is not there."""
    record = free(3)
    assert exponents_of(record, 2) == pytest.approx(-0.1 * 2 * math.pi / SPIN, abs=2e-3)
    assert exponents_of(record, 2).sum() == pytest.approx(-0.2 * 2 * math.pi / SPIN, rel=1e-9)
    assert math.isnan(record.lyapunov_3)
    assert record.kaplan_yorke_dimension == 0.0
    assert record.lyapunov_exponent == record.lyapunov_1


def independent_exponents(n_impact=500):
    """Per revolution, by differences of the closed-form map from one impact to the next."""
    at = np.array([0.3, -0.5])
    for _ in range(100):
        at = next_impact(*at, SPIN)
    frame, grown, begun, h = np.eye(2), np.zeros(2), at[0], 1e-6
    for _ in range(n_impact):
        sides = [[next_impact(*(at + sign * h * e), SPIN) for sign in (1, -1)] for e in np.eye(2)]
        rows = [(ahead - behind) / (2 * h) for ahead, behind in sides]
        frame, triangle = np.linalg.qr(np.array(rows).T @ frame)
        grown += np.log(np.abs(np.diag(triangle)))
        at = next_impact(*at, SPIN)
    return grown / ((at[0] - begun) * SPIN / (2 * math.pi))


def test_impact_oscillator_has_the_exponents_of_its_map():
    """Means over four records of 256 revolutions and over 500 impacts: standard errors up to 0.02."""
    records = [
        simulate(
            oscillator(), speed=SPIN, clearance=1e-12, friction=0.0, restitution=RESTITUTION, step=1e-3,
            transient=transient, revolutions=64, keep=(), samples_per_revolution=64, lyapunov=2,
        )
        for transient in (100, 400, 700, 1000)
    ]  # fmt: skip
    found = np.mean([exponents_of(record, 2) for record in records], axis=0)
    assert found == pytest.approx(independent_exponents(), abs=0.05)
    assert found[0] > 0.25
    last = exponents_of(records[-1], 2)
    assert records[-1].kaplan_yorke_dimension == pytest.approx(1.0 + last[0] / -last[1])


@pytest.mark.parametrize(
    ("contact", "damping", "allowed"),
    [
        ({"restitution": RESTITUTION}, 0.02, 1e-7),
        ({"law": "penalty", "stiffness": 400.0, "damping": 0.0}, 0.0, 1e-3),
        ({"law": "penalty", "stiffness": 400.0, "damping": 1.5}, 0.02, 1e-3),
    ],
    ids=["restitution", "penalty", "damped penalty"],
)
def test_sum_is_the_trace_of_the_flow_between_impacts_and_in_contact(contact, damping, allowed):
    """Chaos: dampers act for as long as they are pressed, impacts take a share each, and events nothing."""
    setup = prepared(oscillator(damping), SPIN, step=1e-3, **contact)  # fmt: skip
    begun = replace(State.at_rest(setup.model), rotor_velocity=np.array([0.3]))
    motion = followed_motion(setup.scheme)(setup, 1e-12, 0.0, begun)
    found = exponents(motion, 2, aligning=0, followed=100)
    pressed, n_event, logarithm = 0.0, 0, 0.0
    for revolution in motion.follow(motion.start, motion.states, 100):
        n_event += len(revolution.pieces) - 1
        pressed += sum(piece.duration for piece in revolution.pieces if piece.states != 0)
        if "restitution" in contact:
            logarithm += 2 * math.log(RESTITUTION) * sum(piece.touching.size for piece in revolution.pieces)
    assert n_event > 50
    assert found[0] > 0.1
    trace = damping * 100 * motion.turn + contact.get("damping", 0.0) * pressed
    assert found.sum() == pytest.approx((logarithm - trace) / 100, rel=allowed, abs=0.1 * allowed)


def test_periodic_motion_has_the_logarithms_of_its_multipliers():
    """But for what the displacements still turn in 256 revolutions, each by a share of 1/256."""
    case = {"speed_ratio": 0.75, "clearance": "100 um", "keep": ()}
    record = simulate("mokhtar2017", transient=300, revolutions=16, lyapunov=3, **case)
    motion = periodic("mokhtar2017", period=2, **case)
    assert exponents_of(record, 3) == pytest.approx(np.log(np.abs(motion.multipliers[:3])) / 2, abs=1e-2)
    assert record.kaplan_yorke_dimension == 0.0


def test_laws_without_closed_form_have_none():
    record = simulate(
        oscillator(0.2), speed=SPIN, clearance=5.0, friction=0.0, method="central-difference", step=1e-2,
        transient=1, revolutions=1, keep=(), samples_per_revolution=64, lyapunov=1,
    )  # fmt: skip
    assert math.isnan(record.lyapunov_1)


@pytest.mark.parametrize(
    ("found", "is_whole", "dimension"),
    [((-0.1, -0.2), True, 0.0), ((0.4, -0.8, -3.0), True, 1.5), ((0.1, 0.0, -0.4), False, 2.25),
     ((0.1, 0.0), False, math.nan), ((0.4, -math.inf), True, 1.0), ((0.2, 0.1), True, 2.0)],
)  # fmt: skip
def test_dimension_of_kaplan_and_yorke(found, is_whole, dimension):
    assert kaplan_yorke_dimension(np.array(found), is_whole=is_whole) == pytest.approx(dimension, nan_ok=True)


def test_studies_store_them(tmp_path):
    study = tmp_path / "study.toml"
    study.write_text(
        """
rig = "mokhtar2017"
[grid]
speed_ratio = 0.75
clearance = ["100 um", "1 mm"]
friction = 0.3
[record]
transient = 40
revolutions = 4
keep = []
lyapunov = 2
"""
    )
    store = tmp_path / "spectra.zarr"
    rubhpc.run(study, output=store, quiet=True)
    with rubhpc.open(store) as cases:
        assert cases.lyapunov_1.shape == cases.lyapunov_2.shape
        assert (cases.lyapunov_1 < 0.0).all()
        assert (cases.kaplan_yorke_dimension == 0.0).all()
    assert "lyapunov" not in Recording().as_dict()
    with pytest.raises(InputError, match="lyapunov"):
        Recording(lyapunov=-1)
