"""Rubs in all degrees of freedom with any gap and any law, by dyadic time stepping: a code of its own.

Matrices come from `reference_bodies`. In a step contact forces are constant and act along the directions in
its middle; the motion under them is the exponential of the whole system. Gap, slip and law are met by

    hard     gap rate = (gap at the touch - gap) / fade at the end, and N >= 0
    springs  N = f(gap, gap rate), both the means of the ends
    stick    slip = 0 at the end, |T| <= mu_s N
    slide    T = +-mu(mean slip) N

pair by pair until nothing changes (non-smooth contact dynamics). Time is counted in ticks, steps are dyadic.
A step in which a pair would touch, lift, stick or slide anew is halved down to one tick, so that nothing but
the tick and the squared step is left of errors. Hard pairs that touch exchange impulses: Newton's restitution
and Coulomb's cone. `solve` runs two steps; the difference of both is the error of the coarser.
"""

from __future__ import annotations

import math

import numpy as np
import scipy.linalg
from numba import njit
from reference_bodies import set_up

MEAN_TIME = 20e-6  # s, of the peak force
OPEN, FORWARD, BACKWARD, STUCK = range(4)
HARD, PENALTY, HERTZ = range(3)
SLIDING, COULOMB, STRIBECK, TABLE = range(4)
FINEST = 11  # ticks are this many halvings of a step in contact
SHORTEST = 256  # ticks: a pair that has flown for less does not rebound
REST = 1e-5  # of the fastest touch: below it a pair that is hit stays closed
IMPACT = 1e-7  # s, for which the forces of closed pairs resist what the impact of another does to them
UNSEEN = 1e-15  # m, an overlap that is no touch yet


def solve(rig, case, longest_step=0.1e-6):
    """Return samples and measures of a case by their names in a record, and `error` of each.

    Parameters
    ----------
    case : dict
        Arguments of `rubhpc.simulate` in SI units: `speed` or `speed_ratio`, `clearance`, `friction`, the
        laws, `normal`, `revolutions`, `samples_per_revolution`. The case starts from rest.
    longest_step : float
        s, of contact, in the coarser of two runs.
    """
    coarse, fine = (run(rig, case, step) for step in (longest_step, longest_step / 2))
    error = {}
    for name in fine:
        size = np.abs(fine[name]).max(initial=0.0)
        error[name] = float(np.abs(fine[name] - coarse[name]).max(initial=0.0) / size) if size else 0.0
    return fine | {"error": error}


def run(rig, case, longest_step):
    """Return samples and measures with one step, which is at most `longest_step` (s) in contact."""
    spin = case["speed"] if "speed" in case else case["speed_ratio"] * first_lateral_frequency(rig)
    bodies = set_up(rig, spin)
    offset = [stator.clearance_offset for stator in rig.stator]
    radius = np.array([rig.contact_radius(stator) for stator in rig.stator])
    angle = np.array([stator.angle for stator in rig.stator])
    clearance = case["clearance"] + np.array(offset)
    roundness = np.where([stator.is_bore for stator in rig.stator], -clearance, radius)
    return march_bodies(bodies, spin, case, radius, angle, clearance, roundness, longest_step)


def first_lateral_frequency(rig):
    """Of the rotor at standstill, rad/s."""
    bodies = set_up(rig, 0.0)
    n = 4 * (sum(section.elements for section in rig.rotor.shaft) + 1)
    return math.sqrt(scipy.linalg.eigvalsh(bodies.stiffness[:n, :n], bodies.mass[:n, :n])[0])


def pair_rows(bodies, radius, angle):
    """Motions of each pair over all degrees, (q, m, n).

    Of the tip relative to the disc's centre along the stator and across; the rim's turn; then amplitudes
    whose squares add to twice the retreat of a bent tip.
    """
    n = len(bodies.mass)
    shapes = []
    for slope in bodies.slopes:
        if slope is None:
            shapes.append(np.zeros((0, n)))
            continue
        value, vector = np.linalg.eigh(slope)
        kept = value > 1e-13 * value[-1]
        shapes.append(np.sqrt(value[kept])[:, None] * vector[:, kept].T)
    rows = np.zeros((len(angle), 3 + max(len(shape) for shape in shapes), n))
    for row, shape, of, r, a in zip(rows, shapes, bodies.rows, radius, angle, strict=True):
        c, s = math.cos(a), math.sin(a)
        for i, line in enumerate(([-c, -s, 0, 1, 0], [s, -c, 0, 0, 1], [0, 0, r, 0, 0])):
            row[i, of[of >= 0]] = np.array(line)[of >= 0]
        row[3 : 3 + len(shape)] = shape
    return rows


