"""A single impact of rotor on stator with a known answer (I6); others are in `test_matrix_bodies`."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import read_rig
from scipy.linalg import eigh
from set_ups import prepared

from rubhpc import State
from rubhpc.integrate.case import run_case
from rubhpc.integrate.packing import pack
from rubhpc.integrate.reduced_model.reduction import reduce_model
from rubhpc.kernels.force_average import AVERAGING_TIME
from rubhpc.rig.reading import with_keys
from rubhpc.study.study import Recording

STILL = {
    "rotor.damping.alpha": 0.0,
    "rotor.unbalance.mass": 0.0,
    "stator.damping.beta": 0.0,
}


def every_step(duration, step):
    """Number of steps in a duration, s, to be taken as the samples of one revolution."""
    return 2 * math.ceil(duration / step / 2)


def set_up_at_rest(rig, method, duration, step):
    """A shaft that does not turn: the speed only sets how long a revolution of samples lasts."""
    per_revolution = every_step(duration, step)
    setup = prepared(rig, 2 * math.pi / duration, samples=per_revolution, method=method, step=step * 1.000001)
    if method == "modal":
        return replace(setup, reduced=reduce_model(setup.model, 0.0, 1e-3))
    assert setup.steps_per_sample == 1
    return replace(setup, packed=pack(setup.model, 0.0, setup.step))


@pytest.mark.parametrize("method", ["central-difference", "modal"])
@pytest.mark.parametrize(
    ("modulus", "release", "impulse", "peak"),
    [(3e9, 4.700e-3, 0.128944, 48.8), (30e9, 1.861e-3, 0.129703, 154.0)],
)
def test_rotor_in_its_first_mode_meets_the_stator(method, modulus, release, impulse, peak):
    """I6: the disc at 0.02 m/s, 10 um off the stator; no spin, damping or friction."""
    rig = with_keys(read_rig("mokhtar2017"), STILL | {"stator.youngs_modulus": modulus})
    duration, step = 6e-3, 0.5e-6
    setup = set_up_at_rest(rig, method, duration, step)
    rotor = setup.model.rotor
    upward = [row for row, (_, name) in enumerate(rotor.degrees) if name in ("v", "thz")]
    plane = np.ix_(upward, upward)
    _, shapes = eigh(rotor.stiffness[plane], rotor.mass[plane], subset_by_index=[0, 0])
    velocity = np.zeros(rotor.n_dof)
    velocity[upward] = shapes[:, 0]
    velocity *= 0.02 / velocity[rotor.index(8, "v")]
    record = run_case(
        setup,
        clearance=10e-6,
        friction=0.0,
        recording=Recording(transient=0, revolutions=1, samples_per_revolution=setup.samples_per_revolution),
        initial=replace(State.at_rest(setup.model), rotor_velocity=velocity),
    )
    force = record.contact_force[0]
    interval = duration / force.size
    touching = np.flatnonzero(force) * interval
    assert touching[0] == pytest.approx(0.50082e-3, rel=3e-3)
    assert touching[-1] + interval == pytest.approx(release, rel=3e-3)
    assert record.contact_impulse[0] == pytest.approx(impulse, rel=3e-3)
    assert force.sum() * interval == pytest.approx(record.contact_impulse[0], rel=1e-4)
    assert force.max() == pytest.approx(peak, rel=0.01)
    passed = np.cumsum(force) * interval
    within = round(AVERAGING_TIME / interval)
    mean = (passed[within:] - passed[:-within]).max() / (within * interval)
    assert record.peak_contact_force[0] == pytest.approx(mean, rel=1e-3)
    assert abs(record.horizontal).max() < 1e-15
    assert abs(record.torsion).max() < 1e-15
