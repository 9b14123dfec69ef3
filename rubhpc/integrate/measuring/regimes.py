"""The regime of a motion: no contact, periodic, quasi-periodic or chaotic."""

from __future__ import annotations

import math
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.measuring.orbit_measures import LONGEST_PERIOD, PERIOD_TOLERANCE, ends_change
from rubhpc.schema import REGIME

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    Solve = Callable[[int], "Solution | None"]
    Later = Callable[[bool], Iterable[tuple[int, Solve]]]
    Within = Callable[[], list[float]]

Floats = NDArray[np.float64]

MOST_DOUBLED = 2 * LONGEST_PERIOD  # revolutions, to which period doublings are followed
STEEPEST = -2.0  # multiplier of a motion beside a stable one of twice the period; -1.60 where doublings end
MOST_EVENTS = 160  # in a period that is solved for; the time that a proof takes goes with them
MOST_DISTANT = 0.1  # of the orbit's size: a record that is farther from a motion does not settle on it
LEAST_REVOLUTIONS = LONGEST_PERIOD  # of a record without a period that is worth following further
TORUS_REVOLUTIONS = 2 * LONGEST_PERIOD  # of a record that may show a torus, or a longer period, by itself
N_FIRST, N_ALL, N_MOST = 16, 64, 256  # spans whose growth is measured, each where the last left it open
CLEAR = 0.05  # per revolution: an exponent beyond that over 16 spans keeps its sign
ZERO = 0.01  # per revolution: an exponent within that is none
EQUAL = 1e-5  # of the orbit's size: cycles as near as that are the same where no motion can be solved for
NOISE, ALIKE = 1e-9, 2.0  # of the orbit's size, and times the nearest return: a return as near as any
REAL = 1e-6  # imaginary part of a multiplier that is taken for a real one
SURE = 2.0  # standard errors: an exponent within that is none, too
# A torus: the nearest return is that near, of the distance between cycles; that of twice as many revolutions
# is twice as far, by 8 %; and neither half of the record has the farther ones.
NEAR, TWICE, EVEN = 0.21, (1.85, 2.16), 1.5


class Solution(NamedTuple):
    """A periodic motion."""

    period: int  # revolutions
    multiplier: complex  # the largest
    section: (
        Floats  # (period, 2), m, vertical and horizontal at the shaft's angle 0, the end of a record first
    )
    is_led_to: bool = False  # what follows the record has come to it


class Verdict(NamedTuple):
    """What a motion is."""

    flag: int  # of `schema.REGIME`
    period: int  # revolutions; 0: none found
    exponent: float = math.nan  # largest Lyapunov exponent per revolution, where it had to be measured
    multiplier: complex = complex(math.nan, math.nan)  # largest, where the periodic motion was solved for
    is_reached: bool = True  # false where the record still settles on it