def march_bodies(bodies, spin, case, radius, angle, clearance, roundness, longest_step):
    """March from equilibrium, and measure."""
    n, q = len(bodies.mass), len(radius)
    revolutions, per_revolution = case["revolutions"], case.get("samples_per_revolution", 64)
    n_sample = revolutions * per_revolution
    interval = 2 * math.pi / abs(spin) / per_revolution
    halved = max(2, math.ceil(math.log2(interval / longest_step)))  # intervals, to steps of contact
    lengths = interval / 2.0 ** np.arange(halved + FINEST, -1, -1)
    laws, table = read_laws(case, fade=lengths[FINEST] / 2)

    inverse = np.linalg.inv(bodies.mass)
    system = np.zeros((2 * n, 2 * n))
    system[:n, n:] = np.eye(n)
    system[n:] = -inverse @ np.hstack([bodies.stiffness, bodies.damping])
    exponent, shape = np.linalg.eig(system)
    enter = np.linalg.inv(shape)
    assert np.abs(shape @ np.diag(exponent) @ enter - system).max() < 1e-8 * np.abs(system).max()
    turning = bodies.stiffness - spin**2 * bodies.mass + 1j * spin * bodies.damping
    whirl = np.linalg.solve(turning, bodies.unbalance[0] - 1j * bodies.unbalance[1])
    whirl = np.concatenate([whirl, 1j * spin * whirl])
    rows = pair_rows(bodies, radius, angle)
    m = rows.shape[1]
    sag, still = at_rest(bodies, rows, roundness, clearance, laws)
    z = enter @ (np.concatenate([still - sag, np.zeros(n)]) - whirl.real)

    rows = rows.reshape(q * m, n)
    load = enter[:, n:] @ inverse @ rows.T  # rates of the modes from loads on the motions of pairs
    size = np.abs(load).max(axis=1)
    moves = (size > 1e-13 * size.max()) | (np.abs(z) > 1e-13 * np.abs(z).max())
    kept = (exponent.imag >= 0) & moves  # the others are their conjugates, or never move
    exponent, z, load = exponent[kept], z[kept], load[kept]
    shape = shape[:, kept] * np.where(exponent.imag > 0, 2.0, 1.0)

    def real(of):
        return np.ascontiguousarray(np.hstack([of.real, -of.imag]))

    look = np.array([real(rows @ of) for of in (shape[:n], shape[n:])])
    decay = np.exp(np.outer(lengths, exponent))
    kicks = [(np.expm1(exponent * t) / exponent)[:, None] * load for t in lengths[: FINEST + 1]]
    kicks = np.array([np.vstack([kick.real, kick.imag]) for kick in (*kicks, load)])  # the last of impulses
    answer = (look[:, None] @ kicks).reshape(2, -1, q, m, q, m).transpose(0, 1, 2, 4, 3, 5).copy()
    steady = np.array([rows @ whirl[:n], rows @ sag, rows @ whirl[n:]])
    bins, states = np.zeros((q, n_sample * 2**halved)), np.zeros((n_sample + 1, 2 * len(exponent)))
    late = np.zeros(bins.shape, np.float32)  # how far into its bin an impulse is
    sums = np.zeros((4, q))
    converged = march(
        np.concatenate([z.real, z.imag]),
        (states, bins, late, sums),
        (decay.real.copy(), decay.imag.copy(), kicks, answer, look, np.abs(rows @ shape[n:]), steady),
        (roundness, clearance, abs(spin) * radius),
        (np.sign(spin), lengths, per_revolution),
        laws,
        table,
    )
    assert converged, "the contact problem did not converge"
    turns = np.exp(1j * np.sign(spin) * 2 * math.pi * np.arange(n_sample + 1) / per_revolution)
    motion = states @ real(shape).T + np.outer(turns, whirl).real
    of = np.concatenate([bodies.output, *bodies.rows[:, 3:].T])
    signals = np.where(of >= 0, (motion[:, :n] + sag)[:-1, of], 0.0).T
    contact, stick, friction, contacts = sums
    return {
        "vertical": signals[0],
        "horizontal": signals[1],
        "torsion": signals[2],
        "stator_axial": signals[3 : 3 + q],
        "stator_lateral": signals[3 + q :],
        "contact_force": bins.reshape(q, n_sample, -1).sum(axis=2) / interval,
        "peak_contact_force": peak(bins, late, lengths[FINEST]),
        "contact_impulse": bins.sum(axis=1) / revolutions,
        "contact_fraction": contact / (n_sample * interval),
        "stick_fraction": stick / np.maximum(contact, 1e-300),
        "friction_work": friction / revolutions,
        "contacts_per_revolution": contacts / revolutions,
    }


