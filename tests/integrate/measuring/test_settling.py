"""Motions that had settled before their record, and others that had not: signals of known kind, then rubs."""

import math

import numpy as np
import pytest
from closed_form import simulate

from rubhpc.integrate.measuring.orbit_measures import period
from rubhpc.integrate.measuring.settling import BLOCK, UNKNOWN, halves, heard, is_steady, settled

SAMPLES, REVOLUTIONS = 32, 64
TURN = 2 * math.pi * np.arange(REVOLUTIONS * SAMPLES) / SAMPLES
CIRCLE = np.exp(1j * TURN)
GOLDEN = (math.sqrt(5) - 1) / 2
AGE = np.arange(REVOLUTIONS * SAMPLES) / SAMPLES  # revolutions


def decay(half_life):
    """Share left after each sample, `half_life` in revolutions."""
    return 0.5 ** (AGE / half_life)


def steps(sizes):
    """One value for each revolution."""
    return np.repeat(sizes, SAMPLES)


def logistic(start):
    """The logistic map of rate 4, 100 iterations after its beginning."""
    sizes = [start]
    for _ in range(100 + REVOLUTIONS - 1):
        sizes.append(4.0 * sizes[-1] * (1 - sizes[-1]))
    return np.array(sizes[-REVOLUTIONS:])


def of(whirl, *, torsion=None, impulse=None, is_contact=True, others=()):
    """Flag of an orbit, with as steady an impulse as its amplitude is."""
    n = whirl.size // SAMPLES
    if impulse is None:
        impulse = np.abs(whirl).reshape(n, SAMPLES).mean(axis=1)[np.newaxis]
    motion = np.stack([whirl.real, whirl.imag, np.zeros(whirl.size) if torsion is None else torsion])
    return settled(
        motion,
        impulse,
        SAMPLES,
        period=period(whirl.real, whirl.imag, SAMPLES),
        is_contact=is_contact,
        others=others,
    )


STEADY = {
    "period 1": CIRCLE,
    "period 3": CIRCLE + 0.4 * np.exp(1j * TURN / 3),
    "torus": CIRCLE + 0.3 * np.exp(1j * GOLDEN * TURN),
    "torus of a slow beat": CIRCLE + 0.3 * np.exp(1.05j * TURN),
    "period 1 by a weak torus": CIRCLE + 0.006 * np.exp(1j * GOLDEN * TURN),
    "period 20": CIRCLE + 0.3 * np.exp(1.05j * TURN) + 0.1 * np.exp(2.1j * TURN),
    **{f"chaos from {x}": CIRCLE * (1 + steps(logistic(x))) for x in np.linspace(0.1, 0.9, 9)},
}
MOVING = {
    **{f"decay, half-life {n}": CIRCLE * (1 + 0.6 * decay(n)) for n in (4, 10, 30, 100)},
    "slow decay, period 1 from cycle to cycle": CIRCLE * (1 + 0.1 * decay(40)),
    "torus that shrinks": CIRCLE + 0.3 * decay(20) * np.exp(1j * GOLDEN * TURN),
    "torus that grows": CIRCLE + 0.02 / decay(15) * np.exp(1j * GOLDEN * TURN),
    "torus that drifts": CIRCLE * (1 + AGE / REVOLUTIONS) + 0.1 * np.exp(1j * GOLDEN * TURN),
    "chaos that drifts": CIRCLE * (1 + 0.2 * steps(logistic(0.3)) + 3 * AGE / REVOLUTIONS),
    "orbit whose centre drifts": CIRCLE + 0.5 * AGE / REVOLUTIONS,
}


@pytest.mark.parametrize("name", STEADY)
def test_a_steady_motion_has_settled(name):
    assert of(STEADY[name]) == 1


@pytest.mark.parametrize("name", MOVING)
def test_a_motion_that_still_changes_has_not(name):
    assert of(MOVING[name]) == 0


def test_small_changes_do_not_count():
    assert of(CIRCLE * (1 + 0.009 * decay(10))) == 1
    assert of(CIRCLE * (1 + 0.02 * decay(10))) == 0


