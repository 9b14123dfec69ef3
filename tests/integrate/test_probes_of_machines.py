"""Probes at nodes of other machines show what the full model does: answers to forces, and motions in time."""

import math

import numpy as np
import pytest
from closed_form import simulate
from equal_stators import in_ring
from overhung_pump import SEGMENT, pump
from trial_rig import STEEL, trial_rig

from rubhpc import LumpedStator, Probe, Rig, Unbalance
from rubhpc.fem.assemble import assemble
from rubhpc.fem.probes import with_probes
from rubhpc.integrate.packing import degrees_of, whole_system
from rubhpc.integrate.reduced_model.reduction import reduce_model
from rubhpc.integrate.reduced_model.truncation import cutoff_frequency
from rubhpc.kernels.contact_pairs import AXIAL, TORSION, V, W
from rubhpc.rig.parts import Bearing, Damping, Disc, ShaftSection, Torsion
from rubhpc.rig.rotors import Rotor

SPIN = 210.0


def turbine():
    """Two wheels on three bearings, softer sideways, and two seal segments at the second wheel."""
    soft = {"kyy": 3e7, "kzz": 1.2e7, "cyy": 1500.0, "czz": 900.0}
    rotor = Rotor(
        shaft=(ShaftSection(length=1.2, outer_diameter=0.04, elements=8, **STEEL),),
        disc=tuple(Disc(node=n, diameter=0.26, thickness=0.025, density=7850.0) for n in (4, 7)),
        bearing=tuple(Bearing(node=node, **soft) for node in (1, 5, 9)),
        unbalance=(Unbalance(node=7, mass=0.02, radius=0.1),),
        torsion=Torsion(fixed_node=1),
        damping=Damping(alpha=4.0, beta=2e-5),
    )
    stators = tuple(LumpedStator(node=7, angle=angle, **SEGMENT) for angle in (0.8, -2.3))
    return Rig(name="turbine", rotor=rotor, stator=stators)


def ring():
    """Eight cantilevers around a disc between bearings."""
    return in_ring(trial_rig(), 8)


def sideways(name, node, angle, quantity="acceleration"):
    return Probe(name=name, node=node, angle=angle, quantity=quantity)


MACHINES = {
    "turbine": (
        turbine,
        (
            sideways("left", 1, -math.pi / 4),
            sideways("middle", 5, math.pi / 4),
            sideways("wheel", 4, 0.3),
            Probe(name="twist", node=9, quantity="twist_acceleration"),
            sideways("bearing", 9, 0.0, "bearing_force"),
            Probe(name="foot", stator=2, quantity="foundation_force"),
        ),
    ),
    "pump": (
        pump,
        (
            sideways("bearing", 4, math.pi / 2),
            sideways("impeller", 6, 0.0),
            Probe(name="twist", node=6, quantity="twist_acceleration"),
            sideways("force", 4, 0.0, "bearing_force"),
        ),
    ),
    "ring": (
        ring,
        (
            Probe(name="tip", stator=3, angle=0.2, quantity="acceleration"),
            Probe(name="root", stator=1, quantity="foundation_force"),
            sideways("span", 2, 0.4),
            sideways("rate", 2, 0.0, "velocity"),
            sideways("end", 5, 1.0, "displacement"),
            Probe(name="tip_rate", stator=1, angle=0.7, quantity="velocity"),
        ),
    ),
}


@pytest.mark.parametrize("name", MACHINES)
def test_answers_to_a_contact_are_those_of_the_full_model_up_to_the_cutoff(name):
    """To within 0.5 % in the mean square over the band, for the force of each contact with friction.

    That is of what the probe hears of the contact that it hears best.
    """
    make, probes = MACHINES[name]
    rig = make()
    model = with_probes(assemble(rig), rig, probes, SPIN)
    reduced = reduce_model(model, SPIN, 1e-3)
    mass, damping, stiffness, _ = whole_system(model, SPIN)
    degree = degrees_of(model)
    forces = np.zeros((len(mass), len(degree)))
    for i, stator in enumerate(model.stators):
        pushed = degree[i, [V, W, TORSION, AXIAL]]
        values = np.array([-math.cos(stator.angle), -math.sin(stator.angle), -0.3 * stator.radius, 1.0])
        forces[pushed[pushed >= 0], i] = values[pushed >= 0]
    n, full, found = len(reduced.stiffness), [], []
    for frequency in np.linspace(0.01, 1.0, 120) * cutoff_frequency(model, SPIN, 1e-3):
        factors = (1j * frequency) ** np.arange(3)
        u = np.linalg.solve(stiffness - frequency**2 * mass + 1j * frequency * damping, forces)
        own = reduced.stiffness - frequency**2 * np.eye(n) + 1j * frequency * reduced.damping
        x = np.linalg.solve(own, reduced.basis.T @ forces)
        full.append(np.einsum("k,kpn,nq->pq", factors, model.probe_rows, u, optimize=True))
        found.append(np.einsum("k,kpn,nq->pq", factors, reduced.probe, x, optimize=True))
    size = np.linalg.norm(full, axis=0)
    error = np.linalg.norm(np.array(found) - full, axis=0)
    assert (error <= 5e-3 * size.max(axis=1, keepdims=True)).all()


def heard(record, name, highest):
    """Fourier transform of a probe's record through Hann's window up to a frequency, in orders."""
    signal = record.signals[f"probe_{name}"]
    turns = signal.size / record.samples_per_revolution
    lines = np.fft.rfft((signal - signal.mean()) * np.hanning(signal.size))
    return lines[: int(highest * turns) + 1]


@pytest.mark.parametrize("name", MACHINES)
def test_motions_are_those_of_the_central_difference_up_to_the_cutoff(name):
    make, probes = MACHINES[name]
    rig = make()
    case = {
        "speed": SPIN,
        "clearance_ratio": 0.6,
        "friction": 0.2,
        "law": "penalty",
        "stiffness": 1e6,
        "transient": 0,
        "revolutions": 1,
        "samples_per_revolution": 1024,
        "probes": probes,
        "keep": ("waveform",),
        "initial": {"from": "contact_free"},
    }
    exact, stepped = simulate(rig, **case), simulate(rig, **case, method="central-difference")
    assert stepped.contact_force.max() > 0.0
    highest = cutoff_frequency(assemble(rig), SPIN, 1e-3) / SPIN
    for probe in probes:
        full = heard(stepped, probe.name, highest)
        error = np.linalg.norm(heard(exact, probe.name, highest) - full)
        assert error < 5e-3 * np.linalg.norm(full), probe.name
