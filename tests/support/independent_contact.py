"""Rubs in all degrees of freedom with any gap and any law, by dyadic time stepping: a code of its own.

Matrices come from `reference_bodies`. In a step contact forces are constant and act along the directions in
its middle; the motion under them is the exponential of the whole system. Gap, slip and law are met by

    hard     gap rate = (gap at the touch - gap) / fade at the end, and N >= 0
    springs  N = f(mean of the gaps at both ends, mean gap rate)
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
UNSEEN = 1e-15  # m, an overlap that is no touch yet


def solve(rig, case, longest_step=0.1e-6, **start):
    """Return samples and measures of a case by their names in a record, and `error` of each.

    Parameters
    ----------
    case : dict
        Arguments of `rubhpc.simulate` in SI units: `speed` or `speed_ratio`, `clearance`, `friction`, the
        laws, `normal`, `revolutions`, `samples_per_revolution`. The case starts from rest.
    longest_step : float
        s, of contact, in the coarser of two runs.
    """
    coarse, fine = (run(rig, case, step, **start) for step in (longest_step, longest_step / 2))
    error = {}
    for name in fine:
        size = np.abs(fine[name]).max(initial=0.0)
        error[name] = float(np.abs(fine[name] - coarse[name]).max(initial=0.0) / size) if size else 0.0
    return fine | {"error": error}


def run(rig, case, longest_step, **start):
    """Return samples and measures with one step, which is at most `longest_step` (s) in contact."""
    spin = case["speed"] if "speed" in case else case["speed_ratio"] * first_lateral_frequency(rig)
    bodies = set_up(rig, spin)
    offset = [stator.clearance_offset for stator in rig.stator]
    radius = np.array([rig.contact_radius(stator) for stator in rig.stator])
    angle = np.array([stator.angle for stator in rig.stator])
    return march_bodies(
        bodies, spin, case, radius, angle, case["clearance"] + np.array(offset), longest_step, **start
    )


def first_lateral_frequency(rig):
    """Of the rotor at standstill, rad/s."""
    bodies = set_up(rig, 0.0)
    n = 4 * (sum(section.elements for section in rig.rotor.shaft) + 1)
    return math.sqrt(scipy.linalg.eigvalsh(bodies.stiffness[:n, :n], bodies.mass[:n, :n])[0])


def pair_rows(bodies, radius, angle, sense):
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


def march_bodies(
    bodies, spin, case, radius, angle, clearance, longest_step, displacement=None, velocity=None
):
    """March from rest, or from displacement and velocity (n,), and measure."""
    n, q = len(bodies.mass), len(radius)
    revolutions, per_revolution = case["revolutions"], case.get("samples_per_revolution", 64)
    n_sample = revolutions * per_revolution
    interval = 2 * math.pi / abs(spin) / per_revolution
    coarsest = max(2, math.ceil(math.log2(interval / longest_step)))  # halvings of an interval to a step
    top, h_level = coarsest + FINEST, FINEST
    tick = interval / 2**top

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
    sag = np.linalg.solve(bodies.stiffness, bodies.weight)
    first = np.concatenate([np.zeros(n) if displacement is None else displacement - sag, np.zeros(n)])
    if velocity is not None:
        first[n:] = velocity
    z = enter @ (first - whirl.real)

    rows = pair_rows(bodies, radius, angle, np.sign(spin))
    m = rows.shape[1]
    rows = rows.reshape(q * m, n)
    load = enter[:, n:] @ inverse @ rows.T  # rates of the modes from loads on the motions of pairs
    moves = (np.abs(load).max(axis=1) > 1e-13 * np.abs(load).max()) | (np.abs(z) > 1e-13 * np.abs(z).max())
    kept = (exponent.imag >= 0) & moves  # the others are their conjugates, or never move
    share = np.where(exponent.imag[kept] > 0, 2.0, 1.0)
    exponent, z, load = exponent[kept], z[kept], load[kept]
    shape = shape[:, kept] * share

    def real(of):
        return np.ascontiguousarray(np.hstack([of.real, -of.imag]))

    look = real(rows @ shape[:n]), real(rows @ shape[n:])
    lengths = tick * 2.0 ** np.arange(top + 1)
    decay = np.exp(np.outer(lengths, exponent))
    kicks = [(np.expm1(exponent * t) / exponent)[:, None] * load for t in lengths[: h_level + 1]]
    kicks = np.array([np.vstack([kick.real, kick.imag]) for kick in (*kicks, load)])  # the last of impulses
    answer = np.array([[row @ kick for kick in kicks] for row in look])
    still = rows @ sag
    fast = np.abs((rows @ shape[n:])), np.abs(rows @ whirl[n:])
    bins = np.zeros((q, n_sample * 2**coarsest))
    states = np.zeros((n_sample + 1, 2 * len(exponent)))
    laws, table = read_laws(case)
    laws[8] = interval / 2**coarsest / 2  # fade
    sums = np.zeros((6, q))
    counts = march(
        np.concatenate([z.real, z.imag]),
        states,
        bins,
        sums,
        (decay.real.copy(), decay.imag.copy(), kicks, answer, *look),
        (rows @ whirl[:n], still, *fast),
        (radius, clearance, abs(spin) * radius),
        (spin, tick, top, h_level, per_revolution, m),
        laws,
        table,
    )
    assert counts >= 0, "the contact problem did not converge"
    turns = np.exp(1j * np.sign(spin) * 2 * math.pi * np.arange(n_sample + 1) / per_revolution)
    motion = states @ real(shape).T + np.outer(turns, whirl).real
    motion[:, :n] += sag
    of = np.concatenate([bodies.output, *bodies.rows[:, 3:].T])
    signals = np.where(of >= 0, motion[:-1, of], 0.0).T
    force = bins.reshape(q, n_sample, -1).sum(axis=2) / interval
    touched = np.maximum(sums[0], 1e-300)
    per = dict(zip(("contact", "stick", "friction", "normal", "total", "contacts"), sums, strict=True))
    u, v = motion[:, :n] - sag, motion[:, n:]
    symmetric = (bodies.stiffness + bodies.stiffness.T) / 2
    return {
        "vertical": signals[0],
        "horizontal": signals[1],
        "torsion": signals[2],
        "stator_axial": signals[3 : 3 + q],
        "stator_lateral": signals[3 + q :],
        "contact_force": force,
        "peak_contact_force": peak(bins, interval / 2**coarsest),
        "contact_impulse": bins.sum(axis=1) / revolutions,
        "contact_fraction": per["contact"] / (n_sample * interval),
        "stick_fraction": per["stick"] / touched,
        "friction_work": per["friction"] / revolutions,
        "contacts_per_revolution": per["contacts"] / revolutions,
        "normal_work": per["normal"],
        "contact_work": per["total"],
        "energy": 0.5 * ((u @ symmetric * u).sum(axis=1) + (v @ bodies.mass * v).sum(axis=1)),
    }


def read_laws(case):
    """Numbers of the laws, and of a friction table (2, n): slip speeds and coefficients."""
    kind = {"lagrange": HARD, "penalty": PENALTY, "hertz": HERTZ}[case.get("law", "lagrange")]
    friction = ("sliding", "coulomb", "stribeck", "table").index(case.get("friction_law", "sliding"))
    mu = case["friction"]
    table = np.array([case.get("slip_speed", (0.0,)), np.array(case.get("friction_ratio", (1.0,))) * mu])
    ratio = case.get("static_friction_ratio", 1.0)
    return np.array(
        [
            kind,
            case.get("stiffness", 0.0),
            case.get("damping", 0.0),
            case.get("restitution", 0.0) or 0.0,
            friction,
            mu,
            ratio * mu,
            case.get("stribeck_speed", 1.0),
            0.0,
            case.get("normal", "fixed") == "updated",
        ]
    ), table


def peak(bins, width):
    """Largest mean over 20 us, whole bins and a part of the next or the previous one."""
    whole = int(MEAN_TIME / width)
    part = MEAN_TIME / width - whole
    padded = np.pad(bins, ((0, 0), (whole + 1, whole + 1)))
    until = np.pad(np.cumsum(padded, axis=1), ((0, 0), (1, 0)))
    sums = until[:, whole:] - until[:, :-whole]  # of the bins i to i + whole
    after, before = sums[:, :-1] + part * padded[:, whole:], sums[:, 1:] + part * padded[:, :-whole]
    return np.maximum(after.max(axis=1), before.max(axis=1)) / MEAN_TIME


@njit(cache=True)
def look_at(x, radius, clearance, laws, sense, along, across):
    """Gap, and its gradient and that of the tip's advance along the rim in the motions of a pair."""
    is_round = laws[9] > 0.0
    back, side = clearance + x[0], x[1]
    for k in range(3, x.size):
        back += 0.5 * x[k] ** 2
    c, s, gap = 1.0, 0.0, back
    if is_round:
        distance = math.hypot(radius + back, side)
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
    if gap >= 0.0:
        return 0.0, 0.0, 0.0
    if laws[0] == PENALTY:
        force, by_gap, by_rate = -k * gap - c * rate, -k, -c
    else:
        root = math.sqrt(-gap)
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
def solve_pairs(
    active,
    was,
    x,
    v,
    gap0,
    gap1,
    slip0,
    n_dir,
    t_dir,
    by_x,
    by_v,
    targets,
    dt,
    given,
    m,
    sense,
    laws,
    table,
    normal,
    tangent,
    state,
):
    """Forces (or impulses, dt = 0) of the active pairs from their motions without them; False if none."""
    radius, clearance, rim = given
    q = was.size
    al, ac = np.zeros(m), np.zeros(m)
    px, pv = np.zeros(m), np.zeros(m)
    xn, xt, vn, vt = np.zeros((q, q, m)), np.zeros((q, q, m)), np.zeros((q, q, m)), np.zeros((q, q, m))
    for i in range(q):
        for j in range(q):
            if active[i] and active[j]:
                for a in range(m):
                    for b in range(m):
                        xn[i, j, a] += by_x[i * m + a, j * m + b] * n_dir[j, b]
                        xt[i, j, a] += by_x[i * m + a, j * m + b] * t_dir[j, b]
                        vn[i, j, a] += by_v[i * m + a, j * m + b] * n_dir[j, b]
                        vt[i, j, a] += by_v[i * m + a, j * m + b] * t_dir[j, b]
    for sweep in range(2000):
        change, size, noise = 0.0, 0.0, 0.0
        for i in range(q):
            if not active[i]:
                continue
            for a in range(m):
                px[a], pv[a] = x[i * m + a], v[i * m + a]
                for j in range(q):
                    if active[j]:
                        px[a] += xn[i, j, a] * normal[j] + xt[i, j, a] * tangent[j]
                        pv[a] += vn[i, j, a] * normal[j] + vt[i, j, a] * tangent[j]
            gap = look_at(px, radius[i], clearance[i], laws, sense, al, ac)
            rate, slip, sizes = 0.0, rim[i], abs(clearance[i]) / laws[8]
            gn, gt, rn, rt, sn, st = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for a in range(m):
                rate += al[a] * pv[a]
                slip -= ac[a] * pv[a]
                sizes += abs(al[a]) * (abs(pv[a]) + abs(px[a]) / laws[8])
                gn += al[a] * xn[i, i, a]
                gt += al[a] * xt[i, i, a]
                rn += al[a] * vn[i, i, a]
                rt += al[a] * vt[i, i, a]
                sn -= ac[a] * vn[i, i, a]
                st -= ac[a] * vt[i, i, a]
            if dt == 0.0:
                c, cn, ct = rate - targets[i], rn, rt
            elif laws[0] == HARD:
                c, cn, ct = rate + (gap - gap1[i]) / laws[8], rn + gn / laws[8], rt + gt / laws[8]
            else:
                f, fg, fr = spring(0.5 * (gap0[i] + gap), (gap - gap0[i]) / dt, laws)
                c = normal[i] - f
                slope = 0.5 * fg + fr / dt
                cn, ct = 1.0 - slope * gn, -slope * gt
            c0 = c - cn * normal[i] - ct * tangent[i]
            s0 = slip - sn * normal[i] - st * tangent[i]
            mu = coefficient(0.5 * (slip + slip0[i]), laws, table)
            rest = coefficient(0.0, laws, table)
            if laws[4] == COULOMB and was[i] == STUCK:
                rest = laws[6]
            p, t, found = 0.0, 0.0, OPEN
            if c0 < 0.0:
                whole = cn * st - ct * sn
                if laws[4] != SLIDING:
                    p, t = (s0 * ct - c0 * st) / whole, (c0 * sn - s0 * cn) / whole
                    found = STUCK
                if laws[4] == SLIDING or p < 0.0 or abs(t) > rest * p:
                    p, found = -c0 / (cn + mu * ct), FORWARD
                    t = mu * p
                    if laws[4] != SLIDING and s0 + sn * p + st * t < 0.0:
                        p, found = -c0 / (cn - mu * ct), BACKWARD
                        t = -mu * p
            change = max(change, abs(p - normal[i]), abs(t - tangent[i]))
            size = max(size, abs(p), abs(t))
            noise = max(noise, 4e-16 * sizes / rn)
            normal[i], tangent[i], state[i] = p, t, found
        if change <= 1e-12 * size + noise:
            return True
    return False