def at_rest(bodies, rows, radius, clearance, laws):
    """Where loads hold the shaft, and where they do with stators that it rests on without friction; (n,)."""
    sag = np.linalg.solve(bodies.stiffness, bodies.weight)
    give = np.linalg.solve(bodies.stiffness, rows.reshape(-1, rows.shape[-1]).T)
    give = give.reshape(-1, *rows.shape[:2]).transpose(1, 0, 2)  # (q, n, m)
    force, pressed, along = np.zeros(len(rows)), np.zeros((len(rows), len(sag))), np.zeros((2, rows.shape[1]))
    power = {HARD: 1.0, PENALTY: 1.0, HERTZ: 1.5}[laws[0]]
    for _ in range(3000):
        for i, row in enumerate(rows):
            gap = look_at(row @ (sag + pressed.sum(axis=0)), radius[i], clearance[i], laws, 1.0, *along)
            held = (force[i] / laws[1]) ** (1 / power) if laws[0] != HARD else 0.0
            slope = along[0] @ row @ give[i] @ along[0]
            slope += held / (power * force[i]) if held else 0.0
            force[i] = max(0.0, force[i] - 0.5 * (gap + held) / slope)
            pressed[i] = force[i] * (give[i] @ along[0])
        if not force.any():
            break
    return sag, sag + pressed.sum(axis=0)


def read_laws(case, fade):
    """Numbers of the laws, and of a friction table (2, n): slip speeds and coefficients."""
    mu, names = case["friction"], ("sliding", "coulomb", "stribeck", "table")
    laws = (
        {"lagrange": HARD, "penalty": PENALTY, "hertz": HERTZ}[case.get("law", "lagrange")],
        case.get("stiffness", 0.0),
        case.get("damping", 0.0),
        case.get("restitution", 0.0),
        names.index(case.get("friction_law", "sliding")),
        mu,
        mu * case.get("static_friction_ratio", 1.0),
        case.get("stribeck_speed", 1.0),
        fade,
        case.get("normal", "fixed") == "updated",
    )
    table = case.get("slip_speed", (0.0,)), mu * np.array(case.get("friction_ratio", (1.0,)))
    return np.array(laws, dtype=float), np.array(table)


def peak(bins, late, width):
    """Largest mean over 20 us that begins with a bin or the impulse in it (`late`), or ends with a bin."""
    span = MEAN_TIME / width
    padded = np.pad(bins, ((0, 0), (math.ceil(span) + 2,) * 2))
    until = np.pad(np.cumsum(padded, axis=1), ((0, 0), (1, 0)))
    first = np.arange(bins.shape[1]) + math.ceil(span) + 2
    largest = np.zeros(len(bins))
    for i, impulse in enumerate(until):
        at = np.arange(len(impulse))
        begun = np.interp(first + late[i] + span, at, impulse) - impulse[first]
        ended = impulse[first] - np.interp(first - span, at, impulse)
        largest[i] = max(begun.max(), ended.max()) / MEAN_TIME
    return largest


