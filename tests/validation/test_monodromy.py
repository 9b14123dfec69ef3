"""Derivatives of a revolution by its beginning, against an integration in all degrees of freedom."""

from dataclasses import replace

import numpy as np
import pytest
from full_order_flow import FullOrder
from full_order_stick import OPEN, STUCK, FullOrderStick
from trial_rig import trial_rig

from rubhpc import LumpedStator
from rubhpc.fem.assemble import assemble, model_at
from rubhpc.fem.response import contact_free_amplitude, first_lateral_frequency
from rubhpc.fem.statics import sag_at_stators
from rubhpc.integrate.periodic_motion import find_periodic_motion
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
from rubhpc.integrate.periodic_motions.saltation import monodromy
from rubhpc.integrate.setup import prepare
from rubhpc.rig.reading import read_rig, with_keys
from rubhpc.study.initial import Initial
from rubhpc.study.study import Contact, Integrator, Recording

ALL_MODES = Integrator(accuracy=1e-12)
OVERHUNG = {"rotor.bearing.2.node": 2, "rotor.gravity": "9.81 m/s^2"}  # the disc beyond both bearings, below


def kept_closed(piecewise, direction):
    """What is left of a change (2 n,) of the beginning in its contact mode: closed gaps stay closed."""
    tables = piecewise.mode(piecewise.states).tables
    re, im = direction @ tables.enter_re, direction @ tables.enter_im
    return tables.shape_re @ re - tables.shape_im @ im


def ring_of(count):
    """The packaged rotor in a ring of springs."""
    springs = LumpedStator(node=8, radius=0.06, count=count, mass=1e-3, damping=2.0, stiffness=1e5)
    return replace(read_rig("mokhtar2017"), stator=(springs,))


@pytest.mark.parametrize(
    ("rig", "ratio", "clearance_ratio", "friction"),
    [
        (trial_rig(1), 1.4, 0.6, 0.3),
        (trial_rig(3), 1.3, 0.8, 0.1),
        (with_keys(trial_rig(2), {"rotor.gravity": "9.81 m/s^2"}), 1.2, 0.7, 0.2),
        (trial_rig(2, lateral=False), -1.3, 0.7, 0.2),
        pytest.param(with_keys(trial_rig(2), OVERHUNG), 1.25, 0.5, 0.2, marks=pytest.mark.long),
        pytest.param(ring_of(3), 1.25, 0.85, 0.05, marks=pytest.mark.long),
        pytest.param(ring_of(5), 1.25, 0.8, 0.05, marks=pytest.mark.long),
        pytest.param(ring_of(16), 1.25, 0.8, 0.05, marks=pytest.mark.long),
    ],
    ids=["one", "three", "gravity", "backward", "overhung", "ring of 3", "ring of 5", "ring of 16"],
)
def test_periodic_motion_and_its_monodromy_are_those_of_all_degrees_of_freedom(
    rig, ratio, clearance_ratio, friction
):
    model = assemble(rig)
    spin = ratio * first_lateral_frequency(model)
    clearance = clearance_ratio * contact_free_amplitude(model, spin)
    setup = prepare(
        rig, spin, contact=Contact(), integrator=ALL_MODES, samples_per_revolution=64, model=model
    )
    case = {"clearance": clearance, "friction": friction}
    motion = find_periodic_motion(
        setup, **case, period=1, repeat=1, recording=Recording(transient=40, keep=()), initial=Initial()
    )
    piecewise = PiecewiseMotion(setup, clearance, friction, motion.state)
    whole = FullOrder(model_at(model, spin), spin, clearance - sag_at_stators(model)[0], friction)
    basis, n, start = setup.reduced.basis, piecewise.n, piecewise.start
    closed = tuple(np.flatnonzero(motion.state.contact_force > 0).tolist())
    size, scale = piecewise.size(start), np.repeat([1 / abs(spin), 1.0], n)

    def follow(reduced):
        u, v, passed = whole.revolve(basis @ reduced[:n], basis @ reduced[n:], closed)
        return np.concatenate([setup.reduced.project @ u, setup.reduced.project @ v]), passed

    end, passed = follow(start)
    assert any(passed)
    assert set(passed[0]) == set(passed[-1])
    assert piecewise.size(end - start) < 1e-7 * size

    mono = monodromy(piecewise, [piecewise.revolve(start, piecewise.states)])
    random = np.random.default_rng(1)
    for _ in range(2):
        direction = random.standard_normal(2 * n) * scale
        if closed:  # neighbours that keep the closed gaps closed
            direction = kept_closed(piecewise, direction)
        step = 1e-6 * size / piecewise.size(direction) * direction
        ahead, _ = follow(start + step)
        behind, _ = follow(start - step)
        change = piecewise.size((ahead - behind) / 2 - mono @ step)
        assert change < 1e-5 * piecewise.size(mono @ step)


