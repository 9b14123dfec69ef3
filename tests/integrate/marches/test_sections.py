"""Revolutions taken together: the same motions at their ends as one by one, and the same end of a case."""

import numpy as np
import pytest
from closed_form import Contact, read_rig

from rubhpc.fem.assemble import assemble
from rubhpc.fem.response import first_lateral_frequency
from rubhpc.integrate.marches.closed_form import closed_form_march
from rubhpc.integrate.marches.friction import FrictionMarch
from rubhpc.integrate.setup import prepare
from rubhpc.integrate.start import at_rest
from rubhpc.integrate.transient import idle_of, pass_revolutions
from rubhpc.kernels.case_progress import CONTACT_UNSOLVED
from rubhpc.study.study import Integrator, Recording

N, CLEARANCE = 12, 84e-6
RECORDING = Recording(samples_per_revolution=64)


def march_of(contact, ratio=0.75, **limits):
    rig = read_rig("mokhtar2017")
    model = assemble(rig)
    spin = ratio * first_lateral_frequency(model)
    setup = prepare(
        rig, spin, contact=Contact(**contact), integrator=Integrator(), samples_per_revolution=64,
        model=model,
    )  # fmt: skip
    for name, value in limits.items():
        object.__setattr__(setup, name, value)
    return closed_form_march(setup)(setup, CLEARANCE, 0.3, at_rest(setup, CLEARANCE), None)


@pytest.mark.parametrize(
    "contact", [{}, {"law": "penalty", "stiffness": 1e7}, {"friction_law": "coulomb"}], ids=str
)
def test_sections_are_those_of_single_revolutions(contact):
    together, singly = march_of(contact), march_of(contact)
    idle = idle_of(singly)
    expected = []
    for _ in range(N):
        assert pass_revolutions(singly, RECORDING, 1, idle) is None
        expected.append(singly.motion())
    sections, reason = together.pass_sections(N, *idle)
    assert reason is None
    scale = np.abs(expected).max(axis=0)
    assert (np.abs(sections - expected) / scale).max() < 1e-9
    assert together.mask == singly.mask
    assert together.n_step == singly.n_step
    assert (np.abs(together.motion() - sections[-1]) / scale).max() < 1e-14


def test_case_that_diverges_ends_in_the_same_revolution():
    """Beyond an energy that a resonance leads to after some revolutions."""
    free = march_of({}, 0.98)
    idle = idle_of(free)
    energies = []
    for _ in range(N):
        pass_revolutions(free, RECORDING, 1, idle)
        energies.append(free.energy())
    n = int(np.argmax(energies))
    assert n >= 2
    limit = 0.5 * (energies[n] + max(energies[:n]))
    together, singly = (march_of({}, 0.98, energy_limit=limit) for _ in range(2))
    for _ in range(n):
        assert pass_revolutions(singly, RECORDING, 1, idle) is None
    expected = pass_revolutions(singly, RECORDING, 1, idle)
    assert expected is not None
    _, reason = together.pass_sections(N, *idle)
    assert reason == expected
    assert together.sample == (n + 1 - N) * RECORDING.samples_per_revolution


def test_revolution_by_collocation_stands_among_the_others(monkeypatch):
    """A case that leaves closed form for a revolution in the first one goes on to the same number of them."""
    exact, left = march_of({"friction_law": "coulomb"}), march_of({"friction_law": "coulomb"})
    idle = idle_of(exact)
    expected, _ = exact.pass_sections(N, *idle)
    follow, n_call = FrictionMarch._by_kernel, []

    def unsolved_at_first(march, *args, **kwargs):
        n_call.append(kwargs.keys())
        return CONTACT_UNSOLVED if len(n_call) == 1 else follow(march, *args, **kwargs)

    monkeypatch.setattr(FrictionMarch, "_by_kernel", unsolved_at_first)
    sections, reason = left.pass_sections(N, *idle)
    assert (reason, left.n_left, left.sample) == (None, 1, 0)
    assert n_call[0] == {"sections"}
    n = expected.shape[1] // 2
    apart = np.linalg.norm((sections - expected)[:, :n], axis=1) / np.linalg.norm(expected[:, :n], axis=1)
    assert 0.0 < apart.max() < 1e-3