@njit(cache=True)
def look_at(x, radius, clearance, laws, sense, along, across):
    """Gap, and its gradient and that of the tip's advance along the rim in the motions of a pair.

    A bore has the radius minus its clearance: `x` is the motion of its centre relative to the rim's.
    """
    is_round = laws[9] > 0.0
    back, side = clearance + x[0], x[1]
    for k in range(3, x.size):
        back += 0.5 * x[k] ** 2
    c, s, gap = 1.0, 0.0, back
    if is_round:
        distance = math.hypot(radius + back, side)
        if radius < 0.0:
            back += 1e-30 * (distance == 0.0)
            distance = -max(distance, 1e-30)
        gap = ((2.0 * radius + back) * back + side**2) / (distance + radius)
        c, s = (radius + back) / distance, side / distance
    along[0], along[1], along[2] = c, s, 0.0
    across[0], across[1], across[2] = -s * sense, c * sense, -sense
    for k in range(3, x.size):
        along[k], across[k] = c * x[k], -s * sense * x[k]
    return gap


@njit(cache=True)
def spring(gap, rate, laws):
    """Normal force of a spring, and its slopes with gap and rate."""
    k, c = laws[1], laws[2]
    if laws[0] == PENALTY:
        force, by_gap, by_rate = -k * gap - c * rate, -k, -c
    else:
        root = math.sqrt(max(-gap, 0.0))
        elastic = -k * gap * root
        force = elastic * (1.0 - c * rate)
        by_gap, by_rate = -1.5 * k * root * (1.0 - c * rate), -c * elastic
    if force <= 0.0:
        return 0.0, 0.0, 0.0
    return force, by_gap, by_rate


@njit(cache=True)
def coefficient(slip, laws, table):
    """Of friction while sliding."""
    if laws[4] == STRIBECK:
        return laws[5] + (laws[6] - laws[5]) * math.exp(-abs(slip) / laws[7])
    if laws[4] == TABLE:
        return np.interp(abs(slip), table[0], table[1])
    return laws[5]


@njit(cache=True)
def see(x, v, pair, laws, sense, along, across):
    """Gap, its rate and the slip of a pair; fills its directions."""
    radius, clearance, rim = pair
    gap = look_at(x, radius, clearance, laws, sense, along, across)
    return gap, along @ v, rim - across @ v


@njit(cache=True)
def solve_pairs(active, rested, x, v, before, n_dir, t_dir, by_x, by_v, dt, given, sense, laws, table, out):
    """Forces (or impulses, dt = 0) of the active pairs from their motions without them; False if none.

    `before`: gap, slip, gap at the touch, and gap rate (in an impact the one that it leaves).
    `out`: normal, tangent, state, and whether a spring is slack at the end.
    """
    q, m = x.shape
    normal, tangent, state, slack = out
    al, ac, px, pv, unit = np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m), np.zeros((4, q, q, m))
    for i in range(q):
        for j in range(q):
            if active[i] and active[j]:
                unit[0, i, j], unit[1, i, j] = by_x[i, j] @ n_dir[j], by_x[i, j] @ t_dir[j]
                unit[2, i, j], unit[3, i, j] = by_v[i, j] @ n_dir[j], by_v[i, j] @ t_dir[j]
    for _ in range(2000):
        change, size, noise = 0.0, 0.0, 0.0
        for i in range(q):
            if not active[i]:
                continue
            px[:], pv[:] = x[i], v[i]
            for j in range(q):
                if active[j]:
                    px += unit[0, i, j] * normal[j] + unit[1, i, j] * tangent[j]
                    pv += unit[2, i, j] * normal[j] + unit[3, i, j] * tangent[j]
            gap, rate, slip = see(px, pv, (given[0][i], given[1][i], given[2][i]), laws, sense, al, ac)
            gn, gt, rn, rt = al @ unit[0, i, i], al @ unit[1, i, i], al @ unit[2, i, i], al @ unit[3, i, i]
            sn, st = -(ac @ unit[2, i, i]), -(ac @ unit[3, i, i])
            if dt == 0.0:
                c, cn, ct = rate - before[3, i], rn, rt
            elif laws[0] == HARD:
                c, cn, ct = rate + (gap - before[2, i]) / laws[8], rn + gn / laws[8], rt + gt / laws[8]
            else:
                slack[i] = spring(gap, rate, laws)[0] == 0.0
                f, fg, fr = spring(0.5 * (before[0, i] + gap), 0.5 * (before[3, i] + rate), laws)
                c, cn = normal[i] - f, 1.0 - 0.5 * (fg * gn + fr * rn)
                ct = -0.5 * (fg * gt + fr * rt)
            c0 = c - cn * normal[i] - ct * tangent[i]
            s0 = slip - sn * normal[i] - st * tangent[i]
            mu = coefficient(0.5 * (slip + before[1, i]), laws, table)
            rest = laws[6] if laws[4] == COULOMB and rested[i] else coefficient(0.0, laws, table)
            p, t, found = 0.0, 0.0, OPEN
            if c0 < 0.0:
                if laws[4] != SLIDING:
                    whole = cn * st - ct * sn
                    p, t, found = (s0 * ct - c0 * st) / whole, (c0 * sn - s0 * cn) / whole, STUCK
                if laws[4] == SLIDING or p < 0.0 or abs(t) > rest * p:
                    p, found = -c0 / (cn + mu * ct), FORWARD
                    t = mu * p
                    if laws[4] != SLIDING and s0 + sn * p + st * t < 0.0:
                        p, found = -c0 / (cn - mu * ct), BACKWARD
                        t = -mu * p
            change = max(change, abs(p - normal[i]), abs(t - tangent[i]))
            size = max(size, abs(p), abs(t))
            sizes = np.abs(al) @ (np.abs(pv) + np.abs(px) / laws[8]) + abs(given[1][i]) / laws[8]
            noise = max(noise, 4e-16 * sizes / rn)  # of rounding
            normal[i], tangent[i], state[i] = p, t, found
        if change <= 1e-12 * size + noise:
            return True
    return False


