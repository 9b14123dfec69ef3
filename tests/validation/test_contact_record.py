"""What a record states of its contact problems: iterations, residual, and the end where none is solved."""

from dataclasses import replace

import numpy as np
import pytest
from closed_form import simulate
from trial_rig import trial_rig

from rubhpc import LumpedStator, Rig, State, assemble
from rubhpc.integrate.marches.collocation import WHY
from rubhpc.integrate.marches.march import NO_FORCES, ended_in
from rubhpc.kernels.collocation.structures import JAMMED

LAWS = [
    {},
    {"normal": "updated"},
    {"law": "penalty", "stiffness": 1e8, "damping": 20.0},
    {"restitution": 0.5},
    {"friction_law": "coulomb"},
    {"friction_law": "coulomb", "normal": "updated", "static_friction_ratio": 1.5},
]
CASE = {"speed": 300.0, "clearance": 5e-5, "friction": 0.05, "transient": 0, "revolutions": 2}


@pytest.mark.parametrize("method", ["modal", "central-difference"])
@pytest.mark.parametrize("law", LAWS, ids=lambda law: "-".join(map(str, law.values())) or "plain")
def test_every_law_shows_iterations_and_residual(method, law):
    step = {"step": "1 us"} if method == "central-difference" or "law" in law or "normal" in law else {}
    record = simulate(trial_rig(3), **CASE, **law, **step, method=method)
    assert record.status == 1
    assert record.contact_impulse.any()
    assert record.contact_iterations > 0
    assert 0.0 <= record.contact_residual < 1e-6


@pytest.mark.parametrize("method", ["modal", "central-difference"])
def test_no_contact_takes_no_iterations(method):
    record = simulate(trial_rig(1), **CASE | {"clearance": 0.01}, method=method)
    assert record.contact_iterations == 0
    assert record.contact_residual == 0.0


@pytest.mark.parametrize("method", ["modal", "central-difference"])
def test_painleves_paradox_ends_the_case_with_its_reason(method):
    """Sideways inertia coupled to the normal one: with enough friction a force closes the gap that it opens.

    The wall gives by (1 - 0.9 mu) / 0.19 per kg, less than nothing for mu = 2: no force holds the gap, and
    the case must not go on as if one did.
    """
    wall = LumpedStator(node=1, rigid=True, radius=0.1)
    rig = Rig.from_matrices(
        [[1.0, 0.9], [0.9, 1.0]], None, 100.0 * np.eye(2), degrees=[(1, "v"), (1, "w")], stators=wall
    )
    start = replace(State.at_rest(assemble(rig)), rotor_velocity=np.array([0.1, 0.0]))
    case = {"speed": 50.0, "clearance": 1e-3, "transient": 0, "revolutions": 2, "initial": start}
    slides = simulate(rig, **case, friction=0.5, method=method)
    assert slides.status == 1
    assert slides.contact_impulse[0] > 0.0
    jammed = simulate(rig, **case, friction=2.0, method=method)
    assert jammed.status == 3
    why = WHY[JAMMED] if method == "modal" else NO_FORCES
    assert jammed.reason == ended_in(why, 1)
    assert jammed.contact_iterations == -1
    assert np.isnan(jammed.contact_residual)
