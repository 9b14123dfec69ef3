"""The equations of a step of closed contacts: forces that obey the laws at the nodes; and their slopes.

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

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.collocation.gaps import see_bend, slip_path
from rubhpc.kernels.collocation.laws import sliding_coefficient, spring_force
from rubhpc.kernels.collocation.motions import n_force
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
        elif bodies.depends_on_slip:
            for k in range(s):
                residual[row + k] = t[k] - state[i] * sliding_coefficient(bodies, i, seen[k, SLIP])[0] * n[k]
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
            if bodies.depends_on_slip and state[i] != STICKING:
                solution.ratio[row, RATIO], solution.ratio[row, RATIO_SLOPE] = sliding_coefficient(
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
    elif bodies.depends_on_slip:
        for k in range(s):
            ratio = solution.ratio[i * s + k]
            grown = ratio[RATIO] * pushed[NORMAL, k] + n[k] * ratio[RATIO_SLOPE] * changed[k, SLIP]
            target[row + k] = pushed[FRICTION, k] - state[i] * grown
        row += s
    return row
