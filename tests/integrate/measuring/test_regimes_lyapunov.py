"""Lyapunov exponents with known answers: a damped oscillator, and one that strikes a wall."""

import math
from functools import partial
from itertools import islice

import numpy as np
import pytest
from closed_form import read_rig, simulate
from impact_map import RESTITUTION, next_impact
from scipy.optimize import fsolve
from set_ups import prepared

from rubhpc import LumpedStator, Rig, State, Unbalance
from rubhpc.integrate.carried_tangent import CarriedTangent
from rubhpc.integrate.lyapunov import N_ALIGNING, Growth, Marches
from rubhpc.integrate.marches.central_difference import CentralDifferenceMarch
from rubhpc.integrate.marches.collocation import CollocationMarch
from rubhpc.integrate.marches.event_driven import EventDrivenMarch
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
from rubhpc.schema import REGIME
from rubhpc.study.study import Recording

MARCHES = {
    "modal": EventDrivenMarch,
    "collocation": CollocationMarch,
    "central-difference": CentralDifferenceMarch,
}


def oscillator(spin, *, damping=None, restitution=None, wall=1e-12):
    """x'' + damping x' + x = cos(spin t), and a wall: what `simulate` takes."""
    rig = Rig.from_matrices(
        [[1.0]],
        None if damping is None else [[damping]],
        [[1.0]],
        degrees=[(1, "v")],
        stators=[LumpedStator(node=1, rigid=True, radius=1.0)],
        unbalance=[Unbalance(node=1, mass=1.0, radius=1 / spin**2)],
    )
    return rig, {
        "speed": spin,
        "clearance": wall,
        "friction": 0.0,
        "restitution": restitution,
        "step": 1e-3,
        "samples_per_revolution": 64,
    }


def growth_of(rig, given, state, n_span, march=EventDrivenMarch):
    """Growth per revolution in spans after a state, of a case given as to `simulate`."""
    method = "central-difference" if march is CentralDifferenceMarch else "modal"
    setup = prepared(
        rig,
        given["speed"],
        samples=given["samples_per_revolution"],
        method=method,
        step=given.get("step"),
        restitution=given.get("restitution"),
    )
    if state is None:
        state = State.at_rest(setup.model)
    recording = Recording(samples_per_revolution=given["samples_per_revolution"])
    start = partial(march, setup, given["clearance"], given["friction"], check=None)

    def begin():
        if march is EventDrivenMarch:
            motion = PiecewiseMotion(setup, given["clearance"], given["friction"], state)
            neighbours = CarriedTangent(motion)
        else:
            neighbours = Marches(lambda initial: start(initial=initial), state, setup, recording)
        neighbours.most_spans = n_span + N_ALIGNING
        return neighbours

    return np.array(list(islice(Growth(begin), n_span)))


def slope(time, speed, spin, by=1e-6):
    """Matrix of `next_impact` with respect to time and speed, by differences."""
    columns = [
        (next_impact(time + dt, speed + dv, spin) - next_impact(time - dt, speed - dv, spin)) / (2 * by)
        for dt, dv in ((by, 0.0), (0.0, by))
    ]
    return np.column_stack(columns)


def multipliers(spin):
    """Floquet multipliers of the motion with one impact a revolution."""
    turn = 2 * math.pi / spin

    def miss(place):
        return next_impact(*place, spin) - place - [turn, 0.0]

    return np.linalg.eigvals(slope(*fsolve(miss, [1.15, -0.38], xtol=1e-10), spin))


@pytest.mark.parametrize("march", ["modal", "central-difference"])
def test_exponent_of_a_damped_oscillator_is_its_decay(march):
    """Turning with the spin, velocity and displacement weigh the same, and the decay is even."""
    rig, given = oscillator(1.0, damping=0.04, wall=1e3)
    state = simulate(rig, **given, transient=3, revolutions=1).final
    found = growth_of(rig, given, state, 4, MARCHES[march])
    assert found == pytest.approx(-0.04 / 2 * 2 * math.pi, rel=1e-2)


def test_impacts_take_their_share_of_the_phase_space():
    """Undamped flight keeps areas and an impact shrinks them by e^2: complex multipliers are of size e."""
    spin = 2.64
    assert np.abs(multipliers(spin)) == pytest.approx([RESTITUTION, RESTITUTION], rel=1e-6)
    rig, given = oscillator(spin, restitution=RESTITUTION)
    state = simulate(rig, **given, transient=300, revolutions=1).final
    found = growth_of(rig, given, state, 384)  # the angle comes round unevenly
    assert found.mean() == pytest.approx(math.log(RESTITUTION), abs=0.004)


def test_every_integrator_finds_one_exponent():
    """Period 1 of the packaged rig: 0.524 per revolution, the central difference in steps of 2 us.

    Complex multipliers: the growth goes up and down with the angle of the displacement, so that spans at both
    ends of a mean have less weight.
    """
    given = {"speed_ratio": 0.75, "clearance": 84e-6, "friction": 0.3, "samples_per_revolution": 64}
    record = simulate("mokhtar2017", **given, revolutions=1)
    given = given | {"speed": float(record.spin_speed), "step": 2e-6}
    found = {
        name: growth_of(read_rig("mokhtar2017"), given, record.final, 14, march)
        for name, march in MARCHES.items()
    }
    mean = {name: np.average(growth, weights=np.bartlett(16)[1:-1]) for name, growth in found.items()}
    for name in ("collocation", "central-difference"):
        assert mean[name] == pytest.approx(mean["modal"], rel=0.01), name


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"speed_ratio": 2.25, "clearance_ratio": 0.95}, "chaotic"),
        (
            {"speed_ratio": 4.9, "clearance_ratio": 0.97, "overrides": {"stator.youngs_modulus": "30 GPa"}},
            "quasi_periodic",
        ),
        (
            {"speed_ratio": 5.3, "clearance_ratio": 0.70, "overrides": {"stator.youngs_modulus": "30 GPa"}},
            "periodic",
        ),
        ({"speed_ratio": 0.75, "clearance_ratio": 1.01}, "no_contact"),
    ],
)
def test_rub_of_each_kind(given, expected):
    """Their exponents over 640 revolutions: 0.30, 0.0001, -0.10, and none."""
    record = simulate("mokhtar2017", **given)
    assert REGIME[record.regime] == expected
    again = simulate("mokhtar2017", **given)
    assert again.lyapunov_exponent == pytest.approx(record.lyapunov_exponent, rel=0, abs=0, nan_ok=True)
