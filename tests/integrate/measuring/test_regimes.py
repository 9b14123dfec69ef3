"""Regimes of orbits whose kind is known, from their cycles and from how neighbours part."""

import math
from itertools import repeat

import numpy as np
import pytest

from rubhpc.integrate.measuring.orbit_measures import cycle_distances, is_torus
from rubhpc.integrate.measuring.orbit_measures import period as period_of
from rubhpc.integrate.measuring.regimes import LASTING_REVOLUTIONS, Solution, by_growth, regime
from rubhpc.schema import REGIME

SAMPLES, REVOLUTIONS = 64, 64
TURN = 2 * math.pi * np.arange(REVOLUTIONS * SAMPLES) / SAMPLES
GOLDEN = (math.sqrt(5) - 1) / 2


def torus(order, amount=0.2):
    """Forward whirl with a part of some other order."""
    return np.exp(1j * TURN) + amount * np.exp(1j * order * TURN + 0.4j)


def swollen(sizes):
    """Forward whirl on a circle of another size each revolution."""
    return np.exp(1j * TURN) * (1 + 0.2 * np.repeat(sizes, SAMPLES))


def logistic(rate):
    """The logistic map, 100 iterations after its beginning."""
    sizes = [0.3]
    for _ in range(100 + REVOLUTIONS - 1):
        sizes.append(rate * sizes[-1] * (1 - sizes[-1]))
    return sizes[-REVOLUTIONS:]


def settling(share):
    """A spiral into a periodic orbit, with an order of its own."""
    return np.exp(1j * TURN) + 0.5 * np.exp((1j * GOLDEN + math.log(share) / (2 * math.pi)) * TURN)


def unread():
    """Growth that nobody may ask for."""
    raise AssertionError
    yield


def of(whirl, growth, *, period=0, is_contact=True):
    verdict = regime(whirl.real, whirl.imag, SAMPLES, period=period, is_contact=is_contact, growth=growth)
    return REGIME[verdict.flag], verdict.exponent


@pytest.mark.parametrize("period", [0, 1, 16])
def test_without_contact_nothing_else_counts(period):
    found = of(swollen(logistic(4.0)), unread(), period=period, is_contact=False)
    assert found == ("no_contact", pytest.approx(math.nan, nan_ok=True))


def test_period_makes_a_motion_periodic_at_no_cost():
    name, exponent = of(torus(1 / 3), unread(), period=3)
    assert name == "periodic"
    assert math.isnan(exponent)


@pytest.mark.parametrize(
    ("growth", "expected"), [(-0.2, ("periodic", 1, False)), (0.3, ("chaotic", 0, False))]
)
def test_drift_of_cycles_that_follow_one_another_closely_is_no_period(growth, expected):
    """Each cycle is the last one within 0.1 %, the last the first within 6 %: what follows decides."""
    whirl = swollen(np.linspace(0.0, 0.3, REVOLUTIONS))
    assert period_of(whirl.real, whirl.imag, SAMPLES) == 1
    verdict = regime(whirl.real, whirl.imag, SAMPLES, period=1, is_contact=True, growth=repeat(growth))
    assert (REGIME[verdict.flag], verdict.period, verdict.is_reached) == expected


def test_drift_of_a_short_record_is_undecided():
    whirl = swollen(np.linspace(0.0, 0.3, REVOLUTIONS))[: 12 * SAMPLES]
    assert of(whirl, unread(), period=1)[0] == "undecided"


def test_period_beyond_sixteen_is_one_too():
    name, exponent = of(torus(8 / 21), unread())
    assert name == "periodic"
    assert math.isnan(exponent)


def test_orders_without_common_period_are_a_torus_at_the_first_look():
    growth = iter([0.03, -0.03] * 6)  # as many spans as are read at first
    name, exponent = of(torus(GOLDEN), growth)
    assert name == "quasi_periodic"
    assert exponent == pytest.approx(0.0, abs=1e-15)
    assert next(growth, None) is None


@pytest.mark.parametrize("order", [GOLDEN, math.sqrt(2), math.sqrt(3), math.e, 1 / math.pi, 2**0.25])
@pytest.mark.parametrize("amount", [0.05, 0.5, 2.0])
def test_cycles_of_two_orders_lie_on_a_torus(order, amount):
    whirl = torus(order, amount)
    assert is_torus(cycle_distances(whirl.real, whirl.imag, SAMPLES))


