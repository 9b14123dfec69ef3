"""The regime of a motion: no contact, periodic, quasi-periodic or chaotic."""

from __future__ import annotations

import math
from itertools import islice
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.measuring.orbit_measures import (
    LONGEST_PERIOD,
    PERIOD_TOLERANCE,
    RecordedOrbit,
    is_torus,
)
from rubhpc.schema import REGIME

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    Solve = Callable[[int], "Solution | None"]
    Later = Callable[[bool, bool], Iterable[tuple[int, Solve]]]

Floats = NDArray[np.float64]

MOST_DOUBLED = 2 * LONGEST_PERIOD  # revolutions, to which period doublings are followed
STEEPEST = -2.0  # multiplier of a motion next to a stable one of twice the period; see `_proved`
MOST_EVENTS = 160  # in a period that is solved for; the time of a proof is proportional to them
MOST_DISTANT = 0.1  # of the orbit's size: a record farther from a motion does not settle on it
LEAST_REVOLUTIONS = LONGEST_PERIOD  # of a record without a period that is followed further
TORUS_REVOLUTIONS = 2 * LONGEST_PERIOD  # of a record that may show a torus, or a longer period, by itself
LASTING_REVOLUTIONS = 1536  # of a record that may show by itself that chaos lasts
N_FIRST, N_ALL, N_MOST = 12, 64, 256  # spans of measured growth, each if the one before was not conclusive
CLEAR = 0.05  # per revolution: sign of a larger exponent over 12 spans is certain
ZERO = 0.01  # per revolution: a smaller exponent counts as zero
LASTING = 0.03  # per revolution: least mean of the exponents of chaos and of what it is later
REAL = 1e-6  # imaginary part below which a multiplier counts as real
SURE = 2.0  # standard errors: an exponent within them counts as zero


class Solution(NamedTuple):
    """A periodic motion."""

    period: int  # revolutions
    multiplier: complex  # the largest
    section: (
        Floats  # (period, 2), m, vertical and horizontal at the shaft's angle 0, the end of a record first
    )
    is_led_to: bool = False  # revolutions after the record reach it


class Verdict(NamedTuple):
    """Regime of a motion."""

    flag: int  # of `schema.REGIME`
    period: int  # revolutions; 0: none found
    exponent: float = math.nan  # largest Lyapunov exponent per revolution, where it was measured
    multiplier: complex = complex(math.nan, math.nan)  # largest, where the periodic motion was solved for
    is_reached: bool = True  # false where the record has not settled on it
    repeats: bool = False  # the record is that of the motion itself


def undecided(vertical: Floats, horizontal: Floats, samples_per_revolution: int, is_contact: bool) -> Verdict:
    """Judge no record, where the regime is not asked for."""
    return Verdict(flag=REGIME.index("undecided"), period=0)


def regime(
    vertical: Floats,
    horizontal: Floats,
    samples_per_revolution: int,
    *,
    period: int,
    is_contact: bool,
    growth: Iterable[float],
    solve: Solve | None = None,
    later: Later | None = None,
    lasts: Callable[[float], bool] | None = None,
    n_event: float = 0.0,
) -> Verdict:
    """Judge a record.

    A record with an apparent period is periodic if a stable periodic motion is found near its end that the
    record agrees with or approaches. It is sought with the apparent period, with that of the nearest return,
    and in later revolutions. If none is found, the cycles must be the same within 1e-5. Where motions cannot
    be solved for, the record is periodic if its first and last cycles agree within 1 %.

    Without a period, a record shorter than 16 revolutions leaves the motion undecided: it is too short for
    some periods. From 16 to 31 revolutions the growth alone decides, because it is measured beyond the
    record. A longer record may show a torus, or a period beyond 16, by itself. A motion that reaches a
    periodic motion in later revolutions is periodic and has not settled. None is sought near the end of a
    torus, nor later where a period longer than 1 has too many events. Chaos has settled if it lasts in later
    revolutions or, where none are followed, in as many recorded ones.

    Parameters
    ----------
    vertical, horizontal : (n_revolution * samples_per_revolution,), m
    period : int
        Apparent period in revolutions, or 0 where there is none up to 16.
    growth : iterable of float
        Growth of a small displacement per revolution, span by span; read only where it is needed.
    solve : callable, optional
        Finds the motion of a period next to the end of the record (`proof.Solver`).
    later : callable, optional
        Searches in later revolutions, in order, where the record looks periodic or does not, and where it
        looks chaotic or does not (`proof.Solver.later`).
    lasts : callable, optional
        Whether chaos of an exponent goes on in them, after these searches.
    n_event : float
        Events in a revolution, where they are known.
    """
    if not is_contact:
        return Verdict(REGIME.index("no_contact"), period)
    orbit = RecordedOrbit(vertical, horizontal, samples_per_revolution)
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
    is_closed = is_long and is_torus(orbit.distances)  # the cycles lie on a closed curve
    flag, exponent = by_growth(growth, is_closed=is_closed, is_cheap=solve is not None)
    if search.turns_away and flag == periodic and exponent > -CLEAR:
        flag = REGIME.index("quasi_periodic")  # a torus around it, still too close to be distinguished
    if repeats and flag != REGIME.index("chaotic"):
        return Verdict(periodic, orbit.closest_return, exponent)
    is_chaotic = flag == REGIME.index("chaotic")
    is_regular = flag in (periodic, REGIME.index("quasi_periodic"))
    is_torus_shown = is_closed and flag == REGIME.index("quasi_periodic")
    may_be_long = is_long and is_regular and not is_torus_shown and looks_like == 0
    if solve and may_be_long and orbit.nearest_return > LONGEST_PERIOD // 2:
        verdict = search.proves(orbit.nearest_return, solve)
        if verdict is not None:
            return verdict._replace(exponent=exponent)
    if later and looks_like == 0 and not (is_torus_shown and 2 * n_event > MOST_EVENTS):
        verdict = search.proves_any(later(False, is_chaotic))
        if verdict is not None:
            return verdict._replace(exponent=exponent)
    is_settling = solve is None and flag == periodic and period > 0
    is_passing = is_chaotic and not (lasts(exponent) if lasts else orbit.n_revolution >= LASTING_REVOLUTIONS)
    return Verdict(flag, period if is_settling else 0, exponent, is_reached=not (is_settling or is_passing))