@njit(cache=True)
def march(y, states, bins, sums, tables, forced, given, grid, laws, table):
    """March through all samples; -1 where the contact problem has not converged."""
    decay_re, decay_im, kicks, answer, look_x, look_v = tables
    whirl, still, fast, whirl_fast = forced
    radius, clearance, rim = given
    spin, tick, top, h_level, per_revolution, m = grid
    q, k_mode = radius.size, decay_re.shape[1]
    sense = 1.0 if spin > 0 else -1.0
    per_turn = per_revolution * 2**top
    state, found, active = np.zeros(q, np.int64), np.zeros(q, np.int64), np.zeros(q, np.bool_)
    normal, tangent, p_n, p_t = np.zeros(q), np.zeros(q), np.zeros(q), np.zeros(q)
    n_dir, t_dir, gap0, slip0, rate0, targets = (
        np.zeros((q, m)),
        np.zeros((q, m)),
        np.zeros(q),
        np.zeros(q),
        np.zeros(q),
        np.zeros(q),
    )
    al, ac = np.zeros(m), np.zeros(m)
    hit, gap1, touch = np.zeros(q, np.bool_), np.zeros(q), np.full(q, -SHORTEST)
    load, middle, sizes = np.zeros(q * m), np.zeros(q * m), np.zeros(k_mode)
    y1 = y.copy()
    t, last, hardest = 0, states.shape[0] - 1, 0.0
    n_bin = bins.shape[1]
    end = last * 2**top
    while True:
        if t % 2**top == 0:
            states[t // 2**top] = y
            if t == end:
                return 0
        angle = sense * 2.0 * math.pi * (t % per_turn) / per_turn
        e = complex(math.cos(angle), math.sin(angle))
        x0 = look_x @ y + (whirl * e).real + still
        v0 = look_v @ y + (whirl * e * (1j * spin)).real
        nearest, is_closed = 1e9, False
        for i in range(q):
            gap0[i] = look_at(x0[i * m : (i + 1) * m], radius[i], clearance[i], laws, sense, al, ac)
            rate0[i], slip0[i] = 0.0, rim[i]
            for a in range(m):
                rate0[i] += al[a] * v0[i * m + a]
                slip0[i] -= ac[a] * v0[i * m + a]
            is_closed = is_closed or state[i] != OPEN
        level = h_level
        if not is_closed:  # as far as no gap can close
            for k in range(k_mode):
                sizes[k] = math.hypot(y[k], y[k_mode + k])
            speed = fast @ sizes + whirl_fast
            reach = 1e9
            for i in range(q):
                closing = speed[i * m] + speed[i * m + 1] * (0.02 + abs(x0[i * m + 1]) / radius[i])
                for a in range(3, m):
                    closing += speed[i * m + a] * (abs(x0[i * m + a]) + 1e-3)
                reach = min(reach, max(gap0[i], 0.0) / closing)
            while level < top and tick * 2.0 ** (level + 1) < 0.7 * reach:
                level += 1
        while t % 2**level != 0:
            level -= 1
        while True:  # until a step is taken
            dt = tick * 2.0**level
            for k in range(k_mode):
                y1[k] = decay_re[level, k] * y[k] - decay_im[level, k] * y[k_mode + k]
                y1[k_mode + k] = decay_im[level, k] * y[k] + decay_re[level, k] * y[k_mode + k]
            angle = sense * 2.0 * math.pi * ((t + 2**level) % per_turn) / per_turn
            e = complex(math.cos(angle), math.sin(angle))
            x = look_x @ y1 + (whirl * e).real + still
            v = look_v @ y1 + (whirl * e * (1j * spin)).real
            any_active, any_hit = False, False
            for i in range(q):
                gap = look_at(x[i * m : (i + 1) * m], radius[i], clearance[i], laws, sense, al, ac)
                rate = 0.0
                for a in range(m):
                    rate += al[a] * v[i * m + a]
                active[i] = state[i] != OPEN or (laws[0] != HARD and gap + gap0[i] < 0.0)
                hit[i] = laws[0] == HARD and state[i] == OPEN and gap < -UNSEEN and rate < 0.0
                any_active, any_hit = any_active or active[i], any_hit or hit[i]
                middle[i * m : (i + 1) * m] = 0.5 * (x0[i * m : (i + 1) * m] + x[i * m : (i + 1) * m])
                look_at(middle[i * m : (i + 1) * m], radius[i], clearance[i], laws, sense, n_dir[i], t_dir[i])
                found[i] = OPEN
                p_n[i], p_t[i] = normal[i] * active[i], tangent[i] * active[i]
            if any_active and level > h_level:
                level = h_level
                continue
            if any_active:
                done = solve_pairs(
                    active,
                    state,
                    x,
                    v,
                    gap0,
                    gap1,
                    slip0,
                    n_dir,
                    t_dir,
                    answer[0, level],
                    answer[1, level],
                    targets,
                    dt,
                    given,
                    m,
                    sense,
                    laws,
                    table,
                    p_n,
                    p_t,
                    found,
                )
                if not done:
                    return -1
            has_changed = any_hit
            for i in range(q):
                has_changed = has_changed or found[i] != state[i]
            if has_changed and level > 0:
                level -= 1
                continue
            break
        y, y1 = y1, y
        here = t // 2**h_level
        for i in range(q):
            for a in range(m):
                load[i * m + a] = n_dir[i, a] * p_n[i] + t_dir[i, a] * p_t[i] if active[i] else 0.0
        if any_active:
            y += kicks[level] @ load
            dx = x + answer[0, level] @ load - x0
            for i in range(q):
                if p_n[i] > 0.0:
                    gone, moved, part = 0.0, 0.0, 0.0
                    for a in range(m):
                        gone += t_dir[i, a] * dx[i * m + a]
                        moved += n_dir[i, a] * dx[i * m + a]
                    bins[i, here] += p_n[i] * dt
                    sums[0, i] += dt
                    sums[1, i] += dt * (found[i] == STUCK)
                    sums[2, i] += p_t[i] * (rim[i] * dt - gone)
                    sums[3, i] += p_n[i] * moved
                    sums[4, i] += p_n[i] * moved + p_t[i] * gone
        for i in range(q):
            sums[5, i] += found[i] != OPEN and state[i] == OPEN
            state[i], normal[i], tangent[i] = found[i], p_n[i], p_t[i]
        t += 2**level
        if not any_hit:
            continue
        # Impulses of the pairs that touch, and of those that are closed.
        x = look_x @ y + (whirl * e).real + still
        v = look_v @ y + (whirl * e * (1j * spin)).real
        for i in range(q):
            gap = look_at(x[i * m : (i + 1) * m], radius[i], clearance[i], laws, sense, n_dir[i], t_dir[i])
            rate, slip = 0.0, rim[i]
            for a in range(m):
                rate += n_dir[i, a] * v[i * m + a]
                slip -= t_dir[i, a] * v[i * m + a]
            active[i] = hit[i] or state[i] != OPEN
            back = laws[3] if t - touch[i] > SHORTEST else 0.0
            if hit[i]:
                hardest = max(hardest, -rate)
                gap1[i], touch[i] = gap, t
            rate0[i], slip0[i] = rate, slip
            targets[i] = -back * rate if hit[i] else min(rate, 0.0)
            p_n[i], p_t[i], found[i] = 0.0, 0.0, OPEN
        done = solve_pairs(
            active,
            state,
            x,
            v,
            gap0,
            gap1,
            slip0,
            n_dir,
            t_dir,
            answer[0, -1],
            answer[1, -1],
            targets,
            0.0,
            given,
            m,
            sense,
            laws,
            table,
            p_n,
            p_t,
            found,
        )
        if not done:
            return -1
        for i in range(q):
            for a in range(m):
                load[i * m + a] = n_dir[i, a] * p_n[i] + t_dir[i, a] * p_t[i] if active[i] else 0.0
        y += kicks[-1] @ load
        change = answer[1, -1] @ load
        for i in range(q):
            if not active[i]:
                continue
            rate, slip = rate0[i], slip0[i]
            for a in range(m):
                rate += n_dir[i, a] * change[i * m + a]
                slip -= t_dir[i, a] * change[i * m + a]
            bins[i, min(here, n_bin - 1)] += p_n[i]
            sums[2, i] += p_t[i] * 0.5 * (slip + slip0[i])
            sums[3, i] += p_n[i] * 0.5 * (rate + rate0[i])
            sums[4, i] += p_n[i] * 0.5 * (rate + rate0[i]) + p_t[i] * (rim[i] - 0.5 * (slip + slip0[i]))
            sums[5, i] += hit[i]
            is_away = rate > REST * hardest
            state[i] = OPEN if is_away else (found[i] if found[i] != OPEN else max(state[i], FORWARD))