@pytest.mark.parametrize("rate", [3.6, 3.65, 3.7, 3.8, 3.9, 4.0])
def test_cycles_of_chaos_lie_on_none(rate):
    """At 3.6 in two narrow bands, to which each second revolution returns."""
    whirl = swollen(logistic(rate))
    assert not is_torus(cycle_distances(whirl.real, whirl.imag, SAMPLES))


def test_cycles_that_repeat_exactly_lie_on_none():
    """As those of a motion that comes to rest in between."""
    distances = cycle_distances(*np.tile(np.random.default_rng(1).random((2, 3 * SAMPLES)), 8), SAMPLES)
    distances[distances < 1e-12] = 0.0
    assert not is_torus(distances)


@pytest.mark.parametrize("share", [0.9, 0.95, 0.98])
def test_cycles_that_settle_lie_on_none(share):
    whirl = settling(share)
    assert not is_torus(cycle_distances(whirl.real, whirl.imag, SAMPLES))


@pytest.mark.parametrize("rate", [3.7, 4.0])
def test_motion_whose_neighbours_part_is_chaotic(rate):
    """The exponent of the logistic map is the mean logarithm of its slope; ln 2 at 4."""
    sizes = np.array(logistic(rate))
    slopes = np.log(np.abs(rate * (1 - 2 * sizes)))
    name, exponent = of(swollen(sizes), slopes)
    assert name == "chaotic"
    assert exponent == pytest.approx(slopes[:12].mean())
    assert exponent == pytest.approx(math.log(2) if rate == 4.0 else 0.35, abs=0.2)


@pytest.mark.parametrize(
    ("rate", "expected"), [(0.02, "chaotic"), (-0.02, "periodic"), (0.005, "quasi_periodic")]
)
def test_slow_growth_is_looked_at_four_times_as_long(rate, expected):
    growth = iter([rate] * 65)
    assert of(swollen(logistic(3.8)), growth) == (expected, pytest.approx(rate))
    assert len(list(growth)) == 1


def test_short_record_stays_undecided():
    whirl = torus(GOLDEN)[: 15 * SAMPLES]
    name, exponent = of(whirl, unread())
    assert name == "undecided"
    assert math.isnan(exponent)


def test_growth_that_chance_may_have_made_is_none():
    """Of +-0.4 about 0.02 the mean over 64 spans errs by 0.05, over 256 by 0.025."""
    growth = iter([0.42, -0.38] * 200)
    assert of(swollen(logistic(3.8)), growth) == ("quasi_periodic", pytest.approx(0.02))
    assert len(list(growth)) == 400 - 256
    growth = iter([0.48, -0.32] * 200)
    assert of(swollen(logistic(3.8)), growth)[0] == "chaotic"


@pytest.mark.parametrize("revolutions", [16, 31])
@pytest.mark.parametrize(
    ("rate", "expected", "n_read"),
    [(0.3, "chaotic", 12), (-0.3, "periodic", 12), (0.0, "quasi_periodic", 64), (0.03, "chaotic", 64)],
)
def test_of_a_record_that_shows_no_torus_the_growth_decides(revolutions, rate, expected, n_read):
    growth = iter([rate] * 100)
    whirl = torus(GOLDEN)[: revolutions * SAMPLES]
    assert of(whirl, growth) == (expected, pytest.approx(rate))
    assert len(list(growth)) == 100 - n_read


def test_motion_next_to_one_that_runs_away_stays_undecided():
    name, exponent = of(swollen(logistic(4.0)), iter([0.3] * 5))
    assert name == "undecided"
    assert math.isnan(exponent)


def closing(period, multiplier, whirl, shift=0.0):
    """Solver that finds the motion of these cycles, `shift` (of the whirl's size) apart from its section."""
    section = whirl[::SAMPLES][-period:] + shift
    return lambda asked: Solution(period, multiplier, np.column_stack([section.real, section.imag]))


def judged(whirl, solve, *, period=3, growth=None, later=None, lasts=None, n_event=0.0):
    verdict = regime(
        whirl.real,
        whirl.imag,
        SAMPLES,
        period=period,
        is_contact=True,
        growth=unread() if growth is None else growth,
        solve=solve,
        later=later,
        lasts=lasts,
        n_event=n_event,
    )
    return REGIME[verdict.flag], verdict


def no_solution(asked):
    """A solver that finds nothing."""


