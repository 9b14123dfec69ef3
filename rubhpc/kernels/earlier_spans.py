"""How long no switch function can vanish, by an earlier span in the same contact mode.

A regular motion enters a contact mode in much the same way again and again. If the coordinates of two motions
differ by d as they enter it, a switch function with the coefficients c differs from then on by
`sum Re(c_k d_k exp(p_k t))`: by `sum |c_k| |d_k|` at most, times the growth of the coordinates. Slow
coordinates may nearly cancel; their sum is bounded by its value and rate at the beginning. One span for which
lower bounds of all functions are known therefore answers for those that begin near it. It is learned while
the event-free intervals of `event_bounds` are found, and again once it no longer answers for most of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels._struct import Struct
from rubhpc.kernels.friction_states import OPEN, state_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

N_PLACE = 32  # earlier spans, by their sets of states
N_INTERVAL = 6  # of a switch function
SHARE = 0.5  # of its value where it is bounded, which it stays above
LESS = 0.585  # below 2 - sqrt(2): |x + i y| is at most x + y less this times the smaller, x and y positive
MOST_FAILED = 4  # 2^4 spans pass at most until one is learned anew
N_SLOW = 8  # slow coordinates at most
SLOW = 0.25  # exponent times the duration, up to which a coordinate is slow
LONGER = 4  # a span that is compared lasts longer than the earlier one by its fourth part at most
RENEWED = 16  # a span is learned again after as many times the bounds that this takes,
EXCESS = 5  # those beyond the fewest counted as more
PER_SUM = 2  # sums that take as long as one bound
MANY = 2**31
IDLE, AWAITED, LEARNING, COMPARED = range(4)  # role of the span under way, or the next one
ROLE, PLACE, ENTERED, ASKED, REACH = range(5)  # of `EarlierSpans.now`
STATES, IS_LEARNED, TAKEN, WAITS, FAILED, LASTED, FEWEST, SPENT, IS_WEIGHED = range(
    9
)  # columns of `EarlierSpans.kept`


class EarlierSpans(Struct):
    """Spans of s sets of states, m coordinates and q pairs; s is 0 where none are wanted."""

    # Of the span under way, (5,): role, place, tick where it began, bounds found in it, ticks compared
    now: Ints
    # Of each earlier span, (s, 9): states, whether it is learned, bounds found then, spans to wait, failures
    # in succession, ticks it lasted, fewest bounds found in a span of these states, those spent since, and
    # whether `weight` and what follows it are filled
    kept: Ints
    begun: Floats  # (s, 2, m), coordinates with which each began
    growth: Floats  # (s,), by which no coordinate grows more
    n_interval: Ints  # (s, 2 q)
    interval: Ints  # (s, 2 q, N_INTERVAL, 2), ticks from its begin
    margin: Floats  # (s, 2 q, N_INTERVAL), what a switch function stays above in it
    weight: Floats  # (s, 2 q, m), what a unit difference of each coordinate changes a function by at most
    n_slow: Ints  # (s,), slow coordinates, which are taken together
    which: Ints  # (s, N_SLOW), their places
    slow: Floats  # (s, 2 q, 4, N_SLOW), coefficients of a function and of its rate, real and imaginary parts
    apart: Floats  # (2 q,), what functions of the span under way may differ by
    moved: Floats  # (m,), work space
    slowly: Floats  # (2, N_SLOW), likewise


def earlier_spans(m: int, q: int, n_place: int = N_PLACE) -> EarlierSpans:
    """Room for spans of m coordinates and q pairs."""
    return EarlierSpans(
        now=np.zeros(5, dtype=np.int64),
        kept=np.full((n_place, 9), -1, dtype=np.int64),
        begun=np.zeros((n_place, 2, m)),
        growth=np.ones(n_place),
        n_interval=np.zeros((n_place, 2 * q), dtype=np.int64),
        interval=np.zeros((n_place, 2 * q, N_INTERVAL, 2), dtype=np.int64),
        margin=np.zeros((n_place, 2 * q, N_INTERVAL)),
        weight=np.zeros((n_place, 2 * q, m)),
        n_slow=np.zeros(n_place, dtype=np.int64),
        which=np.zeros((n_place, N_SLOW), dtype=np.int64),
        slow=np.zeros((n_place, 2 * q, 4, N_SLOW)),
        apart=np.zeros(2 * q),
        moved=np.zeros(m),
        slowly=np.zeros((2, N_SLOW)),
    )


def no_earlier_spans() -> EarlierSpans:
    """Room for none."""
    return earlier_spans(0, 0, 0)


def forget_earlier(earlier: EarlierSpans) -> None:
    """Forget all spans: another case begins."""
    earlier.now[ROLE], earlier.kept[:, STATES] = IDLE, -1


@linked_sum
def go_on_without(earlier: EarlierSpans) -> None:
    """Go on in the middle of a span: it is not compared. One that has not begun may be."""
    if earlier.now[ROLE] != AWAITED:
        earlier.now[ROLE] = IDLE


@linked_sum
def is_watched(states: int, j: int) -> bool:
    """Whether switch function j of a set of states is one: an open pair has one alone."""
    return j % 2 == 0 or state_of(states, j // 2) != OPEN


@linked_sum
def begin_bounds(
    earlier: EarlierSpans,
    states: int,
    mode: int,
    switch_re: Floats,
    switch_im: Floats,
    rate_re: Floats,
    rate_im: Floats,
    pace: Floats,
    power_re: Floats,
    power_im: Floats,
    z_re: Floats,
    z_im: Floats,
    tick: int,
    length: float,
) -> bool:
    """Begin a span at a tick of a `length` (s), with coordinates (m,); whether it is compared with another.

    Tables are those of `ModeTables`.
    """
    n_place, now = earlier.kept.shape[0], earlier.now
    if n_place == 0 or now[ROLE] != AWAITED:
        return False
    place = (states ^ states >> 5 ^ states >> 10 ^ states >> 20 ^ states >> 40) % n_place
    kept = earlier.kept[place]
    if kept[STATES] != states:
        kept[:] = 0
        kept[STATES], kept[FEWEST] = states, MANY
    now[ROLE], now[PLACE], now[ENTERED], now[ASKED] = IDLE, place, tick, 0
    if kept[WAITS] > 0:
        kept[WAITS] -= 1
        return False
    if kept[IS_LEARNED] == 1:
        now[ROLE] = COMPARED
        now[REACH] = kept[LASTED] + kept[LASTED] // LONGER
        if kept[IS_WEIGHED] == 0:
            kept[IS_WEIGHED] = 1
            rows = switch_re[mode], switch_im[mode], rate_re[mode], rate_im[mode]
            weigh(earlier, rows, pace[mode], now[REACH] * length, z_re.size)
        compare(earlier, states, now[REACH] * length, z_re, z_im)
        return True
    now[ROLE] = LEARNING
    learn(earlier, power_re[mode], power_im[mode], z_re, z_im)
    return False


@linked_sum
def learn(earlier: EarlierSpans, power_re: Floats, power_im: Floats, z_re: Floats, z_im: Floats) -> None:
    """Begin a span that later ones are compared with."""
    place, last = earlier.now[PLACE], power_re.shape[0] - 1
    begun_re, begun_im = earlier.begun[place, 0], earlier.begun[place, 1]
    a_re, a_im, growth = power_re[last], power_im[last], 1.0
    for k in range(z_re.size):
        begun_re[k], begun_im[k] = z_re[k], z_im[k]
        x, y = abs(a_re[k]), abs(a_im[k])
        growth = max(growth, x + y - LESS * min(x, y))
    earlier.growth[place] = growth
    earlier.n_interval[place, :] = 0


@linked_sum
def weigh(
    earlier: EarlierSpans, rows: tuple[Floats, Floats, Floats, Floats], pace: Floats, time: float, m: int
) -> None:
    """Fill what m coordinates change switch functions by over a time, s, by their rows in the tables."""
    place, share, n = earlier.now[PLACE], earlier.moved[:m], 0
    re, im, turning_re, turning_im = rows
    growth, which = earlier.growth[place], earlier.which[place]
    for k in range(m):
        share[k], turned = growth, pace[k] * time
        if turned >= 0.0 and turned < SLOW and n < N_SLOW:
            share[k], which[n] = 0.5 * growth * turned * turned, k
            n += 1
    earlier.n_slow[place] = n
    for j in range(re.shape[0]):
        c_re, c_im = re[j], im[j]
        weight, slow = earlier.weight[place, j], earlier.slow[place, j]
        for k in range(m):
            x, y = abs(c_re[k]), abs(c_im[k])
            weight[k] = share[k] * (x + y - LESS * min(x, y))
        for i in range(n):
            k = which[i]
            slow[0, i], slow[1, i] = c_re[k], c_im[k]
            slow[2, i], slow[3, i] = turning_re[j, k], turning_im[j, k]


@linked_sum
def compare(earlier: EarlierSpans, states: int, time: float, z_re: Floats, z_im: Floats) -> None:
    """Fill what the switch functions may differ by from those of the earlier span over a time, s."""
    place, m = earlier.now[PLACE], z_re.size
    moved, slow_re, slow_im = earlier.moved[:m], earlier.slowly[0], earlier.slowly[1]
    begun_re, begun_im = earlier.begun[place, 0], earlier.begun[place, 1]
    for k in range(m):
        x, y = abs(z_re[k] - begun_re[k]), abs(z_im[k] - begun_im[k])
        moved[k] = x + y - LESS * min(x, y)
    n = earlier.n_slow[place]
    for i in range(n):
        k = earlier.which[place, i]
        slow_re[i], slow_im[i] = z_re[k] - begun_re[k], z_im[k] - begun_im[k]
    for j in range(earlier.apart.size):
        if is_watched(states, j):
            weight, slow = earlier.weight[place, j], earlier.slow[place, j]
            apart, value, rate = 0.0, 0.0, 0.0
            for k in range(m):
                apart += weight[k] * moved[k]
            for i in range(n):
                value += slow[0, i] * slow_re[i] - slow[1, i] * slow_im[i]
                rate += slow[2, i] * slow_re[i] - slow[3, i] * slow_im[i]
            earlier.apart[j] = apart + abs(value) + abs(rate) * time


@linked_sum
def known_until(earlier: EarlierSpans, j: int, tick: int) -> int:
    """Tick until which switch function j is positive, that is so until a tick; by the earlier span."""
    now = earlier.now
    place, begin = now[PLACE], now[ENTERED]
    until = tick - begin
    for i in range(earlier.n_interval[place, j]):
        first, last = earlier.interval[place, j, i, 0], min(earlier.interval[place, j, i, 1], now[REACH])
        if first <= until and until < last and earlier.margin[place, j, i] > earlier.apart[j]:
            until = last
    return int(begin + until)


@linked_sum
def note_interval(earlier: EarlierSpans, j: int, begin: int, end: int, most: int, margin: float) -> None:
    """Note that switch function j stays above a margin from one tick to another one, within `most` ticks."""
    place, entered = earlier.now[PLACE], earlier.now[ENTERED]
    i = earlier.n_interval[place, j]
    if i < earlier.margin.shape[2] and end > begin:
        earlier.interval[place, j, i, 0] = begin - entered
        earlier.interval[place, j, i, 1] = min(end - entered, most)
        earlier.margin[place, j, i] = margin
        earlier.n_interval[place, j] = i + 1


@linked_sum
def end_bounds(earlier: EarlierSpans, states: int, tick: int) -> None:
    """End the span under way by an event, and see whether what it was compared with still serves."""
    now = earlier.now
    if now[ROLE] == LEARNING:
        kept = earlier.kept[now[PLACE]]
        kept[IS_LEARNED], kept[TAKEN], kept[LASTED] = 1, now[ASKED], tick - now[ENTERED]
        kept[SPENT], kept[FEWEST], kept[IS_WEIGHED] = 0, min(kept[FEWEST], now[ASKED]), 0
    elif now[ROLE] == COMPARED:
        kept = earlier.kept[now[PLACE]]
        saved, n_sum = kept[TAKEN] - now[ASKED], 0
        for j in range(earlier.apart.size):
            n_sum += 1 if is_watched(states, j) else 0
        if PER_SUM * saved <= n_sum:
            kept[IS_LEARNED], kept[WAITS] = 0, (1 << kept[FAILED]) - 1
            kept[FAILED] = min(kept[FAILED] + 1, MOST_FAILED)
        else:
            kept[FAILED] = 0
        kept[FEWEST] = min(kept[FEWEST], now[ASKED])
        kept[SPENT] += now[ASKED] + EXCESS * (now[ASKED] - kept[FEWEST])
        if kept[SPENT] >= RENEWED * kept[TAKEN]:
            kept[IS_LEARNED] = 0
    now[ROLE] = AWAITED