def regime(
    vertical: Floats,
    horizontal: Floats,
    samples_per_revolution: int,
    *,
    period: int,
    is_contact: bool,
    growth: Iterable[float],
    solve: Solve | None = None,
    within: Within | None = None,
    later: Later | None = None,
    n_event: float = 0.0,
) -> Verdict:
    """Judge a record.

    A record that looks periodic is so if a stable periodic motion is found next to its end, which the record
    agrees with or draws near to: of the period that it looks like, of that at which it returns nearest, or in
    later revolutions. If none is found, its cycles must be the same within 1e-5. Where motions cannot be
    solved for at all, it is taken for what it looks like, if its first cycles are its last ones within 1 %.
    A record shorter than 16 revolutions without a period leaves the motion undecided: it is too short for
    some periods. From 16 to 31 the growth alone decides, for it is measured beyond the record; a longer
    record may show a torus, or a period beyond 16, by itself. A motion that shows no period, but comes to a
    periodic motion in later revolutions, is that and has not settled. Next to the end of a torus that the
    record shows none is sought, and of one with so many events that no motion of a longer period than 1 could
    be solved for, none later.

    Parameters
    ----------
    vertical, horizontal : (n_revolution * samples_per_revolution,), m
    period : int
        Revolutions after which the record looks the same, or 0 where there are none up to 16.
    growth : iterable of float
        Growth of a small displacement per revolution, span by span; read only where it is needed.
    solve : callable, optional
        Finds the motion of a period next to the end of the record (`proof.Solver`).
    within : callable, optional
        Growth of a small displacement within the record, span by span (`lyapunov.Growth.within`).
    later : callable, optional
        What to try in later revolutions, in turn, where the record looks periodic or does not
        (`proof.Solver.later`).
    n_event : float
        Events in a revolution, where they are known.
    """
    if not is_contact:
        return Verdict(REGIME.index("no_contact"), period)
    orbit = _Orbit(vertical, horizontal, samples_per_revolution)
    periodic = REGIME.index("periodic")
    looks_like = period
    is_long = orbit.n_revolution >= TORUS_REVOLUTIONS
    if is_long and period == 0 and orbit.returns.min() <= PERIOD_TOLERANCE**2 * orbit.size**2:
        looks_like = orbit.nearest_return
    if solve is None and looks_like > 0 and orbit.has_equal_ends(looks_like):
        return Verdict(periodic, period)
    search = _Search(orbit)
    if solve and looks_like > 0 and (verdict := search.proves(looks_like, solve, later)):
        return verdict
    is_open = looks_like > 0 and search.finds_nothing
    repeats = is_open and orbit.repeats(orbit.closest_return)
    if orbit.n_revolution < LEAST_REVOLUTIONS:
        return Verdict(periodic, orbit.closest_return) if repeats else Verdict(REGIME.index("undecided"), 0)
    is_closed = is_long and is_torus(orbit.distances)  # the curve on which the cycles lie
    flag, exponent = by_growth(growth, within, is_closed=is_closed, is_cheap=solve is not None)
    if search.turns_away and flag == periodic and exponent > -CLEAR:
        flag = REGIME.index("quasi_periodic")  # a torus about it, too near yet to be seen as one
    if repeats and flag != REGIME.index("chaotic"):
        return Verdict(periodic, orbit.closest_return, exponent)
    is_regular = flag in (periodic, REGIME.index("quasi_periodic"))
    is_torus_shown = is_closed and flag == REGIME.index("quasi_periodic")
    may_be_long = is_long and is_regular and not is_torus_shown and looks_like == 0
    if solve and may_be_long and orbit.nearest_return > LONGEST_PERIOD // 2:
        verdict = search.proves(orbit.nearest_return, solve)
        if verdict is not None:
            return verdict._replace(exponent=exponent)
    if later and looks_like == 0 and not (is_torus_shown and 2 * n_event > MOST_EVENTS):
        verdict = search.proves_any(later(False))
        if verdict is not None:
            return verdict._replace(exponent=exponent)
    is_settling = solve is None and flag == periodic
    return Verdict(flag, period if is_settling else 0, exponent, is_reached=not (is_settling and period > 0))