THIRD, DRAWN = torus(1 / 3), np.exp(1j * TURN)
WEAK = torus(GOLDEN, amount=0.002)  # cycles differ by 0.4 %
DECAY = np.exp(-TURN / (2 * math.pi * 40))  # to 0.2 within the record
# Record, its period, a solver, how neighbours part if that may be asked for; regime, period, and whether it
# has been reached.
JUDGED = {
    "agrees with a stable motion": (THIRD, 3, closing(3, 0.3 - 0.4j, THIRD), None, ("periodic", 3, True)),
    "of three within six revolutions": (THIRD, 6, closing(3, 0.9, THIRD), None, ("periodic", 3, True)),
    "drifts along a torus": (
        torus(1 / 3 + 1e-4),  # for neighbouring cycles it looks like an unstable motion inside
        3,
        closing(3, 1.02j, torus(1 / 3 + 1e-4)),
        0.0,
        ("quasi_periodic", 0, True),
    ),
    "weak chaos": (THIRD, 3, no_solution, 0.1, ("chaotic", 0, False)),
    "weak chaos beside an unstable motion": (THIRD, 3, closing(3, 1.1, THIRD), 0.1, ("chaotic", 0, False)),
    "beside another motion": (THIRD, 3, closing(3, 0.5, THIRD, shift=0.5), 0.1, ("chaotic", 0, False)),
    "draws near": (DRAWN * (1 + 0.2 * DECAY), 1, closing(1, 0.98, DRAWN), None, ("periodic", 1, False)),
    "no solution, neighbours close up": (THIRD, 3, no_solution, -0.1, ("periodic", 3, True)),
    "torus within the tolerance": (WEAK, 1, no_solution, 0.0, ("quasi_periodic", 0, True)),
    "the same, short": (WEAK[: 8 * SAMPLES], 1, no_solution, None, ("undecided", 0, True)),
    "short, no solution": (THIRD[: 8 * SAMPLES], 3, no_solution, None, ("periodic", 3, True)),
    # Beside an unstable motion of two frequencies lies a torus, unless neighbours close up at a rate that
    # nothing but a locked motion has.
    "unstable at an angle": (THIRD, 3, closing(3, 0.6 + 0.81j, THIRD), -0.03, ("quasi_periodic", 0, True)),
    "locked": (THIRD, 3, closing(3, 0.6 + 0.81j, THIRD), -0.1, ("periodic", 0, True)),
    "unstable at no angle": (THIRD, 3, closing(3, 1.008, THIRD), -0.03, ("periodic", 0, True)),
}


@pytest.mark.parametrize("name", JUDGED)
def test_records_are_judged_by_solutions_and_how_neighbours_part(name):
    whirl, period, solve, rate, expected = JUDGED[name]
    found, verdict = judged(whirl, solve, period=period, growth=None if rate is None else repeat(rate))
    assert (found, verdict.period, verdict.is_reached) == expected
    if rate is not None:
        assert verdict.exponent == pytest.approx(rate, abs=1e-15)


def test_multiplier_is_that_of_the_solution():
    verdict = judged(THIRD, closing(3, 0.3 - 0.4j, THIRD))[1]
    assert verdict.multiplier == 0.3 + 0.4j
    assert math.isnan(verdict.exponent)
    drifts = torus(1 / 3 + 1e-4)
    assert math.isnan(abs(judged(drifts, closing(3, 1.02j, drifts), growth=repeat(0.0))[1].multiplier))


def test_motion_that_has_doubled_its_period_is_followed():
    whirl, asked = torus(1 / 2, amount=0.004), []

    def solve(period):
        asked.append(period)
        return closing(period, -1.2 if period == 1 else 0.7, whirl)(period)

    assert judged(whirl, solve, period=1)[1].period == 2
    assert asked == [1, 2]
    asked.clear()
    name, _ = judged(
        whirl, lambda n: asked.append(n) or closing(1, -1.2, whirl)(n), period=1, growth=iter([])
    )
    assert name == "undecided"
    assert asked == [1, 2, 4, 8, 16, 32]


@pytest.mark.parametrize("revolutions", [8, 16, 64])
def test_period_at_which_the_record_returns_is_tried_too(revolutions):
    """Period 4 within 1 % of an unstable motion of period 1, or of one that is not found."""
    whirl = torus(1 / 4, amount=0.003)[: revolutions * SAMPLES]
    locked = closing(4, 0.6, whirl)
    for other in (no_solution, closing(1, 1.02j, whirl)):
        name, verdict = judged(
            whirl,
            lambda asked, other=other: locked(asked) if asked == 4 else other(asked),
            period=1,
            later=lambda _: (),
        )
        assert (name, verdict.period, verdict.multiplier) == ("periodic", 4, 0.6)


