"""What probes record: the full model's answer, balances of forces, and the same by every scheme."""

import math

import numpy as np
import pytest
from closed_form import simulate
from trial_rig import trial_rig

from rubhpc import Probe
from rubhpc.fem.assemble import assemble
from rubhpc.fem.probes import with_probes
from rubhpc.fem.response import steady_response

SPIN = 210.0
ACCELERATIONS = (
    Probe(name="bearing", node=1, angle=-math.pi / 4, quantity="acceleration"),
    Probe(name="span", node=2, angle=0.4, quantity="acceleration"),
    Probe(name="end", node=5, quantity="twist_acceleration"),
    Probe(name="force", node=5, quantity="bearing_force"),
    Probe(name="root", stator=1, quantity="foundation_force"),
)
SHORT = {"speed": SPIN, "clearance": "60 um", "revolutions": 2, "samples_per_revolution": 64}


def test_steady_motion_without_contact_is_the_unbalance_response():
    rig = trial_rig()
    probes = (*ACCELERATIONS[:2], ACCELERATIONS[3], Probe(name="rate", node=4, quantity="velocity"))
    record = simulate(
        rig,
        speed=SPIN,
        clearance="5 mm",
        transient=0,
        revolutions=2,
        probes=probes,
        initial={"from": "contact_free"},
    )
    model = with_probes(assemble(rig), rig, probes, SPIN)
    response = np.zeros(model.body_start[-1], dtype=complex)
    response[: model.rotor.n_dof] = steady_response(model, SPIN)
    expected = np.abs((1j * SPIN) ** np.arange(3) @ (model.probe_rows @ response))
    for probe, amplitude in zip(probes, expected, strict=True):
        assert record.spectra[f"spectrum_probe_{probe.name}"][2] == pytest.approx(amplitude, rel=2e-4)
        assert record.measures[f"peak_to_peak_probe_{probe.name}"] == pytest.approx(2 * amplitude, rel=1e-3)


def test_bearings_and_foundation_bear_the_mean_contact_force():
    """Over whole periods momentum does not change, so that the means of all forces balance."""
    probes = [
        Probe(name="root", stator=1, quantity="foundation_force"),
        *(
            Probe(name=f"{name}_{node}", node=node, angle=angle, quantity="bearing_force")
            for node in (1, 15)
            for name, angle in (("up", 0.0), ("aside", math.pi / 2))
        ),
    ]
    record = simulate(
        "mokhtar2017",
        speed_ratio=0.75,
        clearance="100 um",
        transient=60,
        revolutions=8,
        samples_per_revolution=512,
        probes=probes,
    )
    mean = {name: float(np.mean(signal)) for name, signal in record.signals.items()}
    force = mean["contact_force"]
    assert force > 0.1
    assert mean["probe_root"] == pytest.approx(force, rel=5e-3)
    assert mean["probe_up_1"] + mean["probe_up_15"] == pytest.approx(-force, rel=5e-3)
    assert mean["probe_aside_1"] + mean["probe_aside_15"] == pytest.approx(-0.3 * force, rel=5e-3)


@pytest.mark.parametrize(
    "scheme", [{}, {"friction_law": "coulomb"}, {"normal": "updated"}, {"method": "central-difference"}]
)
def test_a_probe_where_a_signal_is_recorded_records_that_signal(scheme):
    rig = trial_rig()
    twin = {
        "vertical": Probe(name="a", node=3),
        "horizontal": Probe(name="b", node=3, angle=math.pi / 2),
        "torsion": Probe(name="c", node=3, quantity="twist"),
        "torsion_acceleration": Probe(name="d", node=3, quantity="twist_acceleration"),
    }
    record = simulate(rig, **SHORT, transient=3, probes=list(twin.values()), **scheme)
    assert record.contact_force.max() > 0.0
    for name, probe in twin.items():
        signal = record.signals[name]
        assert record.signals[f"probe_{probe.name}"] == pytest.approx(signal, abs=1e-9 * np.abs(signal).max())


def test_probes_may_be_given_by_their_keys_and_leave_the_rest_alone():
    keys = {"name": "left", "node": 3, "angle": "-45 deg", "quantity": "velocity"}
    record = simulate(trial_rig(), **SHORT, transient=0, probes=[keys])
    assert record.to_dataset()["probe_left"].attrs["units"] == "m s-1"
    assert record.to_dataset()["spectrum_probe_left"].dims == ("order",)
    plain = simulate(trial_rig(), **SHORT, transient=0)
    assert plain.vertical == pytest.approx(record.vertical, abs=1e-5 * np.abs(plain.vertical).max())