class _Orbit:
    """A recorded orbit, its section and size."""

    def __init__(self, vertical: Floats, horizontal: Floats, samples_per_revolution: int) -> None:
        self.signals = np.stack([vertical, horizontal])
        self.n_revolution = vertical.size // samples_per_revolution
        self.size = math.sqrt(float(self.signals.var(axis=1).sum()))
        self.section = self.signals[:, ::samples_per_revolution].T
        self.cycles = self.signals.reshape(2, self.n_revolution, -1).swapaxes(0, 1)

    @cached_property
    def distances(self) -> Floats:
        """Mean square distance between all whole cycles, (n_revolution, n_revolution), m2."""
        vertical, horizontal = self.signals
        return cycle_distances(vertical, horizontal, vertical.size // self.n_revolution)

    @cached_property
    def returns(self) -> Floats:
        """Mean square distance of cycles 1, 2, ... revolutions apart, up to a third of the record, m2."""
        return returns(self.distances)

    @property
    def nearest_return(self) -> int:
        """Revolutions after which that is least."""
        return int(self.returns.argmin()) + 1

    def distances_from(self, solution: Solution) -> Floats:
        """Distance of each section point from that of a solution, over the size of the orbit."""
        place = (np.arange(self.n_revolution) - self.n_revolution) % solution.period
        apart = np.linalg.norm(self.section - solution.section[place], axis=1)
        return np.asarray(apart / max(self.size, np.finfo(float).tiny))

    def has_equal_ends(self, period: int, tolerance: float = PERIOD_TOLERANCE) -> bool:
        """Whether the first cycles are those as many whole periods later as there are."""
        change = ends_change(self.cycles.reshape(self.n_revolution, -1), period)
        return change <= tolerance * self.size * math.sqrt(self.cycles.shape[2])

    def repeats(self, period: int) -> bool:
        """Whether its cycles are the same a period later, and at its ends."""
        square = self._square_returns[period - 1]
        return square <= EQUAL**2 * self.size**2 and self.has_equal_ends(period, EQUAL)

    @cached_property
    def closest_return(self) -> int:
        """Revolutions after which the cycles return nearest."""
        return closest_return(self._square_returns, self.size)

    @cached_property
    def _square_returns(self) -> Floats:
        """Mean square distance of cycles 1, 2, ... revolutions apart, m2."""
        n = self.n_revolution
        longest = max(1, n // 3, min(n // 2, LONGEST_PERIOD))
        apart = [self.cycles[k:] - self.cycles[: n - k] for k in range(1, longest + 1)]
        return np.array([(one**2).sum(axis=1).mean() for one in apart])


def closest_return(square: Floats, size: float) -> int:
    """Least n whose mean square distance `square[n - 1]` is as near as any, for a motion of a size."""
    return int(np.argmax(square <= ALIKE**2 * square.min() + (NOISE * size) ** 2)) + 1


class _Search:
    """The search for a stable motion that a record agrees with, or draws near to."""

    def __init__(self, orbit: _Orbit) -> None:
        self._orbit = orbit
        self.finds_nothing = True  # neither such a motion nor another one
        self.turns_away = False  # from an unstable motion that the record agrees with, in two directions

    def proves(self, period: int, solve: Solve, later: Later | None = None) -> Verdict | None:
        """Judge by the motion of a period, by that of the closest return, and by what is found later on."""
        asked: set[int] = set()
        verdict = self._proved(period, solve, asked)
        if verdict is not None or later is None:
            return verdict
        closest = self._orbit.closest_return
        if closest not in asked and (verdict := self._proved(closest, solve, asked)):
            return verdict
        return self.proves_any(later(True))

    def proves_any(self, trials: Iterable[tuple[int, Solve]]) -> Verdict | None:
        """Judge by the first of these searches that finds such a motion."""
        verdicts = (self._proved(period, solve, set()) for period, solve in trials)
        return next((verdict for verdict in verdicts if verdict is not None), None)

    def _proved(self, period: int, solve: Solve, asked: set[int]) -> Verdict | None:
        """Judge by the motion of a period; None where that is none, unstable or elsewhere.

        An unstable motion whose disturbances change sides in every period is followed to twice its period, if
        they do not grow by more than double: where doublings accumulate they grow by 1.60 (Feigenbaum 1978).
        """
        found = solve(period)
        asked.add(period)
        while found and STEEPEST < found.multiplier.real < -1.0 and period < MOST_DOUBLED:
            self.finds_nothing = False
            period = 2 * period
            asked.add(period)
            found = solve(period)
        if found is None:
            return None
        self.finds_nothing = False
        apart = self._orbit.distances_from(found)
        first, last = apart[: found.period].max(), apart[-found.period :].max()
        if abs(found.multiplier) >= 1.0:
            self.turns_away |= bool(last <= PERIOD_TOLERANCE and abs(found.multiplier.imag) > REAL)
            return None
        draws_near = found.is_led_to or (last <= MOST_DISTANT and last <= first)
        if last > PERIOD_TOLERANCE and not draws_near:
            return None
        upper = complex(found.multiplier.real, abs(found.multiplier.imag))
        is_reached = bool(max(first, last) <= PERIOD_TOLERANCE)
        return Verdict(REGIME.index("periodic"), found.period, multiplier=upper, is_reached=is_reached)


def by_growth(
    growth: Iterable[float],
    within: Within | None = None,
    *,
    is_closed: bool = False,
    is_cheap: bool = False,
) -> tuple[int, float]:
    """Judge by how neighbours part: flag of `schema.REGIME`, and the largest Lyapunov exponent or NaN.

    `is_closed` states that the cycles lie on a closed curve (`is_torus`), `is_cheap` that spans may be asked
    for until a displacement has found its direction: among many slow modes it falls a long way before.
    """
    grown = [] if within is None else list(within())
    if is_closed and grown and abs(np.mean(grown)) < CLEAR:
        return REGIME.index("quasi_periodic"), float(np.mean(grown))
    spans = iter(growth)

    def reaches(n_span: int) -> bool:
        """Whether so many spans are there, or can be read."""
        grown.extend(islice(spans, max(0, n_span - len(grown))))
        return len(grown) >= n_span

    if not reaches(N_FIRST):
        return REGIME.index("undecided"), math.nan  # the motion next to it cannot go on
    if abs(np.mean(grown)) < CLEAR:
        if is_closed:
            return REGIME.index("quasi_periodic"), float(np.mean(grown))
        if not reaches(N_ALL):
            return REGIME.index("undecided"), math.nan
        if ZERO < abs(np.mean(grown)) < SURE * standard_error(grown):
            reaches(N_MOST)
        exponent = float(np.mean(grown))
        if abs(exponent) <= max(ZERO, SURE * standard_error(grown)):
            return REGIME.index("quasi_periodic"), exponent
    exponent = float(np.mean(grown))
    if exponent > 0.0:
        return REGIME.index("chaotic"), exponent
    if is_cheap and reaches(N_ALL):
        later = grown[len(grown) // 2 :]
        if abs(np.mean(later)) <= ZERO:
            return REGIME.index("quasi_periodic"), float(np.mean(later))
    return REGIME.index("periodic"), exponent


def standard_error(grown: list[float]) -> float:
    """Standard error of the mean of growths that follow one another by chance."""
    return float(np.std(grown)) / math.sqrt(len(grown))


def cycle_distances(vertical: Floats, horizontal: Floats, samples_per_revolution: int) -> Floats:
    """Mean square distance between all whole cycles, (n_revolution, n_revolution), m2."""
    cycles = np.concatenate([s.reshape(-1, samples_per_revolution) for s in (vertical, horizontal)], axis=1)
    cycles = cycles - cycles.mean(axis=0)
    product = cycles @ cycles.T
    square = np.diag(product)
    distances: Floats = np.maximum(square[:, np.newaxis] + square - 2.0 * product, 0.0)
    return distances / samples_per_revolution


def returns(distances: Floats) -> Floats:
    """Mean square distance of cycles 1, 2, ... revolutions apart, up to a third of the record, m2."""
    return np.array([np.diagonal(distances, n).mean() for n in range(1, len(distances) // 3 + 1)])


def is_torus(distances: Floats) -> bool:
    """Whether the cycles lie on a closed curve, along which each revolution takes them by the same share.

    After the revolutions that nearly fill whole rounds of that curve, the cycles are displaced along it by a
    little, and by twice that little after twice as many; those of chaotic motion return to a neighbourhood,
    however often, and those of a motion that still settles draw nearer and nearer.
    """
    square = returns(distances)
    n = int(square.argmin()) + 1
    once, twice = np.diagonal(distances, n), np.diagonal(distances, 2 * n)
    first, last = np.array_split(once, 2)
    near = math.sqrt(once.mean() / (distances.sum() / (distances.size - len(distances))))
    ratio = math.sqrt(twice.mean() / once.mean())
    is_even = max(first.mean(), last.mean()) < EVEN**2 * min(first.mean(), last.mean())
    return near < NEAR and TWICE[0] < ratio < TWICE[1] and bool(is_even)