def known_regime(period: int, multiplier: complex, *, is_contact: bool) -> Verdict:
    """Judge the record of a stable periodic motion that was solved for, which shows that motion alone."""
    if not is_contact:
        return Verdict(REGIME.index("no_contact"), period, repeats=True)
    return Verdict(REGIME.index("periodic"), period, multiplier=_upper(multiplier), repeats=True)


def _upper(multiplier: complex) -> complex:
    """One of a conjugate pair: with the positive imaginary part."""
    return complex(multiplier.real, abs(multiplier.imag))


class _Search:
    """The search for a stable motion that a record agrees with or approaches."""

    def __init__(self, orbit: RecordedOrbit) -> None:
        self._orbit = orbit
        self.finds_nothing = True  # neither such a motion nor another one
        self.turns_away = False  # from an unstable motion that the record agrees with, in two directions

    def proves(self, period: int, solve: Solve, later: Later | None = None) -> Verdict | None:
        """Judge by the motion of a period, by that of the closest return, and by later searches."""
        asked: set[int] = set()
        verdict = self._proved(period, solve, asked)
        if verdict is not None or later is None:
            return verdict
        closest = self._orbit.closest_return
        if closest not in asked and (verdict := self._proved(closest, solve, asked)):
            return verdict
        return self.proves_any(later(True, False))

    def proves_any(self, trials: Iterable[tuple[int, Solve]]) -> Verdict | None:
        """Judge by the first successful search."""
        verdicts = (self._proved(period, solve, set()) for period, solve in trials)
        return next((verdict for verdict in verdicts if verdict is not None), None)

    def _proved(self, period: int, solve: Solve, asked: set[int]) -> Verdict | None:
        """Judge by the motion of a period; None where there is none, or it is unstable or elsewhere.

        An unstable motion with alternating disturbances is followed to twice its period, unless they more
        than double: where doublings accumulate they grow by 1.60 (Feigenbaum 1978).
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
        apart = self._orbit.distances_from(found.section)
        first, last = apart[: found.period].max(), apart[-found.period :].max()
        if abs(found.multiplier) >= 1.0:
            self.turns_away |= bool(last <= PERIOD_TOLERANCE and abs(found.multiplier.imag) > REAL)
            return None
        draws_near = found.is_led_to or (last <= MOST_DISTANT and last <= first)
        if last > PERIOD_TOLERANCE and not draws_near:
            return None
        is_reached = bool(max(first, last) <= PERIOD_TOLERANCE)
        return Verdict(
            REGIME.index("periodic"), found.period, multiplier=_upper(found.multiplier), is_reached=is_reached
        )


def by_growth(
    growth: Iterable[float],
    *,
    is_closed: bool = False,
    is_cheap: bool = False,
) -> tuple[int, float]:
    """Judge by the growth of a displacement: flag of `schema.REGIME`, largest Lyapunov exponent or NaN.

    `is_closed`: the cycles lie on a closed curve (`is_torus`). `is_cheap`: spans may be read until a
    displacement has found its direction; with many slow modes it first decreases for long.
    """
    grown: list[float] = []
    spans = iter(growth)

    def reaches(n_span: int) -> bool:
        """Whether so many spans can be read."""
        grown.extend(islice(spans, max(0, n_span - len(grown))))
        return len(grown) >= n_span

    if not reaches(N_FIRST):
        return REGIME.index("undecided"), math.nan  # the neighbouring motion cannot continue
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
    """Standard error of the mean of independent growths."""
    return float(np.std(grown)) / math.sqrt(len(grown))
