"""The collocation integrator: flights in closed form, steps with error control while a pair is closed."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum, linked_sum
from rubhpc.kernels.case_progress import (
    CONTACT_UNSOLVED,
    DIVERGED,
    FINISHED,
    MOST_STEPS,
    PAUSED,
    Clock,
    Progress,
)
from rubhpc.kernels.collocation.events import fill_events, first_event
from rubhpc.kernels.collocation.flight import GAP_TOLERANCE, LOST, fly
from rubhpc.kernels.collocation.impacts import (
    clear_impulses,
    coupling,
    find_forces,
    find_impulses,
    is_jammed,
    push_instant,
    see_rates,
    stop_opening,
    stop_slip,
)
from rubhpc.kernels.collocation.motions import list_closed, see_start
from rubhpc.kernels.collocation.newton import take_step
from rubhpc.kernels.collocation.observing import (
    Seen,
    Signals,
    fill_signals,
    record_flight,
    record_impulses,
    record_instant,
    record_step,
    value_at,
)
from rubhpc.kernels.collocation.structures import (
    BACKWARD,
    ENDLESS,
    FORWARD,
    FRICTION,
    JAMMED,
    MATRIX,
    NORMAL,
    OPEN,
    RATE,
    SINGULAR,
    SLIP,
    STICKING,
    UNCONVERGED,
    Bodies,
    CaseState,
    Memory,
    Nodes,
    Solution,
    Tables,
)
from rubhpc.kernels.collocation.tables import end_of_step, fill_step, within_step
from rubhpc.kernels.collocation.tangent import (
    Trail,
    carry_breakaway,
    carry_event,
    carry_freely,
    carry_step,
    make_up,
    note_event,
    note_least,
)
from rubhpc.kernels.laws import COULOMB, LAGRANGE

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Ints = NDArray[np.int64]

KNOWN, NEW, SETTLED = range(3)  # of a case that begins: forces and states; neither; states alone
STEPPING, TRYING, SETTLING = range(3)  # what is to be done next while a pair is closed
ALLOWED, RECORDED = 3.0, 0.1  # error of the forces of a step over the accuracy, before the record and in it
NEWTON = 0.03  # tolerance of the forces in Newton's method, over that of the steps
AVERAGED = 20e-6  # s: the error of a shorter step counts as that of its impulse over that time
BEGINNING = 1.0 / 125.0  # first step of a contact over the last contact of the pair
GROWING = 60.0  # steps are doubled where their error is so much less than the tolerance
LEAST_SCALE = 1e-3  # N, of forces
OPENED = 1e-3  # of the last contact: ticks after a release that are not looked at
MOST_AT_ONCE = 64  # events at one tick, and as many for each pair
UNDECIDED = 8  # events at one tick for each pair: friction on its bound then goes on for a shortest step
BRIEF = 512.0  # ticks: a closed pair does not part for less where another one touches
NO_SLIP = 1e-9  # m/s
MOST_WORK = 5e7  # of one call, in products of a step's loads with its coordinates, 0.2 s or so
PARTED = 1e-9  # of the rim's speed: gap rate above which a pair has parted in an impact


@linked_sum
def continue_forces(
    nodes: Nodes, part: float, ratio: float, state: Ints, force: Floats, weight: Floats, guess: Floats
) -> None:
    """Forces of the last step continued over one that begins after `part` of it and is `ratio` times as long.

    By their Legendre series, of one order less where the step is much longer.
    """
    s = nodes.at.size
    most = s if ratio < 1.5 else s - 1
    for j in range(s):
        x = 2.0 * (part + nodes.at[j] * ratio) - 1.0
        for k in range(s):
            weight[k] = 0.0
        before, now = 1.0, x
        for m in range(most):
            for k in range(s):
                weight[k] += before * nodes.legendre[m, k]
            later = ((2 * m + 3) * x * now - (m + 1) * before) / (m + 2)
            before, now = now, later
        for i in range(force.shape[0]):
            if state[i] != OPEN:
                for f in range(2):
                    total = 0.0
                    for k in range(s):
                        total += weight[k] * force[i, f, k]
                    guess[i, f, j] = total


@linked_sum
def hold_forces(force: Floats, guess: Floats) -> None:
    """Fill polynomials (q, 2, s) with constant forces (q, 2)."""
    for i in range(guess.shape[0]):
        for f in range(2):
            for k in range(guess.shape[2]):
                guess[i, f, k] = force[i, f]


@linked_sum
def error_of(
    bodies: Bodies,
    nodes: Nodes,
    state: Ints,
    before: Floats,
    guess: Floats,
    is_continued: bool,
    noise: float,
    solution: Solution,
) -> float:
    """Estimated error of the forces of a step, N: by their last coefficients, and the jump between steps.

    A force in a bore may be constant and turn: its components count too.
    """
    s, error = nodes.at.size, 0.0
    for i in range(state.size):
        if state[i] == OPEN:
            continue
        for f in range(2):
            last = 0.0
            for k in range(s):
                last += nodes.legendre[s - 1, k] * guess[i, f, k]
            error = max(error, 0.1 * abs(last))
            if is_continued:
                error = max(error, 0.5 * abs(guess[i, f, 0] - before[i, f, s - 1]))
        if bodies.radius[i] < 0.0:
            for a in range(2):
                last = 0.0
                for k in range(s):
                    last += nodes.legendre[s - 1, k] * guess[i, NORMAL, k] * solution.unit[i * s + k, a]
                error = max(error, 0.1 * abs(last))
    return max(0.0, error - 30.0 * noise)


@linked_sum
def any_closed(state: Ints) -> bool:
    """Whether a pair is closed."""
    is_any = False
    for i in range(state.size):
        is_any = is_any or state[i] != OPEN
    return is_any


@linked_sum
def slot_within(tables: Tables, length: float) -> int:
    """Slot of the longest step within a time, s."""
    slot = tables.is_filled.size - 1
    while slot > 0 and tables.tick * 2.0 ** (tables.first_level + slot) > length:
        slot -= 1
    return slot


@linked_sum
def take_event(
    bodies: Bodies,
    nodes: Nodes,
    tables: Tables,
    clock: Clock,
    pair: int,
    kind: int,
    acceleration: float,
    is_recorded: bool,
    accuracy: float,
    progress: Progress,
    memory: Memory,
    case: CaseState,
    solution: Solution,
    seen: Seen,
) -> None:
    """Take an event of a pair: its new state, impulses, and the pairs that may then stick (`waiting`)."""
    s, state, x = nodes.at.size, case.state, case.x
    see_start(bodies, x, solution)
    was_alone = True
    for i in range(state.size):
        was_alone = was_alone and (state[i] == OPEN or i == pair)
        solution.waiting[i] = False
    lowest, top = int(np.int64(0)), tables.is_filled.size - 1
    if state[pair] == OPEN:
        state[pair] = FORWARD
        solution.waiting[pair] = bodies.may_stick
        case.since[pair] = progress.tick
        if was_alone:
            memory.scale = LEAST_SCALE
        if is_recorded:
            seen.measured.accumulator.n_contact[pair] += 1
        if bodies.normal_law[pair] == LAGRANGE:
            strike(
                bodies,
                nodes,
                clock,
                pair,
                acceleration,
                is_recorded,
                accuracy,
                progress,
                memory,
                case,
                solution,
                seen,
            )
        memory.slot = lowest
        if case.lasting[pair] > 0.0:
            memory.slot = slot_within(tables, BEGINNING * case.lasting[pair])
    elif kind == NORMAL:
        state[pair] = OPEN
        if bodies.normal_law[pair] == LAGRANGE:
            stop_opening(bodies, s, pair, solution, x)
        case.lasting[pair] = (progress.tick - case.since[pair]) * clock.tick
        case.since[pair] = progress.tick
        memory.unseen = max(1 << tables.first_level, int(OPENED * case.lasting[pair] / clock.tick))
        memory.slot = max(memory.slot - 3, lowest)
    elif state[pair] == STICKING:
        sense = value_at(nodes, case.force[pair, FRICTION], memory.part)
        state[pair] = FORWARD if sense > 0.0 else BACKWARD
        stop_slip(bodies, s, pair, solution, x)
        memory.slot = max(memory.slot - 4, lowest)
    else:
        solution.waiting[pair] = True
        state[pair] = STICKING
        stop_slip(bodies, s, pair, solution, x)
        memory.slot = max(memory.slot - 4, lowest)
    memory.slot = min(memory.slot, top)


@linked_sum
def strike(
    bodies: Bodies,
    nodes: Nodes,
    clock: Clock,
    pair: int,
    acceleration: float,
    is_recorded: bool,
    accuracy: float,
    progress: Progress,
    memory: Memory,
    case: CaseState,
    solution: Solution,
    seen: Seen,
) -> None:
    """Take the impact of a hard pair that touches, with the impulses of the closed ones.

    Rebounds end where no flight is seen: below a share, the accuracy, of the fastest approach, or within a
    few ticks or the tolerance of gaps.
    """
    state, s = case.state, nodes.at.size
    see_rates(bodies, s, pair, solution)
    approach = -solution.seen[pair * s, RATE]
    memory.fastest = max(memory.fastest, approach)
    unseen = max(4.0 * clock.tick * acceleration, 4.0 * math.sqrt(2.0 * GAP_TOLERANCE * acceleration))
    least = max(accuracy * memory.fastest, unseen)
    memory.least, memory.has_impulses = least, 1
    for i in range(state.size):
        solution.kept[i] = state[i] != OPEN and i != pair and bodies.normal_law[i] == LAGRANGE
        solution.touching[i] = solution.kept[i] or i == pair
        solution.bound[i] = False
    find_impulses(bodies, s, solution.touching, solution.kept, solution.bound, least, solution)
    if bind_pairs(bodies, nodes, clock, accuracy, progress, memory, case, solution):
        find_impulses(bodies, s, solution.touching, solution.kept, solution.bound, least, solution)
    push_instant(bodies, s, solution.impulse, solution, case.x)
    see_start(bodies, case.x, solution)
    for i in range(state.size):
        if not solution.touching[i]:
            continue
        see_rates(bodies, s, i, solution)
        may_rebound = bodies.restitution[i] > 0.0 and not solution.kept[i]  # what was closed and is hit stays
        if not solution.bound[i] and (solution.impulse[i, NORMAL] == 0.0 or may_rebound):
            rate = solution.seen[i * s, RATE]
            if rate > PARTED * (bodies.rim_speed[i] + approach) + 1e-12:
                state[i], solution.waiting[i] = OPEN, False
                case.lasting[i] = (progress.tick - case.since[i]) * clock.tick
                case.since[i] = progress.tick
                memory.unseen = 1
                continue
        state[i] = FORWARD if not solution.kept[i] else state[i]
        solution.waiting[i] = bodies.may_stick
    if is_recorded:
        record_impulses(bodies, s, clock, progress, solution, seen)


@linked_sum
def bind_pairs(
    bodies: Bodies,
    nodes: Nodes,
    clock: Clock,
    accuracy: float,
    progress: Progress,
    memory: Memory,
    case: CaseState,
    solution: Solution,
) -> bool:
    """Mark the closed pairs that an impact of another one opens, but their forces close again at once.

    Pairs that throw each other open would touch without end.
    """
    s, is_any = nodes.at.size, False
    for i in range(bodies.radius.size):
        if not solution.kept[i] or solution.impulse[i, NORMAL] > 0.0:
            continue
        rate = 0.0
        for j in range(bodies.radius.size):
            if solution.impulse[j, NORMAL] != 0.0 or solution.impulse[j, FRICTION] != 0.0:
                n, t = solution.impulse[j, NORMAL], solution.impulse[j, FRICTION]
                rate += coupling(bodies, solution.normal, i * s, i, solution.normal, j * s, j) * n
                rate += coupling(bodies, solution.normal, i * s, i, solution.tangent, j * s, j) * t
        own = coupling(bodies, solution.normal, i * s, i, solution.normal, i * s, i)
        pressed = own * max(
            0.0, value_at(nodes, case.force[i, NORMAL], memory.part if memory.length > 0 else 0.0)
        )
        brief = max(
            BRIEF * clock.tick, accuracy * max(case.lasting[i], (progress.tick - case.since[i]) * clock.tick)
        )
        solution.bound[i] = 2.0 * rate <= pressed * brief
        is_any = is_any or solution.bound[i]
    return is_any


@linked_sum
def acceleration_of(nodes: Nodes, step: float, seen: Floats) -> float:
    """Largest mean acceleration (m/s2) of a gap in a step, from its rates at the nodes."""
    largest = 0.0
    for k in range(1, nodes.at.size):
        largest = max(largest, abs(seen[k, RATE] - seen[0, RATE]) / (nodes.at[k] * step))
    return largest


@linked_sum
def begin_trial(bodies: Bodies, s: int, i: int, is_still: bool, case: CaseState, solution: Solution) -> int:
    """Return the state that is tried first for a pair that may stick."""
    see_start(bodies, case.x, solution)
    see_rates(bodies, s, i, solution)
    slip = solution.seen[i * s, SLIP]
    if abs(slip) > NO_SLIP and not is_still:
        return FORWARD if slip > 0.0 else BACKWARD
    return STICKING


@linked_sum
def why_forceless(bodies: Bodies, s: int, state: Ints, solution: Solution) -> int:
    """Find the forces `instant` at the local motions `start`; returns why there are none, or 0."""
    if not find_forces(bodies, s, state, solution, solution.instant):
        return SINGULAR
    for i in range(state.size):
        if is_jammed(bodies, s, i, state[i], solution):
            return JAMMED
    return 0


@linked_sum
def is_diverged(bodies: Bodies, x: Floats) -> bool:
    """Whether a displacement passes the limit or is NaN."""
    for r in range(bodies.translations.shape[0]):
        row, total = bodies.translations[r], 0.0
        for k in range(x.size):
            total += row[k] * x[k]
        if not abs(total) <= bodies.displacement_limit:
            return True
    return False


@jit_sum
def advance_by_collocation(
    bodies: Bodies,
    nodes: Nodes,
    tables: Tables,
    signals: Signals,
    power: Complexes,
    clock: Clock,
    accuracy: float,
    last_tick: int,
    is_recorded: bool,
    progress: Progress,
    memory: Memory,
    case: CaseState,
    solution: Solution,
    seen: Seen,
    trail: Trail | None,
) -> int:
    """Advance a case from the tick reached to `last_tick`.

    `power` (levels, nm) are the exponentials of the modes over 2^level ticks; a trail keeps tangent and
    events. Returns an outcome of `case_progress`.
    """
    s, x, state, after = nodes.at.size, case.x, case.state, solution.after
    n_x, top = x.size, tables.is_filled.size - 1
    allowed = (RECORDED if is_recorded else ALLOWED) * accuracy
    work = float(n_x * s * bodies.load.shape[0])
    if trail is not None:
        work *= 1 + trail.columns.shape[1]
    last_step = progress.n_step + max(min(MOST_STEPS, int(MOST_WORK / work)), 1)
    todo, pair, kind, acceleration = STEPPING, -1, NORMAL, 0.0
    tried, attempt, first_tried, is_still = STICKING, 0, STICKING, False
    trial = int(np.int64(-1))
    if memory.is_new != KNOWN and any_closed(state):
        for i in range(state.size):
            solution.waiting[i] = memory.is_new == NEW and bodies.may_stick and state[i] != OPEN
        todo = TRYING
    memory.is_new = KNOWN
    while True:
        if todo == SETTLING:  # constants to begin with
            if trail is not None and pair >= 0:
                is_release = kind == NORMAL and trail.state[pair] != OPEN
                is_carried = True
                if kind == FRICTION and trail.state[pair] == STICKING:
                    is_carried = carry_breakaway(bodies, s, pair, solution, trail)
                elif not is_release:
                    is_carried = carry_event(
                        bodies,
                        s,
                        pair,
                        kind,
                        memory.least,
                        memory.has_impulses == 1,
                        solution,
                        trail,
                    )
                if not is_carried:
                    memory.why = SINGULAR
                    return CONTACT_UNSOLVED
                approach = (
                    np.nan if kind == FRICTION or is_release else trail.approach[trail.approach.size - 1]
                )
                note_event(pair, kind, trail.state[pair], state[pair], progress.tick, approach, trail)
            see_start(bodies, x, solution)
            memory.why = why_forceless(bodies, s, state, solution)
            if memory.why != 0:
                return CONTACT_UNSOLVED
            hold_forces(solution.instant, case.force)
            memory.length, todo = 0, STEPPING
        if todo == STEPPING:
            if progress.tick >= last_tick:
                break
            if progress.n_step > last_step:
                return PAUSED
        if todo == STEPPING and not any_closed(state):
            begun = progress.tick
            if is_recorded:
                for k in range(n_x):
                    seen.begun[k] = x[k]
            tick, pair, acceleration, n_look = fly(
                bodies, power, s, clock.tick, begun, last_tick, memory.unseen, case, solution
            )
            memory.unseen = 0
            progress.n_step += n_look
            if is_recorded:
                record_flight(bodies, signals, power, clock, begun, tick, x, progress, seen)
            if trail is not None:
                for k in range(bodies.exponent.size):
                    solution.turn[k] = np.exp(bodies.exponent[k] * ((tick - begun) * clock.tick))
                carry_freely(bodies.n_complex, solution.turn, trail)
            progress.tick, kind = tick, NORMAL
            if pair == LOST:
                memory.why = ENDLESS
                return DIVERGED if is_diverged(bodies, x) else CONTACT_UNSOLVED
            if pair < 0:
                continue
        else:
            slot = memory.slot
            if todo == TRYING:
                if trial < 0:
                    for i in range(state.size):
                        if solution.waiting[i]:
                            trial = i
                            break
                    if trial < 0:
                        todo = SETTLING
                        continue
                    tried = begin_trial(bodies, s, trial, is_still, case, solution)
                    first_tried, attempt = tried, 0
                state[trial], slot = tried, 0
                see_start(bodies, x, solution)
                memory.why = why_forceless(bodies, s, state, solution)
                if memory.why != 0:
                    return CONTACT_UNSOLVED
                hold_forces(solution.instant, solution.guess)
            else:
                left = last_tick - progress.tick
                while slot > 0 and 1 << (tables.first_level + slot) > 2 * left:
                    slot -= 1
                if memory.length > 0:
                    ratio = (1 << (tables.first_level + slot)) / memory.length
                    continue_forces(
                        nodes, memory.part, ratio, state, case.force, solution.weight, solution.guess
                    )
                else:
                    solution.guess[:] = case.force
            if not tables.is_filled[slot]:
                fill_step(bodies, nodes, tables, slot)
            step = tables.tick * 2.0 ** (tables.first_level + slot)
            is_exact = trail is not None and trail.columns.shape[1] > 0 and todo == STEPPING
            is_whole = is_recorded or bodies.may_stick or is_exact or state.size > 1
            n_iteration = take_step(
                bodies,
                nodes,
                tables,
                slot,
                x,
                state,
                solution.guess,
                NEWTON * accuracy * memory.scale,
                is_whole,
                is_exact,
                solution,
            )
            progress.n_step += 1
            if todo == TRYING:
                solution.waiting[trial] = False
                if n_iteration < 0:
                    memory.why = UNCONVERGED
                    return CONTACT_UNSOLVED
                fill_events(bodies, nodes, state, solution.guess, accuracy, solution)
                pressed, held, along = 0.0, 0.0, 0.0
                for k in range(s):
                    weight = nodes.integral[s - 1, k]
                    pressed += weight * solution.event[trial, NORMAL, k]
                    if (
                        is_still
                        and trial == pair
                        and tried == STICKING
                        and bodies.law.friction_law == COULOMB
                    ):
                        bound = bodies.friction[trial] * solution.guess[trial, NORMAL, k]
                        held += weight * (bound - abs(solution.guess[trial, FRICTION, k]))  # it slid before
                    else:
                        held += weight * solution.event[trial, FRICTION, k]
                    along += weight * solution.guess[trial, FRICTION, k]
                if pressed < 0.0:
                    state[trial], case.since[trial] = OPEN, progress.tick
                    memory.unseen, trial = 1 << tables.first_level, -1
                elif held >= 0.0 or attempt >= 3:
                    trial = -1
                elif tried == STICKING:
                    tried = FORWARD if along > 0.0 else BACKWARD
                    attempt += 1
                    solution.waiting[trial] = True
                elif attempt > 1 or first_tried == STICKING:
                    trial = -1
                else:
                    tried = STICKING
                    attempt += 1
                    solution.waiting[trial] = True
                continue
            error, largest = 0.0, memory.scale
            if is_recorded:
                pivots = seen.measured.accumulator.pivots
                pivots[0] = max(pivots[0], abs(n_iteration))
            if n_iteration > 0:
                is_continued = memory.length > 0 and memory.part == 1.0
                error = error_of(
                    bodies,
                    nodes,
                    state,
                    case.force,
                    solution.guess,
                    is_continued,
                    solution.noise[solution.used[MATRIX]],
                    solution,
                )
                error *= min(1.0, step / AVERAGED)
                for i in range(state.size):
                    if state[i] != OPEN:
                        for k in range(s):
                            largest = max(largest, abs(solution.guess[i, NORMAL, k]))
            if n_iteration < 0 or error > allowed * largest:
                if slot > 0:
                    memory.slot = slot - 1
                    if n_iteration < 0:
                        memory.length = 0
                    continue
                if n_iteration < 0:
                    see_start(bodies, x, solution)
                    why = why_forceless(bodies, s, state, solution)
                    memory.why = UNCONVERGED if why == 0 else why
                    return CONTACT_UNSOLVED
            fill_events(bodies, nodes, state, solution.guess, accuracy, solution)
            place, pair, kind = first_event(bodies, nodes, step, state, solution)
            if pair >= 0 and memory.length == 0 and slot > 0:  # so soon after another event
                memory.slot = slot - 1
                continue
            whole = 1 << (tables.first_level + slot)
            taken = whole
            if place <= 1.0:
                taken = int(place * whole + 0.5)
                if state[pair] == OPEN:
                    acceleration = acceleration_of(nodes, step, solution.seen[pair * s : pair * s + s])
                    if solution.seen[pair * s, RATE] > 0.0:
                        # Neither at once, nor faster than it has left: such rebounds have no end.
                        taken = max(int(place * whole), 1)
            else:
                pair = -1
            if taken == 0 and memory.n_at_once > UNDECIDED * state.size and pair >= 0:
                taken, pair = whole, -1
                memory.n_at_once = 0
            if progress.tick + taken > last_tick:
                taken, pair = last_tick - progress.tick, -1
            if taken > 0:
                if is_recorded:
                    if not signals.is_filled[slot]:
                        fill_signals(bodies, nodes, tables, signals, slot)
                    n_closed = list_closed(bodies, nodes, state, solution)[0]
                    record_step(
                        bodies,
                        nodes,
                        tables,
                        signals,
                        slot,
                        clock,
                        taken,
                        state,
                        solution.guess,
                        n_closed,
                        x,
                        progress,
                        solution,
                        seen,
                    )
                if trail is not None:
                    carry_step(
                        bodies,
                        nodes,
                        tables,
                        slot,
                        taken / whole,
                        state,
                        solution.guess,
                        solution,
                        trail,
                    )
                    note_least(nodes, taken / whole, allowed * largest, state, solution.guess, trail)
                if taken == whole:
                    end_of_step(bodies, tables, slot, x, solution.load, after)
                else:
                    within_step(bodies, nodes, step, taken / whole, x, solution.load, solution.turn, after)
                for k in range(n_x):
                    x[k] = after[k]
                progress.tick += taken
                case.force[:] = solution.guess
                memory.scale, memory.length, memory.part = (
                    max(LEAST_SCALE, 0.999 * largest),
                    whole,
                    taken / whole,
                )
                memory.slot = slot
                if taken == whole and error < allowed * largest / GROWING and slot < top:
                    memory.slot = slot + 1
            if pair < 0:
                if is_diverged(bodies, x):
                    return DIVERGED
                continue
        if progress.tick == memory.event_tick:
            memory.n_at_once += 1
            if memory.n_at_once > MOST_AT_ONCE * (1 + state.size):
                memory.why = ENDLESS
                return CONTACT_UNSOLVED
        else:
            memory.event_tick, memory.n_at_once = progress.tick, 0
        progress.n_event += 1
        is_still = kind == FRICTION
        memory.has_impulses = 0
        if trail is not None:
            for k in range(n_x):
                trail.before[k] = x[k]
            for i in range(state.size):
                trail.state[i] = state[i]
            see_start(bodies, x, solution)
            see_rates(bodies, s, pair, solution)
            trail.approach[trail.approach.size - 1] = -solution.seen[pair * s, RATE]
        clear_impulses(solution.impulse)
        take_event(
            bodies,
            nodes,
            tables,
            clock,
            pair,
            kind,
            acceleration,
            is_recorded,
            accuracy,
            progress,
            memory,
            case,
            solution,
            seen,
        )
        todo, trial = TRYING, -1
    if trail is not None and not make_up(bodies, s, x, state, solution, trail):
        memory.why = SINGULAR
        return CONTACT_UNSOLVED
    is_last = progress.tick == clock.n_sample << clock.sample_level
    if is_recorded and is_last and progress.tick == progress.next_sample << clock.sample_level:
        see_start(bodies, x, solution)
        if not find_forces(bodies, s, state, solution, solution.instant):
            memory.why = SINGULAR
            return CONTACT_UNSOLVED
        fill_instant_load(bodies, s, solution)
        record_instant(bodies, signals, clock, case.force, x, progress, seen, solution.begun)
    return FINISHED


@linked_sum
def fill_instant_load(bodies: Bodies, s: int, solution: Solution) -> None:
    """Fill the first R of `begun` with the loads of the forces `instant`."""
    n_local = bodies.n_local
    for i in range(bodies.radius.size):
        n, t = solution.instant[i, NORMAL], solution.instant[i, FRICTION]
        for a in range(n_local):
            solution.begun[i * n_local + a] = n * solution.normal[i * s, a] + t * solution.tangent[i * s, a]
