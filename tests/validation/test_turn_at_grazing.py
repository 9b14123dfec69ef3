"""A contact-free motion that turns at its grazing into an impacting one, held to all degrees of freedom."""

from dataclasses import replace

import numpy as np
import pytest
from full_order_flow import FullOrder

import rubhpc
from rubhpc import LumpedStator, read_rig
from rubhpc.fem.assemble import assemble, model_at
from rubhpc.fem.response import first_lateral_frequency
from rubhpc.fem.statics import sag_at_stators
from rubhpc.integrate.periodic_motion import find_periodic_motion
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
from rubhpc.integrate.periodic_motions.saltation import monodromy
from rubhpc.integrate.setup import prepare
from rubhpc.rig.reading import with_keys
from rubhpc.study.study import Contact, Integrator, Recording

RATIO, FRICTION, RESTITUTION = 1.25, 0.1, 0.3


class Rebounding(FullOrder):
    """Pairs hit one by one and are sent back."""

    def impact(self, state, candidates):
        (i,) = candidates
        n = self.n
        direction = self.inverse @ self.force[:, i]
        rate, give = self.gap[i, :n] @ state[n : 2 * n], self.gap[i, :n] @ direction
        state[n : 2 * n] -= (1.0 + RESTITUTION) * rate / give * direction
        return ()


def machine():
    """An overhung disc on three bearings under gravity, in a ring of six heavy segments."""
    rig = with_keys(read_rig("mokhtar2017"), {"rotor.gravity": "9.81 m/s^2"})
    first, last = rig.rotor.bearing
    rotor = replace(
        rig.rotor,
        bearing=(first, replace(last, node=6), replace(last, node=11)),
        disc=(replace(rig.rotor.disc[0], node=15),),
        unbalance=(replace(rig.rotor.unbalance[0], node=15),),
    )
    ring = LumpedStator(node=15, radius=0.06, count=6, mass=0.3, damping=300.0, stiffness=2e6)
    return replace(rig, rotor=rotor, stator=(ring,))


def test_contact_free_motion_turns_at_its_grazing_into_an_unstable_one_with_an_impact():
    """Depth, approach and 1 over the multiplier go with one another; the motions are those of all degrees."""
    rig = machine()
    (found,) = rubhpc.branch(
        rig, along="clearance", start="0.612 mm", stop="0.53 mm", speed_ratio=RATIO, friction=FRICTION,
        restitution=RESTITUTION, doublings=0, keep=(), initial={"from": "contact_free"}, most_points=40,
    )  # fmt: skip
    at = next(k for k, point in enumerate(found.points) if point.event == "grazing")
    behind = [point for point in found.points[at + 1 :] if point.touches == 1]
    assert len(behind) >= 2
    assert found.is_stable[: at + 1].all()
    past = np.array([point.value for point in behind]) - found.values[at]
    assert (past > 0.0).all()  # back to where nothing had to touch
    multipliers = np.array([abs(point.multipliers[0]) for point in behind])
    assert multipliers[0] > 10.0
    assert (np.diff(multipliers) < 0.0).all()
    assert multipliers[0] * past[0] == pytest.approx(multipliers[1] * past[1], rel=0.2)

    model = assemble(rig)
    spin, clearance = RATIO * first_lateral_frequency(model), behind[0].value
    setup = prepare(
        rig, spin, contact=Contact(restitution=RESTITUTION), integrator=Integrator(accuracy=1e-12),
        samples_per_revolution=64, model=model,
    )  # fmt: skip
    motion = find_periodic_motion(
        setup, clearance=clearance, friction=FRICTION, period=1, repeat=1, recording=Recording(keep=()),
        initial=behind[0].state,
    )  # fmt: skip
    piecewise = PiecewiseMotion(setup, clearance, FRICTION, motion.state)
    whole = Rebounding(model_at(model, spin), spin, clearance - sag_at_stators(model)[0], FRICTION)
    basis, project, n, start = setup.reduced.basis, setup.reduced.project, piecewise.n, piecewise.start

    def follow(reduced):
        u, v, passed = whole.revolve(basis @ reduced[:n], basis @ reduced[n:], ())
        assert len(passed) == 2
        return np.concatenate([project @ u, project @ v])

    size = piecewise.size(start)
    assert piecewise.size(follow(start) - start) < 1e-9 * size
    mono = monodromy(piecewise, [piecewise.revolve(start, piecewise.states)])
    direction = np.random.default_rng(1).standard_normal(2 * n) * np.repeat([1 / abs(spin), 1.0], n)
    step = 1e-7 * size / piecewise.size(direction) * direction
    change = piecewise.size((follow(start + step) - follow(start - step)) / 2 - mono @ step)
    assert change < 1e-6 * piecewise.size(mono @ step)
