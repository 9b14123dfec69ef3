"""Forces at multiples of the spin speed: against the receptance without contact, two schemes with contact."""

import math
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

import rubhpc
from rubhpc import Harmonic, InputError, read_rig, simulate
from rubhpc.fem.assemble import assemble
from rubhpc.fem.response import contact_free_amplitude, contact_free_reach

SPIN, TURNS = 297.44, 4
FORCES = (
    Harmonic(node=3, order=2, force=60.0, phase=0.7),
    Harmonic(node=12, order=3, force=20.0, phase=-0.4),
)
APART = {"clearance": 5e-3, "friction": 0.1}
RUB = {"clearance": 1.4e-4, "friction": 0.2, "model": "mokhtar2017", "speed": SPIN}


def with_harmonics():
    rig = read_rig("mokhtar2017")
    return replace(rig, rotor=replace(rig.rotor, harmonic=FORCES))


def receptance(model, force, spin, row):
    """Displacement of a degree, complex, by the matrices and a force as cosine and sine of its angle."""
    body, rate = model.rotor, force.order * spin
    dynamic = body.stiffness - rate**2 * body.mass + 1j * rate * (body.damping + spin * body.gyroscopic)
    load = np.zeros(body.n_dof, complex)
    load[body.index(force.node, "v")] = force.force * np.exp(1j * force.phase)
    load[body.index(force.node, "w")] = force.force * np.exp(1j * (force.phase - math.pi / 2))
    return np.linalg.solve(dynamic, load)[row]


@pytest.mark.parametrize("spin", [SPIN, -SPIN])
@pytest.mark.parametrize(
    "scheme", [{"accuracy": 1e-5}, {"method": "central-difference", "model": "mokhtar2017"}]
)
def test_without_contact_amplitude_and_phase_are_those_of_the_receptance(scheme, spin):
    rig = with_harmonics()
    model = assemble(rig)
    start = {"transient": 0, "initial": {"from": "contact_free"}, "revolutions": TURNS}
    found = simulate(rig, speed=spin, **APART, **start, **scheme)
    for name, degree in (("vertical", "v"), ("horizontal", "w")):
        wave, row = getattr(found, name), model.rotor.index(8, degree)
        angle = math.copysign(2 * math.pi * TURNS / wave.size, spin) * np.arange(wave.size)
        for force in FORCES:
            line = 2 * np.mean(wave * np.exp(-1j * force.order * angle))
            assert line == pytest.approx(receptance(model, force, spin, row), rel=1e-6)


def test_a_rub_is_that_of_the_central_difference():
    rig, long = with_harmonics(), {"transient": 5, "revolutions": 3}
    known = simulate(rig, method="central-difference", **RUB, **long)
    found = simulate(rig, accuracy=1e-5, **RUB, **long)
    assert known.contact_fraction[0] > 0.1
    for name in ("vertical", "horizontal", "torsion"):
        values = getattr(known, name)
        assert getattr(found, name) == pytest.approx(values, rel=0, abs=2e-6 * np.ptp(values))
    alone = simulate("mokhtar2017", accuracy=1e-5, **RUB, **long)
    assert np.ptp(found.vertical - alone.vertical) > 0.1 * np.ptp(known.vertical)
    assert abs(found.energy_residual) < 1e-5


def test_a_motion_found_directly_is_the_one_that_settles():
    rig = with_harmonics()
    direct, marched = (
        simulate(rig, transient=transient, revolutions=TURNS, **RUB) for transient in ("direct", 200)
    )
    assert direct.vertical == pytest.approx(marched.vertical, rel=0, abs=1e-3 * np.ptp(marched.vertical))


def test_the_contact_free_orbit_has_all_orders():
    rig = with_harmonics()
    found = simulate(rig, speed=SPIN, transient=0, revolutions=1, initial={"from": "contact_free"}, **APART)
    most = np.hypot(found.vertical, found.horizontal).max()
    model = assemble(rig)
    assert contact_free_amplitude(model, SPIN) == pytest.approx(most, rel=1e-4)
    assert contact_free_amplitude(model, SPIN) > 1.1 * contact_free_amplitude(
        assemble(read_rig("mokhtar2017")), SPIN
    )
    angle = rig.stator[0].angle
    towards = found.vertical * math.cos(angle) + found.horizontal * math.sin(angle)
    assert contact_free_reach(model, SPIN) == pytest.approx(towards.max(), rel=1e-4)


def test_harmonics_of_a_file_are_keys_of_a_study(tmp_path):
    own = (files("rubhpc") / "rigs" / "mokhtar2017.toml").read_text()
    table = '[[rotor.harmonic]]\nnode = 1\norder = 2\nforce = "60 N"\nphase = "90 deg"\n'
    rig, study = tmp_path / "rig.toml", tmp_path / "study.toml"
    rig.write_text(own + table)
    assert read_rig(rig).rotor.harmonic == (Harmonic(node=1, order=2, force=60.0, phase=math.pi / 2),)
    grid = 'rig = "rig.toml"\n[grid]\nclearance = 1e-4\nfriction = 0.2\n'
    study.write_text(grid + 'speed = 300.0\n"rotor.harmonic.force" = [0.0, "50 N"]\n')
    assert rubhpc.read_study(study).axes[-1].values == (0.0, 50.0)
    study.write_text(grid + "[run_up]\nstart = 100.0\nstop = 200.0\ntime = 1.0\n")
    with pytest.raises(InputError, match=r"\[\[rotor.harmonic\]\]: the speed changes"):
        rubhpc.read_study(study)


def test_a_speed_that_changes_is_refused():
    with pytest.raises(InputError, match=r"\[\[rotor.harmonic\]\]: the speed changes"):
        rubhpc.run_up(with_harmonics(), start=100.0, stop=110.0, time=0.1, clearance=1e-3)