def test_torsion_and_impulse_count_as_the_orbit_does():
    assert of(CIRCLE, torsion=0.5 * np.sin(TURN)) == 1
    assert of(CIRCLE, torsion=0.5 * decay(10) * np.sin(TURN)) == 0
    fading = decay(10)[::SAMPLES]
    assert of(CIRCLE, impulse=np.stack([np.ones(REVOLUTIONS), 1 + 0.001 * fading])) == 1
    assert of(CIRCLE, impulse=np.stack([np.ones(REVOLUTIONS), 1 + fading])) == 0
    begins = (AGE[::SAMPLES] >= REVOLUTIONS / 2).astype(float)  # a contact in the second half alone
    assert of(STEADY["torus"], impulse=begins[np.newaxis]) == 0


@pytest.mark.parametrize("jumps", [False, True])
def test_every_signal_counts_on_its_own_scale(jumps):
    """Ringing above 1X in a signal far smaller than the orbit; in 64 revolutions it halves."""
    rings, forced = np.sin(math.sqrt(2.0) * TURN), np.sin(TURN)
    for size, least, expected in ((1e-3, 1e-4, 0), (1e-6, 1e-4, 1), (1e-12, 0.0, 0)):
        fading = size * (0.2 * forced + decay(64) * rings)[np.newaxis]
        assert of(CIRCLE, others=[heard(fading, SAMPLES, least, jumps=jumps)]) == expected
        assert of(STEADY["torus"], others=[heard(fading, SAMPLES, least, jumps=jumps)]) == expected
        lasting = size * (forced + rings)[np.newaxis]
        assert of(CIRCLE, others=[heard(lasting, SAMPLES, least, jumps=jumps)]) == 1
    offset = 1.0 + 1e-5 * decay(10)[np.newaxis]  # a small share of the largest value
    assert of(CIRCLE, others=[heard(offset, SAMPLES, 0.0, jumps=jumps)]) == 1


def test_a_torsion_that_still_rings_has_not_settled():
    """Its orbit repeats within 1 %, while the torsion changes by 11 % in the record."""
    case = {"speed_ratio": 6.0, "clearance_ratio": 0.97, "samples_per_revolution": 128, "keep": ()}
    found = [simulate("mokhtar2017", transient=n, **case) for n in (120, 1000)]
    assert [record.period for record in found] == [1, 1]
    assert [record.settled for record in found] == [0, 1]


def test_without_contact_only_a_periodic_motion_has_settled():
    assert of(CIRCLE, is_contact=False) == 1
    assert of(STEADY["torus"], is_contact=False) == 0


def test_a_short_record_shows_it_only_of_periodic_motions():
    short = slice(0, 12 * SAMPLES)
    assert of(CIRCLE[short]) == 1
    assert of(MOVING["slow decay, period 1 from cycle to cycle"][short]) == 0
    assert of(STEADY["torus"][short]) == UNKNOWN
    assert of(CIRCLE[:SAMPLES]) == UNKNOWN


def test_halves_of_what_is_known():
    shift, deviation = halves(np.arange(64.0)[:, np.newaxis])
    assert shift == pytest.approx(32.0)
    assert deviation == pytest.approx((np.arange(32.0).std(ddof=1),) * 2)
    assert shift / deviation[0] == pytest.approx(math.sqrt(12), rel=0.02)


@pytest.mark.parametrize("n_block", [4, 16, 48])
def test_energy_is_steady_up_to_five_standard_errors_of_its_blocks(n_block):
    noise = np.random.default_rng(n_block).standard_normal(n_block)
    for half in (noise[: n_block // 2], noise[n_block // 2 :]):
        half -= half.mean()
        half /= half.std(ddof=1)
    error = math.sqrt(2.0 / (n_block // 2))  # of the difference of two means, each of unit scatter
    for shift, expected in ((0.0, True), (4.9, True), (5.1, False)):
        blocks = 100.0 + noise + shift * error * (np.arange(n_block) >= n_block // 2)
        assert is_steady(np.repeat(blocks, BLOCK)) == expected


@pytest.mark.parametrize(
    ("case", "transient", "flag"),
    [
        ({"speed_ratio": 0.75, "clearance": "84 um"}, 120, 1),  # period 1
        ({"speed_ratio": 0.75, "clearance": "84 um"}, 0, 0),
        ({"speed_ratio": 2.0, "clearance": "1 mm"}, 120, 1),  # no contact
        ({"speed_ratio": 2.0, "clearance": "1 mm"}, 2, 0),
        ({"speed_ratio": 2.3, "clearance_ratio": 0.8}, 120, 1),  # chaos
    ],
)
def test_packaged_cases(case, transient, flag):
    record = simulate("mokhtar2017", **case, transient=transient, samples_per_revolution=64, keep=())
    assert record.settled == flag
