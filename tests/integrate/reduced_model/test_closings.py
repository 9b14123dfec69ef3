"""Eigenmodes with contacts closed one after another."""

import numpy as np
import pytest

from rubhpc.integrate.reduced_model import secular_modes as module
from rubhpc.integrate.reduced_model.secular_modes import Closings, Contact, Eigenmodes, with_contact
from rubhpc.integrate.reduced_model.system_modes import modes_of

N_ROTOR, Q = 12, 4
N = N_ROTOR + Q


@pytest.fixture
def bodies():
    """A rotor and stators of one degree of freedom each, with the contacts between them."""
    rng = np.random.default_rng(5)
    natural = np.concatenate([150.0 * np.arange(1, N_ROTOR + 1) ** 1.5, np.linspace(9e3, 1.1e4, Q)])
    stiffness, damping = np.diag(natural**2), np.diag(0.02 * natural)
    skew = rng.normal(size=(N_ROTOR, N_ROTOR))
    damping[:N_ROTOR, :N_ROTOR] += skew - skew.T
    system = np.block([[np.zeros((N, N)), np.eye(N)], [-stiffness, -damping]])
    exponent, shape, inverse = modes_of(system)
    contacts = []
    for i in range(Q):
        row, across = np.zeros((2, N))
        row[:N_ROTOR], across[:N_ROTOR] = 0.3 * rng.normal(size=(2, N_ROTOR))
        row[N_ROTOR + i] = -7.0
        contacts.append(Contact(row, row + 0.1 * across))
    part = np.concatenate([np.zeros(N_ROTOR, dtype=int), 1 + np.arange(Q)])
    return Closings(Eigenmodes(exponent, shape[:N], inverse), part), contacts


def closed(closings, contacts, pairs):
    """Eigenmodes of the rotor and the stators of these pairs, and their coordinates."""
    rows = np.concatenate([np.arange(N_ROTOR), N_ROTOR + np.array(pairs)])
    own = [Contact(contacts[i].row[rows], contacts[i].force[rows]) for i in pairs]
    return closings.within(rows).with_contacts(own), rows


def test_they_are_those_of_all_bodies(bodies):
    closings, contacts = bodies
    found, rows = closed(closings, contacts, [1, 3])
    whole = closings._opened
    for i in (1, 3):
        whole = with_contact(whole, contacts[i])
    start = np.random.default_rng(2).normal(size=2 * rows.size)
    wide = np.zeros(2 * N)
    wide[np.concatenate([rows, N + rows])] = start
    for time in (0.0, 1e-4, 1e-3):
        mine = (found.shape @ (np.exp(found.exponent * time) * (found.inverse @ start))).real
        known = (whole.shape @ (np.exp(whole.exponent * time) * (whole.inverse @ wide))).real
        assert mine == pytest.approx(known[rows], abs=1e-10 * abs(known).max())


def test_sets_that_begin_alike_share_what_they_have_in_common(bodies, monkeypatch):
    closings, contacts = bodies
    solved = []
    monkeypatch.setattr(module, "with_contact", lambda *of: solved.append(of) or with_contact(*of))
    counts = []
    for pairs in ([0, 1], [0, 1, 2], [0, 1, 2, 3], [0, 1, 3], [0, 1, 2], [1, 2]):
        assert closed(closings, contacts, pairs)[0] is not None
        counts.append(len(solved))
    assert counts == [2, 3, 4, 5, 5, 7]


def test_what_was_kept_makes_no_difference(bodies, monkeypatch):
    closings, contacts = bodies
    closed(closings, contacts, [0, 1])
    kept, _ = closed(closings, contacts, [0, 1, 2])
    monkeypatch.setattr(module, "MOST", 1)
    anew = Closings(closings._opened, closings.part)
    for mine, theirs in zip(closed(anew, contacts, [0, 1, 2])[0], kept, strict=True):
        assert np.array_equal(mine, theirs)
