"""Impulses and energies of contacts with stators of all kinds: fast beside slow, damped hard or not at all.

Over whole periods the mean deflection and twist are those of the mean force (E1), whatever happens in
between; and what goes in comes out.
"""

import math

import pytest
from closed_form import simulate

STIFFNESS, TWIST_STIFFNESS, RADIUS = 143343.35, 3125.88, 0.06  # N/m, N m/rad at the disc (L6); m
FRICTION = 0.3
SLOW = {"clearance_ratio": 0.6}
# The stator's changes, and speed and clearance.
CASES = {
    "undamped": ({"damping.beta": 0.0}, {}),
    "as hard as a wall": ({"youngs_modulus": 1e13}, {}),
    "all but massless": ({"density": 1.0}, {}),
    "damped like putty": ({"damping.beta": 1.0}, {}),
    "slow": ({}, {"speed": 10.0} | SLOW),
    "slow, undamped": ({"damping.beta": 1e-7}, {"speed": 30.0} | SLOW),
}


@pytest.mark.parametrize("case", CASES)
def test_impulse_is_that_of_the_means_and_energy_is_kept(case):
    changes, changed = CASES[case]
    given = {"speed_ratio": 0.75, "clearance": "84 um"} if "speed" not in changed else {}
    record = simulate(
        "mokhtar2017",
        **(given | changed),
        friction=FRICTION,
        overrides={f"stator.{key}": value for key, value in changes.items()},
        transient=120,
        revolutions=12,
        keep=("waveform",),
    )
    assert record.energy_residual < 1e-4
    force = record.contact_impulse[0] * abs(record.spin_speed) / (2 * math.pi)
    assert force > 0.0
    assert record.contact_force.mean() == pytest.approx(force, rel=1e-9)
    assert record.vertical.mean() == pytest.approx(-force / STIFFNESS, rel=1e-3)
    assert record.torsion.mean() == pytest.approx(-FRICTION * RADIUS * force / TWIST_STIFFNESS, rel=1e-3)


@pytest.mark.parametrize(
    ("beta", "peaks", "durations", "impulse"),
    [(0.0, (162.9, 172.0), (2.50, 1.24), 0.62986), (2e-5, (150.68, 150.68), (5.01, 5.01), 0.62560)],
)
def test_impulse_depends_less_on_the_mesh_than_the_peak_force(beta, peaks, durations, impulse):
    """Undamped waves along a stator of 200 mm decide on the peak (docs/guide/studies.md, Contact)."""
    for elements, peak, duration in zip((3, 12), peaks, durations, strict=True):
        stator = {"node": 5, "radius": 0.01, "length": 0.2, "youngs_modulus": 3e10, "elements": elements}
        record = simulate(
            "mokhtar2017",
            overrides={f"stator.{key}": value for key, value in (stator | {"damping.beta": beta}).items()},
            speed_ratio=1.1,
            clearance="100 um",
            friction=0.1,
            transient=2,
            revolutions=2,
        )
        assert record.peak_contact_force[0] == pytest.approx(peak, rel=3e-4)
        assert 1e3 * record.contact_duration[0] == pytest.approx(duration, rel=3e-3)
        assert record.contact_impulse[0] == pytest.approx(impulse, rel=5e-5)
