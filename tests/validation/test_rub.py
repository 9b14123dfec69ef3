"""Steady rubs of the packaged rig: a known answer (G1), and identities that every rub obeys (E1 to E10)."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import read_rig, simulate
from trial_rig import turn

from rubhpc import State
from rubhpc.fem.assemble import assemble
from rubhpc.fem.response import contact_free_amplitude, steady_response
from rubhpc.rig.parts import Damping
from rubhpc.rig.reading import with_keys

LATERAL, TWIST, AXIAL = 143343.35, 3125.88, 3e9 * 25e-6 / 0.04  # N/m, N m/rad at the disc; N/m of the stator
RADIUS = 0.06
# 2 us is within 1e-5 of the paper's step, at a quarter of its work.
METHODS = {
    "central-difference": {"method": "central-difference", "step": 2e-6},
    "modal": {"method": "modal"},
}


@pytest.fixture(scope="module")
def packaged():
    return read_rig("mokhtar2017")


@pytest.fixture(scope="module")
def damped(packaged):
    """The rig of G1."""
    damping = {"rotor.damping.alpha": 39.66, "stator.damping.alpha": 39.66, "stator.damping.beta": 5e-6}
    return with_keys(packaged, damping | {"stator.density": 1156.7, "stator.poissons_ratio": 0.35})


@pytest.fixture(scope="module", params=METHODS)
def method(request):
    return METHODS[request.param]


@pytest.fixture(scope="module")
def steady(damped, method):
    """G1 in its steady state; 4096 samples a revolution, so that extrema fall between samples by little."""
    return simulate(
        damped,
        speed_ratio=0.75,
        clearance="84 um",
        friction=0.3,
        transient=24,
        revolutions=2,
        samples_per_revolution=4096,
        **method,
    )


def check_close(found, expected, share, name):
    """Everywhere within a share of the greatest value."""
    assert found == pytest.approx(expected, rel=0, abs=share * abs(expected).max()), name


def test_steady_rub_at_subcritical_speed(steady):
    assert steady.period == 1
    found = {
        "mean force": steady.contact_impulse[0] / turn(steady.spin_speed),
        "peak force": steady.peak_contact_force[0],
        "vertical": steady.peak_to_peak_vertical,
        "horizontal": steady.peak_to_peak_horizontal,
        "torsion": np.ptp(steady.torsion),
        "compression": steady.stator_axial.max(),
        "stator lateral": np.ptp(steady.stator_lateral),
    }
    expected = {
        "mean force": 1.2527,
        "peak force": 21.22,
        "vertical": 178.47e-6,
        "horizontal": 239.18e-6,
        "torsion": 259.6e-6,
        "compression": 11.320e-6,
        "stator lateral": 1263e-6,
    }
    assert found == pytest.approx(expected, rel=2e-3)
    assert steady.contact_duration[0] == pytest.approx(3.857e-3, rel=0.01)


def check_means(record, friction, lateral_stiffness):
    """E1: over whole periods inertia and damping drop out, and the mean force bends and twists as if static.

    Samples are points, so sharp pulses of the stator alias: these take 1024 and more samples a revolution.
    """
    force = record.contact_impulse[0] / turn(record.spin_speed)
    sense = np.sign(record.spin_speed)
    assert record.contact_force.mean() == pytest.approx(force, rel=1e-4)
    found = [
        getattr(record, n).mean()
        for n in ("vertical", "horizontal", "torsion", "stator_axial", "stator_lateral")
    ]
    expected = [
        -force / LATERAL,
        -sense * friction * force / LATERAL,
        -sense * friction * RADIUS * force / TWIST,
        force / AXIAL,
        sense * friction * force / lateral_stiffness,
    ]
    assert found == pytest.approx(expected, rel=1e-4)


def lateral_stiffness(poissons_ratio):
    """Of the stator's tip, N/m: bending and Cowper's shear of a square of 5 mm, 40 mm long, 3 GPa."""
    side, length, modulus = 5e-3, 0.04, 3e9
    coefficient = 10 * (1 + poissons_ratio) / (12 + 11 * poissons_ratio)
    shear = coefficient * modulus / (2 * (1 + poissons_ratio)) * side**2
    return 1 / (length**3 / (3 * modulus * side**4 / 12) + length / shear)


def test_means_balance_the_mean_force(steady):
    check_means(steady, 0.3, lateral_stiffness(0.35))


@pytest.fixture(scope="module")
def two_lobes(packaged, method):
    """A period-2 orbit with reversed spin; at this gap disturbances die away within 30 revolutions."""
    return simulate(
        packaged,
        speed=-148.7,
        clearance="106 um",
        friction=0.4,
        transient=30,
        revolutions=2,
        samples_per_revolution=1024,
        **method,
    )


def test_means_balance_the_mean_force_of_two_revolutions(two_lobes):
    half = two_lobes.contact_force.reshape(2, -1).mean(axis=1)
    assert abs(half[0] / half[1] - 1) > 0.05  # its two revolutions do differ
    check_means(two_lobes, 0.4, lateral_stiffness(0.3))


THREE = (0.0, 0.25, -0.3)  # rad


@pytest.mark.parametrize("normal", ["fixed", "updated"])
@pytest.mark.parametrize("angles", [THREE[:1], THREE])
def test_no_step_penetrates_or_pulls(packaged, normal, angles):
    """E4, at every step: one sample a step, whose force acts until the next."""
    rig = replace(packaged, stator=tuple(replace(packaged.stator[0], angle=angle) for angle in angles))
    clearance = 60e-6
    record = simulate(
        rig,
        speed=148.7,
        clearance=clearance,
        friction=0.1,
        normal=normal,
        transient=0,
        revolutions=2,
        samples_per_revolution=21_200,
        keep=("waveform",),
        **METHODS["central-difference"],
    )
    assert record.steps == 2 * 21_200
    axis = np.exp(1j * np.array(angles))[:, np.newaxis]
    tip = (RADIUS + clearance + record.stator_axial + 1j * record.stator_lateral) * axis
    line = tip - (record.vertical + 1j * record.horizontal)
    distance = abs(line) if normal == "updated" else (line * axis.conj()).real
    gap, force = distance[:, 1:] - RADIUS, record.contact_force[:, :-1]
    assert gap.min() >= -1e-12
    assert force.min() >= 0.0
    assert abs(gap[force > 0]).max() <= 1e-12
    assert (record.contacts_per_revolution > 0).all()
    if len(angles) > 1:
        assert ((force > 0).sum(axis=0) > 1).any()


@pytest.fixture(scope="module")
def run(packaged, method):
    """Three revolutions from rest, in hard contact."""

    def runs(rig=packaged, **changed):
        given = {"speed": 148.7, "clearance": 60e-6, "friction": 0.3, "transient": 0, "revolutions": 3}
        return simulate(rig, **(given | method | changed))

    return runs


def test_friction_acts_on_what_is_driven_by_it_alone(run):
    """E5, sliding over a fixed normal: what friction does not drive ignores it, the rest is its multiple.

    To 1e-3: the gyroscopic moments of the bent shaft carry 1.4e-4 of the horizontal motion over.
    """
    none, low, high = (run(friction=friction) for friction in (0.0, 0.1, 0.5))
    assert low.contact_force.max() > 10.0
    shift, more = ({"horizontal": record.horizontal - none.horizontal} for record in (low, high))
    for name in ("torsion", "stator_lateral"):
        shift[name], more[name] = getattr(low, name), getattr(high, name)
    for name in ("vertical", "contact_force", "stator_axial"):
        check_close(getattr(high, name), getattr(low, name), 1e-3, name)
    for name, value in shift.items():
        assert abs(value).max() > 0
        check_close(more[name], 5 * value, 1e-3, name)


def test_everything_scales_with_unbalance_and_gap(run, packaged):
    """E7."""
    factor = 1.7
    grown = run(
        with_keys(packaged, {"rotor.unbalance.mass": 0.008 * factor}), clearance=60e-6 * factor, friction=0.3
    )
    once = run()
    for name in once.signals:
        check_close(getattr(grown, name), factor * getattr(once, name), 1e-9, name)
    assert grown.contact_duration == once.contact_duration
    assert grown.friction_work == pytest.approx(factor * once.friction_work, rel=0.05)  # slip hardly grows


@pytest.mark.parametrize("normal", ["fixed", "updated"])
def test_reversed_spin_mirrors_the_motion(run, normal):
    """E8, with the unbalance on the mirror's axis at the start."""
    forward, backward = run(normal=normal), run(normal=normal, speed=-148.7)
    for name in ("vertical", "stator_axial", "contact_force"):
        check_close(getattr(backward, name), getattr(forward, name), 1e-8, name)
    for name in ("horizontal", "torsion", "torsion_acceleration", "stator_lateral"):
        check_close(getattr(backward, name), -getattr(forward, name), 1e-8, name)
    assert backward.minimum_slip_speed == pytest.approx(forward.minimum_slip_speed)
    assert backward.friction_work == pytest.approx(forward.friction_work)


