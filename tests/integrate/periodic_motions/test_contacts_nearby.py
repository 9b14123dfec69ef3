"""Contacts of cases near a periodic motion, predicted by the linear theory."""

from itertools import pairwise

import numpy as np
import pytest
from closed_form import simulate

from rubhpc.integrate.periodic_motions import direct
from rubhpc.integrate.periodic_motions.approach import Approach
from rubhpc.integrate.periodic_motions.contacts_nearby import PER_REVOLUTION, ContactsNearby


@pytest.fixture(scope="module")
def settled():
    """A lightly damped case: piecewise motion, periodic motion, and how far from that it is at first."""
    found = []
    draws_near = direct.draws_near

    def note(case, candidate, until):
        found.append((candidate.piecewise, candidate.solved.orbit))
        return draws_near(case, candidate, until)

    case = {
        "speed_ratio": 1.6, "clearance_ratio": 0.74, "friction": 0.33, "samples_per_revolution": 64,
        "overrides": {"rotor.damping.alpha": 0.4}, "revolutions": 1, "keep": (),
    }  # fmt: skip
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(direct, "draws_near", note)
        simulate("mokhtar2017", transient="direct", **case)
    piecewise, orbit = found[-1]
    first = simulate("mokhtar2017", transient=31, **case).final
    return piecewise, orbit, piecewise.march.reduced(first) - orbit.motion


def contacts_of(piecewise, orbit):
    return ContactsNearby(piecewise, orbit, Approach.to(piecewise, orbit.monodromy))


def sequence(piecewise, orbit, apart):
    return [piece.states for piece in piecewise.revolve(orbit.motion + apart, orbit.states).pieces]


def test_gaps_and_forces_nearby_are_those_of_the_motion_to_first_order(settled):
    """Of a thousandth of the distance, where a piece begins at the section: no event before moves it."""
    piecewise, orbit, apart = settled
    contacts, small = contacts_of(piecewise, orbit), 1e-3 * apart
    watched, n = contacts.watched, int(contacts.watched.parts[0, 1])
    piece = orbit.revolutions[0].pieces[0]
    mode = piecewise.mode(piece.states)
    z = piecewise.enter(mode, 0.0, orbit.motion + small)
    exponent = mode.tables.exponent[0] + 1j * mode.tables.exponent[1]
    times = piece.duration * (np.arange(n) + 0.5) / n
    row = mode.tables.switch_re[0] + 1j * mode.tables.switch_im[0]
    nearby = (np.exp(times[:, None] * exponent) * (z[0] + 1j * z[1]) @ row).real
    assert nearby == pytest.approx(watched.value[:n] + small @ watched.change[:, :n], rel=1e-9)
    assert nearby != pytest.approx(watched.value[:n], rel=1e-6)


def test_another_contact_comes_where_it_is_foreseen(settled):
    """Least share of the distance at which the order of contacts is another one: 1.11 predicted, 1.44 met."""
    piecewise, orbit, apart = settled
    apart = apart * piecewise.size(orbit.motion) / piecewise.size(apart)
    contacts, usual = contacts_of(piecewise, orbit), sequence(piecewise, orbit, 0.0 * apart)
    shares = np.arange(0.1, 3.0, 0.1)
    foreseen = [contacts.keeps_contacts(share * apart, 1) for share in shares]
    met = [sequence(piecewise, orbit, share * apart) == usual for share in shares]
    assert foreseen[0]
    assert met[0]
    assert all(before >= after for before, after in pairwise(foreseen))
    assert foreseen.index(False) == pytest.approx(met.index(False), abs=4)


def test_all_periods_ahead_are_looked_at(settled):
    """A disturbance that meets another contact only when its phase has come round."""
    piecewise, orbit, apart = settled
    contacts, shares = contacts_of(piecewise, orbit), np.arange(0.2, 8.0, 0.2)
    random, later = np.random.default_rng(3), 0
    unit = np.repeat([1.0 / piecewise.setup.spin, 1.0], piecewise.n)
    for _ in range(3):
        apart = np.linalg.matrix_power(orbit.monodromy, 12) @ (unit * random.standard_normal(unit.size))
        apart *= piecewise.size(orbit.motion) / piecewise.size(apart)
        for share in shares:
            at, period = share * apart, 0
            while period < 64 and contacts.keeps_contacts(at, 1):
                at, period = orbit.monodromy @ at, period + 1
            assert contacts.keeps_contacts(share * apart, 64) == (period == 64)
            later += 0 < period < 64
    assert later > 0


def test_times_are_spread_over_the_revolution(settled):
    piecewise, orbit, _ = settled
    parts = contacts_of(piecewise, orbit).watched.parts
    counts = (parts[:, 1] - parts[:, 0]).tolist()
    assert len(counts) == len(orbit.revolutions[0].pieces)
    assert sum(counts) == pytest.approx(PER_REVOLUTION, abs=len(counts))
