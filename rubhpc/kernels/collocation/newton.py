"""A step of closed contacts: forces that obey the laws at the nodes, by Newton's method.

Unknown are the forces of the closed pairs at the nodes, N and, unless friction is a constant multiple of it,
T; and, where gaps are curved, the local displacements at the nodes after the first, by which the loads turn.
Straight gaps with linear laws need one iteration. The equations are

- hard contact: `gap = faded error` at the nodes after the first, and the rate of it at the end;
- springs: `N = law(gap, rate)` at the nodes after the first, and its rate at the end;
- sticking: the same of the path of slip as of a hard gap;
- sliding with a coefficient that depends on the slip: `T = +-mu(slip) N` at all nodes;
- displacements that follow from the loads.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.collocation.gaps import see_bend, see_gap, slip_path
from rubhpc.kernels.collocation.laws import friction_ratio, spring_force
from rubhpc.kernels.collocation.structures import (
    ACROSS,
    BEND,
    BY_BOTH,
    BY_GAP,
    BY_GAP_TWICE,
    BY_RATE,
    FRICTION,
    GAP,
    NORMAL,
    OF_BEND,
    OF_RATE,
    OF_SLIP,
    OPEN,
    RATE,
    RATIO,
    RATIO_SLOPE,
    ROUND,
    SLIP,
    STICKING,
    TURNED,
    TWIST,
    WIDENED,
    Bodies,
    Nodes,
    Solution,
    Tables,
)
from rubhpc.kernels.collocation.tables import bend_row, place_row, rate_row
from rubhpc.kernels.laws import HERTZ, LAGRANGE

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_ITERATIONS = 26
ROUNDING = 2e-16  # of displacements
SLOW = 0.2  # of the last change: with less progress the matrix is made anew


@linked_sum
def invert(a: Floats, pivot: Ints, n: int) -> bool:
    """Inverse of a matrix in its place (Gauss and Jordan); False where it is singular.

    Many solutions follow from each matrix, and products take a fifth of the time of substitutions.
    """
    for k in range(n):
        best, largest = k, abs(a[k, k])
        for i in range(k + 1, n):
            if abs(a[i, k]) > largest:
                largest, best = abs(a[i, k]), i
        pivot[k] = best
        if not 0.0 < largest < np.inf:
            return False
        source = a[k]
        if best != k:
            other = a[best]
            for j in range(n):
                held = source[j]
                source[j] = other[j]
                other[j] = held
        inverse = 1.0 / source[k]
        source[k] = 1.0
        for j in range(n):
            source[j] *= inverse
        for i in range(n):
            target = a[i]
            factor = target[k]
            if i != k and factor != 0.0:
                target[k] = 0.0
                for j in range(n):
                    target[j] -= factor * source[j]
    for k in range(n - 1, -1, -1):
        other = pivot[k]
        if other != k:
            for i in range(n):
                held = a[i, k]
                a[i, k] = a[i, other]
                a[i, other] = held
    return True


@linked_sum
def multiply(a: Floats, n: int, b: Floats, result: Floats) -> None:
    """Fill `result` (n,) with the product of the transpose of a matrix and b."""
    for i in range(n):
        result[i] = 0.0
    for j in range(n):
        size, row = b[j], a[j]
        for i in range(n):
            result[i] += size * row[i]


@linked_sum
def n_force(bodies: Bodies, state: int) -> int:
    """Unknown forces of a closed pair at a node."""
    return 1 if state != STICKING and not bodies.is_varied else 2


@linked_sum
def list_closed(bodies: Bodies, nodes: Nodes, state: Ints, solution: Solution) -> tuple[int, int, int]:
    """Number of closed pairs, which are listed, and of unknown forces and of all unknowns."""
    s, n_closed, n_unknown = nodes.at.size, 0, 0
    for i in range(state.size):
        if state[i] != OPEN:
            solution.closed[n_closed] = i
            n_closed += 1
            n_unknown += s * n_force(bodies, state[i])
    n_place = 0 if bodies.is_straight else n_closed * (s - 1) * (bodies.n_local - 1)
    return n_closed, n_unknown, n_unknown + n_place


@linked_sum
def see_start(bodies: Bodies, x: Floats, solution: Solution) -> None:
    """Local motions, velocities and free accelerations at the coordinates x."""
    see_motions(bodies, x, solution.start.size, solution)


@linked_sum
def see_motions(bodies: Bodies, x: Floats, n: int, solution: Solution) -> None:
    """The first n of them."""
    start, local = solution.start, bodies.local
    for r in range(n):
        row, total = local[r], 0.0
        for k in range(x.size):
            total += row[k] * x[k]
        start[r] = total


@linked_sum
def push_closed(
    bodies: Bodies, nodes: Nodes, state: Ints, force: Floats, n_closed: int, solution: Solution
) -> None:
    """Loads at the nodes by the forces and directions there; T of steady sliding follows from N."""
    s, n_local, n_row = nodes.at.size, bodies.n_local, bodies.load.shape[0]
    for c in range(n_closed):
        i = solution.closed[c]
        is_bound = n_force(bodies, state[i]) == 1
        for k in range(s):
            row, first = i * s + k, k * n_row + i * n_local
            if is_bound:
                force[i, FRICTION, k] = state[i] * bodies.friction[i] * force[i, NORMAL, k]
            n, t = force[i, NORMAL, k], force[i, FRICTION, k]
            for a in range(n_local):
                solution.load[first + a] = n * solution.normal[row, a] + t * solution.tangent[row, a]


@linked_sum
def move_freely(
    bodies: Bodies,
    s: int,
    free: Floats,
    x: Floats,
    blocks: tuple[int, int],
    pairs: tuple[int, int],
    y: Floats,
    solution: Solution,
) -> None:
    """Motions y of listed pairs without loads, in blocks of y: displacements at the nodes, and so on."""
    n_local = bodies.n_local
    for p in range(pairs[0], pairs[1]):
        first = place_row(s, n_local, solution.closed[p], 1)
        for r in range(first + blocks[0] * n_local, first + blocks[1] * n_local):
            row, total = free[r], 0.0
            for k in range(x.size):
                total += row[k] * x[k]
            y[r] = total


@linked_sum
def add_response(
    bodies: Bodies,
    s: int,
    size: float,
    row: Floats,
    blocks: tuple[int, int],
    pairs: tuple[int, int],
    y: Floats,
    solution: Solution,
) -> None:
    """Add the response to a load, of a row of `Tables.forced`, to blocks of y of listed pairs."""
    n_local = bodies.n_local
    for p in range(pairs[0], pairs[1]):
        first = place_row(s, n_local, solution.closed[p], 1)
        for r in range(first + blocks[0] * n_local, first + blocks[1] * n_local):
            y[r] += size * row[r]


@linked_sum
def respond(
    bodies: Bodies,
    s: int,
    forced: Floats,
    n_closed: int,
    blocks: tuple[int, int],
    pairs: tuple[int, int],
    load: Floats,
    solution: Solution,
) -> None:
    """Motions y of listed pairs under the loads of the closed ones, in blocks of y."""
    n_local, n_row, closed, y = bodies.n_local, bodies.load.shape[0], solution.closed, solution.y
    for p in range(pairs[0], pairs[1]):
        first = place_row(s, n_local, closed[p], 1)
        begin, end = first + blocks[0] * n_local, first + blocks[1] * n_local
        for r in range(begin, end):
            y[r] = solution.y_free[r]
        for node in range(0, load.size, n_row):
            for c in range(n_closed):
                begun = node + closed[c] * n_local
                for a in range(begun, begun + n_local):
                    size, row = load[a], forced[a]
                    for r in range(begin, end):
                        y[r] += size * row[r]


@linked_sum
def list_near(
    bodies: Bodies, nodes: Nodes, step: float, x: Floats, state: Ints, n_closed: int, solution: Solution
) -> int:
    """List the open pairs that may touch within a step, after the closed ones; returns the number of all.

    Bounds of the accelerations are those of a flight, and for each load its size and how much it changes in
    the step times the sum of what the modes respond.
    """
    s, n_local, n_row, n = nodes.at.size, bodies.n_local, bodies.load.shape[0], n_closed
    if n_closed == state.size:
        return n
    size, n_complex, start, load = solution.size, bodies.n_complex, solution.start, solution.load
    for k in range(n_complex):
        size[k] = math.sqrt(x[k] * x[k] + x[n_complex + k] * x[n_complex + k])
    for k in range(n_complex, size.size):
        size[k] = abs(x[n_complex + k])
    for c in range(n_closed):
        first = solution.closed[c] * n_local
        for a in range(first, first + n_local):
            total = abs(load[a])
            for k in range(1, s):
                total += abs(load[k * n_row + a] - load[(k - 1) * n_row + a])
            solution.begun[a] = total
    for i in range(state.size):
        if state[i] != OPEN:
            continue
        first, rate, bound = i * n_local, 0.0, 0.0
        see_gap(bodies, i, start, first, i * s, solution)
        for a in range(n_local):
            slope, total = solution.normal[i * s, a], 0.0
            if slope != 0.0:
                bend, reach = bodies.bend[first + a], bodies.reach[first + a]
                for k in range(size.size):
                    total += bend[k] * size[k]
                for c in range(n_closed):
                    begun = solution.closed[c] * n_local
                    for b in range(begun, begun + n_local):
                        total += reach[b] * solution.begun[b]
                rate += slope * start[n_row + first + a]
                bound += abs(slope) * total
        least = solution.gap[i * s] + step * (min(rate, 0.0) - 0.5 * bound * step)
        if bodies.radius[i] < 0.0 or least <= 0.0:  # the gap of a bore is not convex
            solution.closed[n] = i
            n += 1
    return n


@linked_sum
def see_pair(bodies: Bodies, nodes: Nodes, i: int, is_lean: bool, solution: Solution) -> None:
    """Fill what is seen of a closed pair at the nodes, by its gaps there and the velocities of y.

    Lean: the velocities at the nodes between are not needed.
    """
    s, n_local, n_row = nodes.at.size, bodies.n_local, bodies.load.shape[0]
    first, is_hard = i * n_local, bodies.normal_law[i] == LAGRANGE
    for k in range(s):
        row, is_last = i * s + k, k == s - 1
        seen, normal, tangent = solution.seen[row], solution.normal[row], solution.tangent[row]
        seen[GAP] = solution.gap[row]
        if k > 0:
            moved = solution.place[k, first + ACROSS] - solution.place[0, first + ACROSS]
            twisted = solution.y[place_row(s, n_local, i, k) + TWIST] - solution.start[first + TWIST]
            seen[TURNED] = twisted - slip_path(bodies, i, row, i * s, moved, solution)
        if is_lean and 0 < k < s - 1:
            continue
        rates, v = (solution.start, n_row + first) if k == 0 else (solution.y, rate_row(s, n_local, i, k))
        rate, across = 0.0, 0.0
        for a in range(n_local):
            rate += normal[a] * rates[v + a]
            if a != TWIST:
                across += tangent[a] * rates[v + a]
        seen[RATE], seen[SLIP] = rate, bodies.rim_speed[i] + rates[v + TWIST] - across
        seen[WIDENED] = seen[GAP] * solution.curvature[row] * across
        if is_last and not is_hard:
            see_bend(bodies, row, solution)
            total, at = 0.0, bend_row(s, n_local, i)
            for a in range(n_local):
                total += normal[a] * solution.y[at + a]
                for b in range(n_local):
                    total += rates[v + a] * solution.normal_bend[a, b] * rates[v + b]
            seen[BEND] = total


@linked_sum
def fill_residual(
    bodies: Bodies,
    nodes: Nodes,
    tables: Tables,
    slot: int,
    state: Ints,
    force: Floats,
    n_closed: int,
    is_lean: bool,
    solution: Solution,
) -> None:
    """Fill the residuals of all equations."""
    s, n_local, residual = nodes.at.size, bodies.n_local, solution.residual
    step, fade, row = tables.tick * 2.0 ** (tables.first_level + slot), tables.fade[slot], 0
    for c in range(n_closed):
        i = solution.closed[c]
        see_pair(bodies, nodes, i, is_lean, solution)
        seen, n, t = solution.seen[i * s : i * s + s], force[i, NORMAL], force[i, FRICTION]
        first, end = seen[0], seen[s - 1]
        is_hard = bodies.normal_law[i] == LAGRANGE
        if is_hard:
            for k in range(1, s):
                residual[row + k - 1] = seen[k, GAP] - fade[k, 0] * first[GAP] - fade[k, 1] * first[RATE]
            rate = end[RATE] - fade[s - 1, 2] * first[GAP] - fade[s - 1, 3] * first[RATE]
            residual[row + s - 1] = step * rate
        else:
            by_gap, by_rate, grown = 0.0, 0.0, 0.0
            for k in range(1, s):
                wanted, by_gap, by_rate = spring_force(bodies, i, seen[k, GAP], seen[k, RATE])
                residual[row + k - 1] = n[k] - wanted
            for k in range(s):
                grown += nodes.end_slope[k] * n[k]
            residual[row + s - 1] = grown - step * (by_gap * end[RATE] + by_rate * end[BEND])
        row += s
        if state[i] == STICKING:
            for k in range(1, s):
                at = nodes.at[k]
                path = seen[k, TURNED] + bodies.rim_speed[i] * at * step - fade[k, 1] * first[SLIP]
                if is_hard:  # the small error of a gap changes evenly
                    path -= step * at * (first[WIDENED] + 0.5 * at * (end[WIDENED] - first[WIDENED]))
                else:
                    for j in range(s):
                        path -= step * nodes.integral[k, j] * seen[j, WIDENED]
                residual[row + k - 1] = path
            residual[row + s - 1] = step * (end[SLIP] - fade[s - 1, 3] * first[SLIP])
            row += s
        elif bodies.is_varied:
            for k in range(s):
                residual[row + k] = t[k] - state[i] * friction_ratio(bodies, i, seen[k, SLIP])[0] * n[k]
            row += s
    for c in range(0 if bodies.is_straight else n_closed):
        i = solution.closed[c]
        for k in range(1, s):
            at = place_row(s, n_local, i, k)
            for a in range(n_local):
                if a != TWIST:
                    residual[row] = solution.place[k, i * n_local + a] - solution.y[at + a]
                    row += 1


@linked_sum
def fill_slopes(
    bodies: Bodies, nodes: Nodes, state: Ints, force: Floats, n_closed: int, solution: Solution
) -> None:
    """Slopes of the laws, directions of the unknown forces and turning of the loads, at all nodes."""
    s, n_local, n_row = nodes.at.size, bodies.n_local, bodies.load.shape[0]
    for c in range(n_closed):
        i = solution.closed[c]
        first, is_bound = i * n_local, n_force(bodies, state[i]) == 1
        for k in range(s):
            row, is_last = i * s + k, k == s - 1
            see_bend(bodies, row, solution)
            normal, tangent, seen = solution.normal[row], solution.tangent[row], solution.seen[row]
            of_normal, of_tangent = solution.normal_bend, solution.tangent_bend
            n, t = force[i, NORMAL, k], force[i, FRICTION, k]
            ratio = state[i] * bodies.friction[i] if is_bound else 0.0
            for a in range(n_local):
                solution.direction[row, NORMAL, a] = normal[a] + ratio * tangent[a]
                solution.direction[row, FRICTION, a] = tangent[a]
                for b in range(n_local):
                    solution.turning[row, a, b] = n * of_normal[a, b] + t * of_tangent[a, b]
            rates, v = (solution.start, n_row + first) if k == 0 else (solution.y, rate_row(s, n_local, i, k))
            bent = solution.bent[row]
            for a in range(n_local):
                of_rate, of_slip = 0.0, 0.0
                for b in range(n_local):
                    of_rate += of_normal[a, b] * rates[v + b]
                    of_slip -= rates[v + b] * of_tangent[b, a]
                bent[OF_RATE, a], bent[OF_SLIP, a], bent[OF_BEND, a] = of_rate, of_slip, 0.0
            if bodies.is_varied and state[i] != STICKING:
                solution.ratio[row, RATIO], solution.ratio[row, RATIO_SLOPE] = friction_ratio(
                    bodies, i, seen[SLIP]
                )
            if bodies.normal_law[i] != LAGRANGE:
                fill_spring_slopes(bodies, i, row, solution)
                if is_last and bodies.damping[i] > 0.0:
                    fill_bend_slope(bodies, i, row, v, bend_row(s, n_local, i), solution)


@linked_sum
def fill_spring_slopes(bodies: Bodies, i: int, row: int, solution: Solution) -> None:
    """Slopes of the law of a spring at a node."""
    slope, gap, rate = solution.slope[row], solution.seen[row, GAP], solution.seen[row, RATE]
    _, slope[BY_GAP], slope[BY_RATE] = spring_force(bodies, i, gap, rate)
    slope[BY_GAP_TWICE], slope[BY_BOTH] = 0.0, 0.0
    if bodies.normal_law[i] == HERTZ and gap != 0.0:
        slope[BY_GAP_TWICE], slope[BY_BOTH] = 0.5 * slope[BY_GAP] / gap, 1.5 * slope[BY_RATE] / gap


@linked_sum
def fill_bend_slope(bodies: Bodies, i: int, row: int, v: int, at: int, solution: Solution) -> None:
    """Slope of the acceleration of a gap in the local displacements, by differences of the curvature.

    A displacement turns the normal and widens the reach, so that the curvature changes; all in one direction
    at a time.
    """
    n_local, y, bent = bodies.n_local, solution.y, solution.bent[row]
    normal, tangent, curvature = solution.normal[row], solution.tangent[row], solution.curvature[row]
    along, across, squares = 0.0, 0.0, 0.0
    for a in range(n_local):
        along += normal[a] * y[v + a]
        if a != TWIST:
            across += tangent[a] * y[v + a]
        if a > TWIST:
            squares += y[v + a] * y[v + a]
    n_across = solution.unit[row, 1]
    for a in range(n_local):
        if a == TWIST:
            continue
        total = 0.0
        for b in range(n_local):
            total += solution.normal_bend[a, b] * y[at + b]
        # Of curvature (t v)^2 + n_along sum(eta'^2): t turns against the normal, n_along by the tangent.
        own = y[v + a] if a > TWIST else 0.0
        turned = -curvature * along * tangent[a] - n_across * own
        total += curvature * (2.0 * across * turned - curvature * across * across * normal[a])
        total -= curvature * n_across * tangent[a] * squares
        bent[OF_BEND, a] = total


@linked_sum
def change_pair(
    bodies: Bodies,
    nodes: Nodes,
    i: int,
    first_node: int,
    begun: Floats,
    change: Floats,
    moved: Floats,
    solution: Solution,
) -> None:
    """Fill `changed` with the change of what is seen of a pair, from a node on.

    `begun` (3 R,) is the change of `start`, `change` (ny,) of y, `moved` (s, R) of `place`.
    """
    s, n_local, n_row = nodes.at.size, bodies.n_local, bodies.load.shape[0]
    first = i * n_local
    is_hard = bodies.normal_law[i] == LAGRANGE
    for k in range(first_node, s):
        row, is_last, changed = i * s + k, k == s - 1, solution.changed[k]
        normal, tangent, seen, bent = (
            solution.normal[row],
            solution.tangent[row],
            solution.seen[row],
            solution.bent[row],
        )
        gap = 0.0
        for a in range(n_local):
            gap += normal[a] * moved[k, first + a]
        changed[GAP] = gap
        rates, v = (begun, n_row + first) if k == 0 else (change, rate_row(s, n_local, i, k))
        twist = begun[first + TWIST] if k == 0 else change[place_row(s, n_local, i, k) + TWIST]
        rate, across, turned, sideways = 0.0, 0.0, 0.0, 0.0
        for a in range(n_local):
            rate += normal[a] * rates[v + a] + bent[OF_RATE, a] * moved[k, first + a]
            sideways -= bent[OF_SLIP, a] * moved[k, first + a]
            if a != TWIST:
                across += tangent[a] * rates[v + a]
                turned += tangent[a] * moved[k, first + a]
        across += sideways
        if bodies.kind[i] == ROUND:
            turned *= bodies.radius[i] * solution.curvature[row]
        else:
            turned = moved[k, first + ACROSS]
        changed[RATE], changed[SLIP], changed[TURNED] = rate, rates[v + TWIST] - across, twist - turned
        bow = solution.curvature[row]
        widened = (1.0 - seen[GAP] * bow) * (seen[WIDENED] / seen[GAP] if seen[GAP] != 0.0 else 0.0)
        changed[WIDENED] = widened * gap + seen[GAP] * bow * across
        if is_last and not is_hard:
            total, at = 0.0, bend_row(s, n_local, i)
            for a in range(n_local):
                total += normal[a] * change[at + a] + 2.0 * bent[OF_RATE, a] * rates[v + a]
                total += bent[OF_BEND, a] * moved[k, first + a]
            changed[BEND] = total


@linked_sum
def change_residual(
    bodies: Bodies,
    nodes: Nodes,
    tables: Tables,
    slot: int,
    state: Ints,
    force: Floats,
    i: int,
    pushed: Floats,
    row: int,
    target: Floats,
    solution: Solution,
) -> int:
    """Fill the change of a pair's residuals, from `row` on in `target`; returns the row after them.

    From what changes of the pair (`changed`), and of its forces, `pushed` (2, s).
    """
    s, fade, step = nodes.at.size, tables.fade[slot], tables.tick * 2.0 ** (tables.first_level + slot)
    changed, n, slope = solution.changed, force[i, NORMAL], solution.slope
    first, end, is_hard = changed[0], changed[s - 1], bodies.normal_law[i] == LAGRANGE
    if is_hard:
        for k in range(1, s):
            target[row + k - 1] = changed[k, GAP] - fade[k, 0] * first[GAP] - fade[k, 1] * first[RATE]
        rate = end[RATE] - fade[s - 1, 2] * first[GAP] - fade[s - 1, 3] * first[RATE]
        target[row + s - 1] = step * rate
    else:
        grown = 0.0
        for k in range(1, s):
            by = slope[i * s + k]
            target[row + k - 1] = (
                pushed[NORMAL, k] - by[BY_GAP] * changed[k, GAP] - by[BY_RATE] * changed[k, RATE]
            )
        for k in range(s):
            grown += nodes.end_slope[k] * pushed[NORMAL, k]
        by, seen = slope[i * s + s - 1], solution.seen[i * s + s - 1]
        grown -= step * (by[BY_GAP] * end[RATE] + by[BY_RATE] * end[BEND])
        grown -= step * seen[RATE] * (by[BY_GAP_TWICE] * end[GAP] + by[BY_BOTH] * end[RATE])
        target[row + s - 1] = grown - step * seen[BEND] * by[BY_BOTH] * end[GAP]
    row += s
    if state[i] == STICKING:
        for k in range(1, s):
            at, path = nodes.at[k], changed[k, TURNED] - first[TURNED] - fade[k, 1] * first[SLIP]
            if is_hard:
                path -= step * at * (first[WIDENED] + 0.5 * at * (end[WIDENED] - first[WIDENED]))
            else:
                for j in range(s):
                    path -= step * nodes.integral[k, j] * changed[j, WIDENED]
            target[row + k - 1] = path
        target[row + s - 1] = step * (end[SLIP] - fade[s - 1, 3] * first[SLIP])
        row += s
    elif bodies.is_varied:
        for k in range(s):
            ratio = solution.ratio[i * s + k]
            grown = ratio[RATIO] * pushed[NORMAL, k] + n[k] * ratio[RATIO_SLOPE] * changed[k, SLIP]
            target[row + k] = pushed[FRICTION, k] - state[i] * grown
        row += s
    return row


@linked_sum
def fill_column(
    bodies: Bodies,
    nodes: Nodes,
    tables: Tables,
    slot: int,
    state: Ints,
    force: Floats,
    n_closed: int,
    col: int,
    solution: Solution,
) -> None:
    """Fill a column of the matrix by the changes `change`, `moved` and `pushed` of one unknown."""
    s, n_local, row = nodes.at.size, bodies.n_local, 0
    target, change, moved = solution.residual, solution.change, solution.moved
    if bodies.is_straight:
        for c in range(n_closed):
            i = solution.closed[c]
            for k in range(1, s):
                for a in range(n_local):
                    moved[k, i * n_local + a] = change[place_row(s, n_local, i, k) + a]
    for c in range(n_closed):
        i = solution.closed[c]
        change_pair(bodies, nodes, i, 1, solution.begun, change, moved, solution)
        row = change_residual(
            bodies, nodes, tables, slot, state, force, i, solution.pushed[i], row, target, solution
        )
    for c in range(0 if bodies.is_straight else n_closed):
        i = solution.closed[c]
        for k in range(1, s):
            for a in range(n_local):
                if a != TWIST:
                    target[row] = moved[k, i * n_local + a] - change[place_row(s, n_local, i, k) + a]
                    row += 1
    column = solution.matrix[solution.used[0], col]  # the matrix is kept transposed
    for r in range(row):
        column[r] = target[r]


@linked_sum
def fill_matrix(
    bodies: Bodies,
    nodes: Nodes,
    tables: Tables,
    slot: int,
    state: Ints,
    force: Floats,
    n_closed: int,
    blocks: tuple[int, int],
    solution: Solution,
) -> bool:
    """Make the matrix of the equations, and its inverse; False where it is singular."""
    s, n_local, n_row = nodes.at.size, bodies.n_local, bodies.load.shape[0]
    forced, change, moved, pushed, col = (
        tables.forced[slot],
        solution.change,
        solution.moved,
        solution.pushed,
        0,
    )
    listed = (0, n_closed)
    fill_slopes(bodies, nodes, state, force, n_closed, solution)
    for r in range(solution.begun.size):
        solution.begun[r] = 0.0
    for k in range(6):
        solution.changed[0, k] = 0.0
    for k in range(s):
        for r in range(n_row):
            moved[k, r] = 0.0
    for i in range(pushed.shape[0]):
        for k in range(s):
            pushed[i, NORMAL, k], pushed[i, FRICTION, k] = 0.0, 0.0
    for c in range(n_closed):
        i = solution.closed[c]
        for f in range(n_force(bodies, state[i])):
            for k in range(s):
                for r in range(change.size):
                    change[r] = 0.0
                for a in range(n_local):
                    size, row = solution.direction[i * s + k, f, a], forced[k * n_row + i * n_local + a]
                    add_response(bodies, s, size, row, blocks, listed, change, solution)
                pushed[i, f, k] = 1.0
                fill_column(bodies, nodes, tables, slot, state, force, n_closed, col, solution)
                pushed[i, f, k] = 0.0
                col += 1
    for c in range(0 if bodies.is_straight else n_closed):
        i = solution.closed[c]
        for k in range(1, s):
            for b in range(n_local):
                if b == TWIST:
                    continue
                for r in range(change.size):
                    change[r] = 0.0
                for a in range(n_local):
                    size, row = solution.turning[i * s + k, a, b], forced[k * n_row + i * n_local + a]
                    if size != 0.0:
                        add_response(bodies, s, size, row, blocks, listed, change, solution)
                moved[k, i * n_local + b] = 1.0
                fill_column(bodies, nodes, tables, slot, state, force, n_closed, col, solution)
                moved[k, i * n_local + b] = 0.0
                col += 1
    return invert(solution.matrix[solution.used[0]], solution.pivot, col)


@linked_sum
def noise_of(
    bodies: Bodies,
    nodes: Nodes,
    state: Ints,
    n_closed: int,
    n_pushed: int,
    n: int,
    solution: Solution,
) -> float:
    """Largest force that the rounding of displacements causes, N."""
    s, residual, size, row = nodes.at.size, solution.residual, 0.0, 0
    for k in range(1, s):
        for r in range(bodies.load.shape[0]):
            size = max(size, abs(solution.place[k, r]))
    for r in range(n):
        residual[r] = 0.0
    for c in range(n_closed):
        i = solution.closed[c]
        for f in range(n_force(bodies, state[i])):
            if (f == NORMAL and bodies.normal_law[i] == LAGRANGE) or (f == FRICTION and state[i] == STICKING):
                for k in range(s):
                    residual[row + k] = ROUNDING * size * (1.0 if k % 2 == 0 else -1.0)
            row += s
    multiply(solution.matrix[solution.used[0]], n, residual, solution.answer)
    noise = 0.0
    for r in range(n_pushed):
        noise = max(noise, abs(solution.answer[r]))
    return noise


@linked_sum
def code_of(state: Ints) -> int:
    """States of the pairs as one number, not zero where a pair is closed."""
    code = 0
    for i in range(state.size):
        code = code * 7 + state[i] + 2
    return code


@linked_sum
def use_matrix(bodies: Bodies, tables: Tables, slot: int, state: Ints, solution: Solution) -> int:
    """Point at the matrix of a length of step and of states, with which it is made unless it was so before.

    Of straight gaps several are kept for each length of step: they do not change with the motion.
    """
    code = code_of(state)
    n_way = solution.states.size // tables.is_filled.size
    way = code % n_way if bodies.is_straight else 0
    used = slot * n_way + way
    if solution.states[used] != code:
        solution.states[used] = 0
    solution.used[0] = used
    return code


@linked_sum
def see_gaps(bodies: Bodies, nodes: Nodes, n_closed: int, solution: Solution) -> None:
    """See the gaps of the closed pairs at the displacements of the nodes after the first."""
    for c in range(n_closed):
        i = solution.closed[c]
        for k in range(1, nodes.at.size):
            see_gap(bodies, i, solution.place[k], i * bodies.n_local, i * nodes.at.size + k, solution)


@linked_sum
def follow_loads(bodies: Bodies, nodes: Nodes, n_closed: int, solution: Solution) -> None:
    """Take the displacements of the closed pairs at the nodes from y."""
    s, n_local = nodes.at.size, bodies.n_local
    for c in range(n_closed):
        i = solution.closed[c]
        for k in range(1, s):
            for a in range(n_local):
                solution.place[k, i * n_local + a] = solution.y[place_row(s, n_local, i, k) + a]


@linked_sum
def take_step(
    bodies: Bodies,
    nodes: Nodes,
    tables: Tables,
    slot: int,
    x: Floats,
    state: Ints,
    force: Floats,
    tolerance: float,
    is_whole: bool,
    is_exact: bool,
    solution: Solution,
) -> int:
    """Solve a step from the coordinates x: `force` (q, 2, s), a guess, becomes the solution.

    Returns the number of iterations, negative where they do not converge. `tolerance` is that of forces, N.
    Where it is not `is_whole`, velocities at the nodes between may be left out; where `is_exact`, the matrix
    is that at the solution, for the tangent.
    """
    s, n_local, n_row = nodes.at.size, bodies.n_local, bodies.load.shape[0]
    n_closed, n_pushed, n = list_closed(bodies, nodes, state, solution)
    place, residual, load, states = solution.place, solution.residual, solution.load, solution.states
    answer = solution.answer
    is_lean, is_linear = not bodies.is_varied, bodies.is_straight and not bodies.is_varied
    for c in range(n_closed):
        law = bodies.normal_law[solution.closed[c]]
        is_lean, is_linear = is_lean and law == LAGRANGE, is_linear and law != HERTZ
    n_block, free = 2 * s - 1, tables.free[slot]
    used_blocks = (0, s if is_lean else n_block)
    step, forced = tables.tick * 2.0 ** (tables.first_level + slot), tables.forced[slot]
    code = use_matrix(bodies, tables, slot, state, solution)
    used = solution.used[0]
    see_motions(bodies, x, 2 * n_row, solution)
    listed = (0, n_closed)
    move_freely(bodies, s, free, x, used_blocks, listed, solution.y_free, solution)
    for a in range(load.size):
        load[a] = 0.0
    for r in range(n_row):
        place[0, r] = solution.start[r]
    for c in range(n_closed):  # loads as at the beginning, to find the first displacements
        i = solution.closed[c]
        for k in range(s):
            see_gap(bodies, i, place[0], i * n_local, i * s + k, solution)
    push_closed(bodies, nodes, state, force, n_closed, solution)
    respond(bodies, s, forced, n_closed, used_blocks, listed, load, solution)
    follow_loads(bodies, nodes, n_closed, solution)
    last, largest, iteration, is_solved, is_fresh = np.inf, 0.0, 0, False, False
    while iteration < MOST_ITERATIONS:
        iteration += 1
        if not bodies.is_straight:
            see_gaps(bodies, nodes, n_closed, solution)
        if not bodies.is_straight or iteration > 1:
            push_closed(bodies, nodes, state, force, n_closed, solution)
            respond(bodies, s, forced, n_closed, used_blocks, listed, load, solution)
        if bodies.is_straight:
            follow_loads(bodies, nodes, n_closed, solution)
            see_gaps(bodies, nodes, n_closed, solution)
        if is_solved:
            if is_whole:
                n_near = list_near(bodies, nodes, step, x, state, n_closed, solution)
                near, rest = (0, n_near), (used_blocks[1] if n_near == n_closed else 0, n_block)
                move_freely(bodies, s, free, x, (used_blocks[1], n_block), listed, solution.y_free, solution)
                move_freely(bodies, s, free, x, (0, n_block), (n_closed, n_near), solution.y_free, solution)
                respond(bodies, s, forced, n_closed, rest, near, load, solution)
                solution.used[1] = n_near
            for c in range(n_closed):
                see_pair(bodies, nodes, solution.closed[c], is_lean and not is_whole, solution)
            if not is_exact:
                return iteration
            if is_linear:
                fill_slopes(bodies, nodes, state, force, n_closed, solution)
                return iteration
        fill_residual(bodies, nodes, tables, slot, state, force, n_closed, is_lean, solution)
        if states[used] == 0 or is_solved:
            states[used] = 0
            if not fill_matrix(bodies, nodes, tables, slot, state, force, n_closed, used_blocks, solution):
                return -iteration
            states[used], is_fresh = code, True
            solution.noise[used] = noise_of(bodies, nodes, state, n_closed, n_pushed, n, solution)
            if is_solved:
                return iteration
            fill_residual(bodies, nodes, tables, slot, state, force, n_closed, is_lean, solution)
        multiply(solution.matrix[used], n, residual, answer)
        change, largest, row = 0.0, 0.0, 0
        for r in range(n_pushed):
            change = max(change, abs(answer[r]))
        if not change < 1e200:
            states[used] = 0
            return -iteration
        for c in range(n_closed):
            i = solution.closed[c]
            for f in range(n_force(bodies, state[i])):
                for k in range(s):
                    force[i, f, k] -= answer[row + k]
                    if f == NORMAL:
                        largest = max(largest, abs(force[i, f, k]))
                row += s
        for c in range(0 if bodies.is_straight else n_closed):
            first = solution.closed[c] * n_local
            for k in range(1, s):
                for a in range(n_local):
                    if a != TWIST:
                        place[k, first + a] -= answer[row]
                        row += 1
        floor = max(tolerance, solution.noise[used])
        if is_linear or change <= floor or (iteration > 1 and change * min(1.0, change / last) <= tolerance):
            is_solved = True
        elif iteration > 3 and change > 0.1 * last and (change < 1e-7 * largest or change < 30.0 * floor):
            is_solved = True  # rounding: no further progress
        elif iteration > 1 and change > SLOW * last and (not is_fresh or iteration > 2):
            states[used] = 0
        last, is_fresh = change, False
    states[used] = 0
    return -iteration