@pytest.mark.parametrize("normal", ["fixed", "updated"])
def test_rub_is_the_same_at_every_angle_around_the_rim(run, packaged, normal):
    """Coulomb's law at every whirl angle: isotropic rotors turn with their stator and unbalance."""
    given = {"normal": normal, "accuracy": 1e-9}  # modes kept at the default one differ by angle
    upright = run(**given)
    orbit = upright.vertical + 1j * upright.horizontal
    for angle in np.linspace(0, 2 * math.pi, 8)[1:]:
        turned = with_keys(packaged, {"stator.angle": angle, "rotor.unbalance.phase": angle})
        record = run(turned, **given)
        found = record.vertical + 1j * record.horizontal
        check_close(found, orbit * np.exp(1j * angle), 1e-7, angle)
        for name in ("torsion", "stator_axial", "stator_lateral", "contact_force"):
            check_close(getattr(record, name), getattr(upright, name), 1e-6, (name, angle))


@pytest.mark.parametrize(  # of L11: speed ratio, ratio of critical, amplitude (um)
    ("speed_ratio", "ratio", "amplitude"), [(0.75, 0.05, 125.043), (1.5, 0.10, 172.246), (3.0, 0.05, 109.369)]
)
def test_stator_out_of_reach_is_not_felt(packaged, method, speed_ratio, ratio, amplitude):
    """E9: on the steady orbit with the stator just out of reach, nothing happens; just within, it touches."""
    damping = Damping(alpha=2 * ratio * 2 * math.pi * 31.56)
    rig = replace(packaged, rotor=replace(packaged.rotor, damping=damping))
    model = assemble(rig)
    speed = speed_ratio * 2 * math.pi * 31.5596
    response = steady_response(model, speed)
    start = replace(
        State.at_rest(model),
        rotor_displacement=response.real,
        rotor_velocity=(1j * speed * response).real,
    )
    free, touched = (
        simulate(
            rig,
            speed=speed,
            clearance=share * contact_free_amplitude(model, speed),
            transient=0,
            revolutions=2,
            initial=start,
            **method,
        )
        for share in (1.0005, 0.9995)
    )
    assert np.hypot(free.vertical, free.horizontal).max() == pytest.approx(amplitude * 1e-6, rel=5e-4)
    assert free.peak_to_peak_vertical == pytest.approx(2 * amplitude * 1e-6, rel=5e-4)
    for quiet in ("peak_contact_force", "contact_impulse", "contact_fraction", "friction_work"):
        assert getattr(free, quiet)[0] == 0.0
    assert np.isnan(free.minimum_slip_speed[0])
    assert abs(free.torsion).max() < 1e-20
    assert touched.contact_impulse[0] > 0.0