@njit(cache=True)
def march(y, kept, tables, given, grid, laws, table):
    """March through all samples; False where a contact problem has not converged."""
    states, bins, late, sums = kept
    decay_re, decay_im, kicks, answer, look, fast, steady = tables
    sense, lengths, per_revolution = grid
    top, q, half, m = lengths.size - 1, bins.shape[0], y.size // 2, answer.shape[4]
    per_turn = per_revolution * 2**top
    state, active, hit = np.zeros(q, np.int64), np.zeros(q, np.bool_), np.zeros(q, np.bool_)
    found, normal, tangent = np.zeros(q, np.int64), np.zeros(q), np.zeros(q)
    ends = np.zeros(q, np.bool_)  # of pairs that touch or go slack within a step
    held = np.zeros((2, q))  # forces of the step before
    n_dir, t_dir, before, load = np.zeros((q, m)), np.zeros((q, m)), np.zeros((4, q)), np.zeros((q, m))
    al, ac = np.zeros(m), np.zeros(m)
    left, hardest, t = np.full(q, -SHORTEST), 0.0, 0  # when pairs opened

    def motions(of, at):
        angle = sense * 2.0 * math.pi * (at % per_turn) / per_turn
        e = complex(math.cos(angle), math.sin(angle))
        x = look[0] @ of + (steady[0] * e + steady[1]).real
        return x.reshape(q, m), (look[1] @ of + (steady[2] * e).real).reshape(q, m)

    while True:
        if t % 2**top == 0:
            states[t // 2**top] = y
            if t // 2**top == states.shape[0] - 1:
                return True
        x0, v0 = motions(y, t)
        level, is_closed = FINEST, np.any(state != OPEN)
        speed = fast @ np.hypot(y[:half], y[half:]) + np.abs(steady[2])
        reach = 1e9  # until when no gap can close
        for i in range(q):
            pair = given[0][i], given[1][i], given[2][i]
            before[0, i], before[3, i], before[1, i] = see(x0[i], v0[i], pair, laws, sense, al, ac)
            of = speed[i * m : (i + 1) * m]
            slant = 0.02 + abs(x0[i, 1]) / pair[0] if pair[0] > 0.0 else 1.0
            closing = of[0] + of[1] * slant + of[3:] @ (np.abs(x0[i, 3:]) + 1e-3)
            reach = min(reach, max(before[0, i], 0.0) / closing)
        while not is_closed and level < top and lengths[level + 1] < 0.7 * reach:
            level += 1
        while t % 2**level != 0:
            level -= 1
        rested = state == STUCK
        while True:  # until a step is taken
            dt, re, im = lengths[level], decay_re[level], decay_im[level]
            free = np.concatenate((re * y[:half] - im * y[half:], im * y[:half] + re * y[half:]))
            x, v = motions(free, t + 2**level)
            for i in range(q):
                pair = given[0][i], given[1][i], given[2][i]
                gap, rate, _ = see(x[i], v[i], pair, laws, sense, al, ac)
                active[i] = state[i] != OPEN or (laws[0] != HARD and gap + before[0, i] < 0.0)
                ends[i] = laws[0] != HARD and state[i] == OPEN and gap < 0.0 <= before[0, i]
                hit[i] = laws[0] == HARD and state[i] == OPEN and gap < -UNSEEN and rate < 0.0
                look_at(0.5 * (x0[i] + x[i]), pair[0], pair[1], laws, sense, n_dir[i], t_dir[i])
                found[i], normal[i], tangent[i] = OPEN, held[0, i] * active[i], held[1, i] * active[i]
            if np.any(active) and level > FINEST:
                level = FINEST
                continue
            if np.any(active) and not solve_pairs(
                active,
                rested,
                x,
                v,
                before,
                n_dir,
                t_dir,
                answer[0, level],
                answer[1, level],
                dt,
                given,
                sense,
                laws,
                table,
                (normal, tangent, found, ends),
            ):
                return False
            if level == 0 or not (np.any(hit) or np.any(found != state) or np.any(ends)):
                break
            level -= 1
        y, here = free, t >> FINEST
        if np.any(active):
            for i in range(q):
                load[i] = n_dir[i] * normal[i] + t_dir[i] * tangent[i]
            y += kicks[level] @ load.ravel()
            gone = motions(y, t + 2**level)[0] - x0
            for i in range(q):
                if normal[i] > 0.0:
                    bins[i, here] += normal[i] * dt
                    sums[0, i] += dt
                    sums[1, i] += dt * (found[i] == STUCK)
                    sums[2, i] += tangent[i] * (given[2][i] * dt - t_dir[i] @ gone[i])
        t += 2**level
        for i in range(q):
            sums[3, i] += found[i] != OPEN and state[i] == OPEN and t - left[i] >= SHORTEST
            left[i] = t if found[i] == OPEN and state[i] != OPEN else left[i]
        held[0], held[1], state[:] = normal, tangent, found
        if not np.any(hit):
            continue
        x, v = motions(y, t)  # impulses of the pairs that touch, and of those that are closed
        for i in range(q):
            pair = given[0][i], given[1][i], given[2][i]
            gap, rate, before[1, i] = see(x[i], v[i], pair, laws, sense, n_dir[i], t_dir[i])
            active[i] = hit[i] or state[i] != OPEN
            before[3, i] = min(rate, 0.0)
            if hit[i]:
                before[3, i] = -rate * (laws[3] if t - left[i] >= SHORTEST else 0.0)
                before[2, i], hardest = gap, max(hardest, -rate)
            normal[i], tangent[i], found[i] = held[0, i] * IMPACT, held[1, i] * IMPACT, OPEN
            load[i] = n_dir[i] * normal[i] + t_dir[i] * tangent[i]
        without = v - (look[1] @ (kicks[-1] @ load.ravel())).reshape(q, m)
        rested = state == STUCK
        if not solve_pairs(
            active,
            rested,
            x,
            without,
            before,
            n_dir,
            t_dir,
            answer[0, -1],
            answer[1, -1],
            0.0,
            given,
            sense,
            laws,
            table,
            (normal, tangent, found, ends),
        ):
            return False
        normal -= held[0] * IMPACT
        tangent -= held[1] * IMPACT
        for i in range(q):
            load[i] = n_dir[i] * normal[i] + t_dir[i] * tangent[i]
        y += kicks[-1] @ load.ravel()
        after = motions(y, t)[1]
        for i in range(q):
            if active[i]:
                mean = 0.5 * (v[i] + after[i])
                if bins[i, here] == 0.0:
                    late[i, here] = t / 2**FINEST - here
                bins[i, here] += normal[i]
                sums[2, i] += tangent[i] * (given[2][i] - t_dir[i] @ mean)
                sums[3, i] += hit[i] and t - left[i] >= SHORTEST
                drift = 0.0 if hit[i] else max(n_dir[i] @ v[i], 0.0)
                stays = n_dir[i] @ after[i] - drift <= REST * hardest
                state[i] = (found[i] or max(state[i], FORWARD)) if stays else OPEN
                left[i] = left[i] if stays else t
