"""Single impacts with known answers: rotor on stator (I6), bar on wall (W1), mass on stop (I1)."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from rubhpc import State, read_rig
from rubhpc.fem.model import Body, Model, StatorModel
from rubhpc.integrate.case import run_case
from rubhpc.integrate.packing import pack
from rubhpc.integrate.prepare import CentralDifferenceSetup, prepare
from rubhpc.integrate.reduction import reduce_model
from rubhpc.rig import with_keys
from rubhpc.study import Contact, Integrator, Recording

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
    setup = prepare(
        rig,
        2 * math.pi / duration,
        contact=Contact(),
        integrator=Integrator(method=method, step=step * 1.000001),
        samples_per_revolution=per_revolution,
    )
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
    assert record.peak_contact_force[0] == pytest.approx(peak, rel=0.01)
    assert abs(record.horizontal).max() < 1e-15
    assert abs(record.torsion).max() < 1e-15


def drop(mass, stiffness, velocity, wall_mass, wall_stiffness, clearance, duration, step):
    """Record of a body, its first degree facing downwards, that moves at a velocity towards a body below."""
    n_dof = len(mass)
    body, wall = (
        Body(mass=m, damping=np.zeros_like(m), gyroscopic=np.zeros_like(m), stiffness=k, degrees=degrees)
        for m, k, degrees in (
            (mass, stiffness, tuple((node, "v") for node in range(1, n_dof + 1))),
            (np.array([[wall_mass]]), np.array([[wall_stiffness]]), ((1, "axial"),)),
        )
    )
    below = StatorModel(
        body=wall,
        node=1,
        angle=math.pi,
        radius=1.0,
        clearance_offset=0.0,
        length=1.0,
        euler_load=math.inf,
        axial=0,
        lateral=-1,
    )
    none = np.zeros(n_dof)
    model = Model(rotor=body, unbalance_cosine=none, unbalance_sine=none, stators=(below,), output_node=1)
    per_revolution = every_step(duration, step)
    setup = CentralDifferenceSetup(
        model=model,
        packed=pack(model, 0.0, step),
        spin=2 * math.pi / (per_revolution * step),  # a revolution of samples
        step=step,
        steps_per_sample=1,
        samples_per_revolution=per_revolution,
        is_updated=False,
        displacement_limit=math.inf,
    )
    return run_case(
        setup,
        clearance=clearance,
        friction=0.0,
        recording=Recording(transient=0, revolutions=1, samples_per_revolution=per_revolution),
        initial=replace(State.at_rest(model), rotor_velocity=np.full(n_dof, velocity)),
    )


def bar(n_element):
    """Lumped mass and stiffness, (n_element + 1,) squared, of the bar of W1."""
    length, modulus = 10.0 / n_element, 900.0
    mass = np.eye(n_element + 1) * length
    mass[[0, -1], [0, -1]] /= 2
    stiffness = (
        modulus
        / length
        * (2 * np.eye(n_element + 1) - np.eye(n_element + 1, k=1) - np.eye(n_element + 1, k=-1))
    )
    stiffness[[0, -1], [0, -1]] /= 2
    return mass, stiffness


def test_bar_bounces_off_a_wall():
    """W1: Doyen, Ern and Piperno, SIAM J. Sci. Comput. 33 (2011) 223-249; a wall is a mass of 1e12 kg."""
    loss = []
    for n_element in (100, 200):
        mass, stiffness = bar(n_element)
        step = 0.5 * 10.0 / n_element / 30.0  # half the time that a wave takes through an element
        record = drop(mass, stiffness, -10.0, 1e12, 0.0, 5.0, 1.5, step)
        force, end = record.contact_force[0], record.final
        touching = np.flatnonzero(force)
        assert touching[0] * step == pytest.approx(0.5, rel=0.01)
        assert (touching[-1] + 1) * step == pytest.approx(7 / 6, rel=0.01)
        assert record.contacts_per_revolution[0] == 1
        assert np.median(force[touching]) == pytest.approx(300.0, rel=2e-3)
        # momentum: all of the impulse, none of the wall's
        rebound = (mass @ end.rotor_velocity).sum() / 10.0
        assert rebound == pytest.approx(record.contact_impulse[0] / 10.0 - 10.0, rel=1e-6)
        motion = end.rotor_velocity @ mass @ end.rotor_velocity
        strain = end.rotor_displacement @ stiffness @ end.rotor_displacement
        loss.append(1 - (motion + strain) / 1000.0)
        assert record.energy_residual < 1e-6
    assert record.contact_impulse[0] == pytest.approx(200.0, rel=5e-3)
    assert loss[0] < 0.005
    assert loss[1] == pytest.approx(loss[0] / 2, rel=0.02)  # of the node that stops on the wall


def test_mass_meets_a_spring():
    """I1: 100 kg on 1e4 N/m meets a stop of 1e6 N/m, here with a tip of 0.1 g, at 1 m/s."""
    duration = 0.04
    record = drop(np.array([[100.0]]), np.array([[1e4]]), -1.0, 1e-4, 1e6, 0.0, duration, 2e-6)
    assert record.contact_duration[0] == pytest.approx(31.260e-3, rel=1e-3)
    assert record.vertical.min() == pytest.approx(-9.95037e-3, rel=1e-4)
    assert record.peak_contact_force[0] == pytest.approx(9950.37, rel=1e-4)
    assert record.contact_impulse[0] == pytest.approx(198.020, rel=1e-4)
    leaves = record.final.rotor_velocity[0] / math.cos(10.0 * (duration - 31.260e-3))  # free since then
    assert leaves == pytest.approx(1.0, rel=1e-4)