@pytest.mark.parametrize(
    ("rig", "ratio", "clearance_ratio", "friction"),
    [
        pytest.param(trial_rig(1), 1.2, 0.5, 1.0, id="stuck at the section"),
        pytest.param(trial_rig(2), 0.6, 0.8, 1.0, id="one after the other", marks=pytest.mark.long),
        pytest.param(trial_rig(2), 1.7, 0.5, 1.0, id="both at once", marks=pytest.mark.long),
        pytest.param(trial_rig(2), 1.2, 0.8, 0.4, id="parted by an impact for 1 ns", marks=pytest.mark.long),
    ],
)
def test_monodromy_under_coulombs_law_is_that_of_all_degrees_of_freedom(
    rig, ratio, clearance_ratio, friction
):
    """Pairs touch, stick, slip and part; neighbours pass through the same states.

    What sticks forgets its slip. A pair that an impact elsewhere parts at 5 um/s is pressed shut again 1 ns
    later: the reference opens and closes it, the package keeps it closed. Neighbours of what is closed or
    stuck at the section are so too.
    """
    model = assemble(rig)
    spin = ratio * first_lateral_frequency(model)
    clearance = clearance_ratio * contact_free_amplitude(model, spin)
    setup = prepare(
        rig, spin, contact=Contact(friction_law="coulomb"), integrator=ALL_MODES, samples_per_revolution=64,
        model=model,
    )  # fmt: skip
    case = {"clearance": clearance, "friction": friction}
    motion = find_periodic_motion(
        setup, **case, period=1, repeat=1, recording=Recording(transient=60, keep=()), initial=Initial()
    )
    assert {event.kind for event in motion.events} == {"touch", "stick", "slip", "release"}
    piecewise = PiecewiseMotion(setup, clearance, friction, motion.state)
    whole = FullOrderStick(model_at(model, spin), spin, clearance - sag_at_stators(model)[0], friction)
    basis, n, start = setup.reduced.basis, piecewise.n, piecewise.start
    size, scale = piecewise.size(start), np.repeat([1 / abs(spin), 1.0], n)
    begun = np.concatenate([basis @ start[:n], basis @ start[n:], [1.0, 0.0, 1.0]])
    is_closed = motion.state.contact_force > 0
    states = whole.going_on(begun, tuple(np.where(is_closed, STUCK, OPEN).tolist()))

    def follow(reduced):
        u, v, passed = whole.revolve(basis @ reduced[:n], basis @ reduced[n:], states)
        return np.concatenate([setup.reduced.project @ u, setup.reduced.project @ v]), passed

    end, passed = follow(start)
    assert any(STUCK in one for one in passed)
    assert piecewise.size(end - start) < 1e-8 * size
    mono = monodromy(piecewise, [piecewise.revolve(start, piecewise.states)])
    random = np.random.default_rng(1)
    for _ in range(2):
        direction = random.standard_normal(2 * n) * scale
        if is_closed.any():
            direction = kept_closed(piecewise, direction)
        step = 1e-6 * size / piecewise.size(direction) * direction
        (ahead, passed_ahead), (behind, passed_behind) = follow(start + step), follow(start - step)
        assert passed_ahead == passed_behind == passed
        change = piecewise.size((ahead - behind) / 2 - mono @ step)
        assert change < 1e-6 * piecewise.size(mono @ step)
