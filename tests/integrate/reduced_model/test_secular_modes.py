"""Eigenmodes by zeros of a secular function: those of the whole system."""

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import Contact as Law
from overhung_pump import SEGMENT, pump

from rubhpc import LumpedStator
from rubhpc.integrate.reduced_model import contact_mode, secular_modes
from rubhpc.integrate.reduced_model.secular_modes import Closings, Contact, Eigenmodes, Within, with_contact
from rubhpc.integrate.reduced_model.system_modes import modes_of
from rubhpc.integrate.setup import prepare
from rubhpc.study.study import Integrator

N = 40


def system_of(stiffness, damping):
    n = len(stiffness)
    return np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])


def rotor_and_stator(*, seed=0, n=N, gyroscopic=0.0, overdamped=False):
    """Modes of a rotor, the last of a light stator, and the row of a gap between them."""
    rng = np.random.default_rng(seed)
    natural = 200.0 * np.arange(1, n + 1) ** 1.5
    ratio = np.full(n, 0.01)
    if overdamped:
        ratio[-1] = 1.7
    stiffness, damping = np.diag(natural**2), np.diag(2.0 * ratio * natural)
    skew = rng.normal(size=(n - 1, n - 1))
    damping[:-1, :-1] += gyroscopic * (skew - skew.T)
    row, across = 0.3 * rng.normal(size=(2, n))  # mass normalised: 3 kg, and a stator of 20 g
    row[-1] = -7.0
    return stiffness, damping, row, across


def opened(stiffness, damping):
    exponent, shape, inverse = modes_of(system_of(stiffness, damping))
    return Eigenmodes(exponent, shape[: len(stiffness)], inverse)


def moved(modes, start, time):
    """Where a motion goes, displacements and velocities."""
    shape = np.vstack([modes.shape, modes.shape * modes.exponent])
    return (shape @ (np.exp(modes.exponent * time) * (modes.inverse @ start))).real


KINDS = {
    "plain": {},
    "gyroscopic": {"gyroscopic": 5.0},
    "overdamped": {"overdamped": True},
}


@pytest.mark.parametrize("seed", [0, 1, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_motions_are_those_of_the_whole(kind, seed):
    stiffness, damping, row, across = rotor_and_stator(seed=seed, **KINDS[kind])
    force = row + 0.3 * across
    found = with_contact(opened(stiffness, damping), Contact(row, force))
    assert found is not None
    reduced = type("Reduced", (), {"stiffness": stiffness, "damping": damping})()
    basis, _, system = contact_mode.confine(reduced, row[None], force[:, None])
    exponent, shape, inverse = modes_of(system)
    expected = Eigenmodes(exponent, basis @ shape[: basis.shape[1]], inverse)
    assert np.sort_complex(found.exponent) == pytest.approx(np.sort_complex(exponent), rel=1e-10)
    state = np.kron(np.eye(2), basis)
    rng = np.random.default_rng(seed)
    start = np.concatenate([rng.normal(size=basis.shape[1]) / 200.0, rng.normal(size=basis.shape[1])])
    for time in (0.0, 1e-4, 2e-3):
        known = moved(expected, start, time)
        for half in (slice(N), slice(N, None)):
            error = abs(moved(found, state @ start, time)[half] - known[half]).max()
            assert error < 1e-8 * abs(known[half]).max()


def test_contacts_follow_one_another_in_any_order():
    stiffness, damping, row, across = rotor_and_stator(gyroscopic=5.0)
    contacts = [Contact(gap, gap + 0.3 * across) for gap in (row, np.roll(row, 2))]
    modes = opened(stiffness, damping)
    bodies = Closings(modes, np.zeros(N, dtype=int)).within(np.arange(N))
    one, other = bodies.with_contacts(contacts), bodies.with_contacts(contacts[::-1])
    assert np.sort_complex(one.exponent) == pytest.approx(np.sort_complex(other.exponent), rel=1e-10)
    assert abs(row @ one.shape).max() < 1e-12 * abs(one.shape).max()


def test_the_force_leaves_held_modes_alone():
    stiffness, damping, row, across = rotor_and_stator()
    force = row + 0.3 * across
    found = with_contact(opened(stiffness, damping), Contact(row, force))
    assert abs(found.inverse[:, N:] @ force).max() < 1e-9 * abs(found.inverse[:, N:] * force).max()


def test_modes_that_a_contact_does_not_see_stay():
    stiffness, damping, row, across = rotor_and_stator()
    row[5] = row[8] = across[8] = 0.0  # the fifth is moved by friction alone
    found = with_contact(opened(stiffness, damping), Contact(row, row + 0.3 * across))
    known = modes_of(system_of(stiffness, damping))[0]
    for at in (5, 8):
        natural = known[abs(known.imag - math.sqrt(stiffness[at, at] * (1.0 - 1e-4))).argmin()]
        assert natural in found.exponent


def test_coupled_exponents_that_coincide_are_left_to_the_whole():
    _, _, row, across = rotor_and_stator(n=6)
    found = Eigenmodes(
        np.full(6, -1.0 + 50.0j), np.eye(6, dtype=complex), np.hstack([np.eye(6), np.eye(6)]).astype(complex)
    )
    assert with_contact(found, Contact(row, row + 0.3 * across)) is None


def test_zeros_that_meet_are_left_to_the_whole(monkeypatch):
    stiffness, damping, row, _ = rotor_and_stator()
    start = secular_modes._Poles._start
    monkeypatch.setattr(secular_modes._Poles, "_start", lambda *args: np.repeat(start(*args)[::2], 2))
    assert with_contact(opened(stiffness, damping), Contact(row, row)) is None


def test_contact_modes_of_a_ring_are_those_of_the_whole(monkeypatch):
    tips = [LumpedStator(node=6, angle=0.2 + i * math.pi / 4.0, **SEGMENT) for i in range(8)]
    rig, masks = replace(pump(), stator=tuple(tips)), [0b1, 0b110]
    found, ways = [], []
    known = Within.with_contacts
    monkeypatch.setattr(
        Within,
        "with_contacts",
        lambda bodies, contacts: ways.append(known(bodies, contacts)) or ways[-1],
    )
    for fewest in (1, 1000):
        monkeypatch.setattr(contact_mode, "FEWEST", fewest)
        setup = prepare(rig, 320.0, contact=Law(), integrator=Integrator(), samples_per_revolution=256)
        library = setup.library(0.2)
        found.append([library._solved(mask) for mask in masks])
    assert len(ways) == len(masks)
    assert None not in ways
    rng = np.random.default_rng(1)
    for own, whole in zip(*found, strict=True):
        assert np.sort_complex(own.exponent) == pytest.approx(
            np.sort_complex(whole.exponent), rel=1e-9, abs=1e-9
        )
        start, m = rng.normal(size=whole.motion.shape[0]), whole.n_eigenmode
        seen = []
        for mode in (own, whole):
            moving = np.exp(mode.exponent[:m] * 1e-3) * (mode.enter[:m] @ start)
            taken = np.exp(mode.exponent[:m] * 1e-3) * mode.take_off[:, :m]
            seen += [
                [
                    (mode.motion[:, :m] @ moving).real,
                    (mode.switch[:, :m] @ moving).real,
                    (mode.motion[:, :m] @ taken.T).real,
                    mode.motion[:, m:],
                    mode.switch[:, m:],
                ]
            ]
        for mine, theirs in zip(*seen, strict=True):
            assert abs(mine - theirs).max() < 1e-7 * abs(theirs).max()