def test_motion_that_is_found_further_on_proves_the_record():
    """Once there, whatever its distance from the record: that has not settled then."""
    whirl = torus(1 / 3)
    for shift, is_reached in ((0.0, True), (0.3, False)):
        found = closing(6, 0.5, whirl, shift)(6)._replace(is_led_to=True)
        name, verdict = judged(
            whirl,
            no_solution,
            later=lambda *_, found=found: [(3, no_solution), (6, lambda asked: found)],
        )
        assert (name, verdict.period, verdict.is_reached) == ("periodic", 6, is_reached)


@pytest.mark.parametrize(("rate", "name"), [(0.4, "chaotic"), (0.0, "quasi_periodic"), (-0.2, "periodic")])
def test_motion_without_a_period_is_what_it_comes_to_later(rate, name):
    """Chaos that dies out, above all: the exponent remains that of the record."""
    whirl, orbit = swollen(logistic(3.8)), torus(1 / 3)
    led_to = closing(3, 0.5, orbit)(3)._replace(is_led_to=True)
    unstable = led_to._replace(multiplier=1.5)
    trials = ((led_to, ("periodic", 3, False)), (unstable, (name, 0, True)), (None, (name, 0, True)))
    for found, expected in trials:
        judgement, verdict = judged(
            whirl,
            no_solution,
            period=0,
            growth=repeat(rate),
            later=lambda *_, found=found: [(5, no_solution), (3, lambda asked: found)],
            lasts=lambda _: True,
        )
        assert (judgement, verdict.period, verdict.is_reached) == expected
        assert verdict.exponent == pytest.approx(rate)


@pytest.mark.parametrize(("n_event", "expected"), [(80.0, "periodic"), (80.1, "quasi_periodic")])
def test_torus_is_followed_later_while_a_period_of_two_can_be_solved_for(n_event, expected):
    """A period is solved for with up to 160 events; chaos is followed with more of them, too."""
    orbit = torus(1 / 3)
    led_to = closing(3, 0.5, orbit)(3)._replace(is_led_to=True)
    keys = {"period": 0, "growth": repeat(0.0), "later": lambda *_: [(3, lambda asked: led_to)]}
    assert judged(torus(GOLDEN), no_solution, n_event=n_event, **keys)[0] == expected
    chaotic = keys | {"growth": repeat(0.4)}
    assert judged(swollen(logistic(3.8)), no_solution, n_event=n_event, **chaotic)[0] == "periodic"


def test_motion_with_a_period_is_not_followed_later():
    whirl = torus(1 / 3)
    assert judged(whirl, closing(3, 0.3, whirl), later=lambda *_: pytest.fail("needless"))[1].period == 3


@pytest.mark.parametrize("is_lasting", [True, False])
def test_chaos_has_settled_if_it_lasts(is_lasting):
    asked = []

    def later(*looks):
        asked.append(looks)
        return []

    keys = {"period": 0, "later": later, "lasts": lambda _: is_lasting}
    name, verdict = judged(swollen(logistic(3.8)), no_solution, growth=repeat(0.4), **keys)
    assert (name, verdict.is_reached) == ("chaotic", is_lasting)
    keys["lasts"] = lambda _: pytest.fail("no chaos")
    name, verdict = judged(swollen(logistic(3.8)), no_solution, growth=repeat(0.0), **keys)
    assert (name, verdict.is_reached) == ("quasi_periodic", True)
    assert asked == [(False, True), (False, False)]  # looks periodic, looks chaotic


@pytest.mark.parametrize("n_revolution", [LASTING_REVOLUTIONS - 1, LASTING_REVOLUTIONS])
def test_chaos_that_is_not_followed_has_settled_in_a_long_record_alone(n_revolution):
    whirl = np.random.default_rng(1).standard_normal((2, n_revolution))
    verdict = regime(*whirl, 1, period=0, is_contact=True, growth=repeat(0.4))
    assert REGIME[verdict.flag] == "chaotic"
    assert verdict.is_reached == (n_revolution == LASTING_REVOLUTIONS)


def test_displacement_that_falls_far_before_it_turns_along_a_torus_decays_no_more():
    """By e^6 within 96 revolutions, then not at all: over 64 and 256 of them -0.09 and -0.02 a revolution."""
    fall = [-0.25] * 8 + [-0.0625] * 16 + [0.001] * 300
    flag, exponent = by_growth(iter(fall), is_cheap=True)
    assert (REGIME[flag], abs(exponent) < 0.05) == ("quasi_periodic", True)
    steady = by_growth(iter([-0.02] * 100), is_cheap=True)
    assert (REGIME[steady[0]], steady[1]) == ("periodic", pytest.approx(-0.02))
