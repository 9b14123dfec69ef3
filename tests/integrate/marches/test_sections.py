"""Revolutions taken together: the same motions at their ends as one by one, and the same end of a case."""

import numpy as np
import pytest
from closed_form import read_rig
from set_ups import prepared

from rubhpc.fem.assemble import assemble
from rubhpc.fem.response import first_lateral_frequency
from rubhpc.integrate.case import MARCHES
from rubhpc.integrate.start import at_rest
from rubhpc.integrate.transient import idle_of, pass_revolutions
from rubhpc.study.study import Recording

N, CLEARANCE = 12, 84e-6
RECORDING = Recording(samples_per_revolution=64)


def march_of(contact, ratio=0.75, **limits):
    rig = read_rig("mokhtar2017")
    model = assemble(rig)
    spin = ratio * first_lateral_frequency(model)
    setup = prepared(rig, spin, model=model, **contact)  # fmt: skip
    for name, value in limits.items():
        object.__setattr__(setup, name, value)
    return MARCHES[setup.scheme](setup, CLEARANCE, 0.3, at_rest(setup, CLEARANCE), None)


@pytest.mark.parametrize("contact", [{}, {"restitution": 0.5}], ids=str)
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
