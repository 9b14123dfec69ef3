"""Work of friction over a span between two events."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.contact_modes import ModeTables, copy_coordinates, dot, used_width
from rubhpc.kernels.coordinate_steps import turn_on
from rubhpc.kernels.cubics import turning_value
from rubhpc.kernels.event_search import longest_move, move_stuck
from rubhpc.kernels.friction_states import FrictionBodies, stuck_pairs

if TYPE_CHECKING:
    from rubhpc.kernels.case_progress import Clock

Floats = NDArray[np.float64]

N_PANEL = 6
# Of a closed rule of Newton and Cotes with seven nodes, and of one with every other of them.
WEIGHT = (41 / 840, 216 / 840, 27 / 840, 272 / 840, 27 / 840, 216 / 840, 41 / 840)
COARSE = (1 / 8, 0.0, 3 / 8, 0.0, 3 / 8, 0.0, 1 / 8)
AGREEING = 5e-3  # difference of both, over that of the largest force and slip: the first errs far less
SHORTER = 4  # ratio of lengths
FOLLOWED = 4e-4  # of a signal's size: its eighth derivative times the panel to the eighth


@linked_sum
def rub_through(
    tables: ModeTables,
    bodies: FrictionBodies,
    clock: Clock,
    mode: int,
    i: int,
    n_tick: int,
    begun: Floats,
    z: Floats,
    path: Floats,
) -> tuple[float, float, float]:
    """Integral (N m) of force times slip of sliding pair i over a span, by a quadrature, least and most slip.

    The slip (m/s) is that in its sense. The span has `n_tick` ticks, begins with `begun` and ends with `z`
    (2, m); `path` (4, 2, m) is work space.

    Force and slip are taken as what they are at the beginning of a part and a rest. Three of the products of
    these have integrals in closed form, and what an event sets off for a short time enters the quadrature of
    the fourth with its square. Parts in which two rules differ are taken shorter.
    """
    used, states = used_width(tables, mode), tables.mask[mode]
    start, at, stride = path[1], path[2], path[3]
    power_re, power_im = tables.power_re[mode], tables.power_im[mode]
    force_re, force_im = tables.switch_re[mode, 2 * i], tables.switch_im[mode, 2 * i]
    slip_re, slip_im = tables.switch_re[mode, 2 * i + 1], tables.switch_im[mode, 2 * i + 1]
    rate_re, rate_im = tables.rate_re[mode, 2 * i + 1], tables.rate_im[mode, 2 * i + 1]
    copy_coordinates(begun, start)
    copy_coordinates(begun, at)
    stride_re, stride_im = stride[0, :used], stride[1, :used]
    before = dot(slip_re, slip_im, start[0], start[1])
    total, least, most, left, known = 0.0, before, before, n_tick, -1
    reach = min(n_tick, longest_move(tables))
    longest = max(1, int(min(resolved_panel(tables, mode, i, start) / clock.tick, 1.0 * reach)))
    panel = even_panel(left, longest)
    while left >= N_PANEL:
        if panel != known:
            for k in range(used):
                stride_re[k], stride_im[k] = 1.0, 0.0
            turn_on(panel, power_re, power_im, stride_re, stride_im)
            known = panel
        first_force, first_slip, rate = 0.0, 0.0, 0.0
        x_re, x_im, y_re, y_im = start[0, :used], start[1, :used], at[0, :used], at[1, :used]
        for k in range(used):
            x, y = x_re[k], x_im[k]
            y_re[k], y_im[k] = x, y
            first_force += force_re[k] * x - force_im[k] * y
            first_slip += slip_re[k] * x - slip_im[k] * y
            rate += rate_re[k] * x - rate_im[k] * y
        time, before = panel * clock.tick, first_slip
        fine, coarse, largest_force, largest_slip = 0.0, 0.0, abs(first_force), abs(first_slip)
        low = high = first_slip
        for node in range(1, N_PANEL + 1):
            force, slip, next_rate = 0.0, 0.0, 0.0
            if stuck_pairs(states) != 0:
                move_stuck(states, tables.n_eigenmode[mode], bodies.rim_speed, time, y_re)
            for k in range(used):
                u, v = y_re[k], y_im[k]
                x, y = stride_re[k] * u - stride_im[k] * v, stride_re[k] * v + stride_im[k] * u
                y_re[k], y_im[k] = x, y
                force += force_re[k] * x - force_im[k] * y
                slip += slip_re[k] * x - slip_im[k] * y
                next_rate += rate_re[k] * x - rate_im[k] * y
            product = (force - first_force) * (slip - first_slip)
            fine += WEIGHT[node] * product
            coarse += COARSE[node] * product
            largest_force, largest_slip = max(largest_force, abs(force)), max(largest_slip, abs(slip))
            low, high = min(low, slip), max(high, slip)
            if rate * next_rate < 0.0:
                turning = turning_value(before, rate, slip, next_rate, time)
                low, high = min(low, turning), max(high, turning)
            before, rate = slip, next_rate
        if panel > 1 and abs(fine - coarse) > AGREEING * largest_force * largest_slip:
            panel = max(1, panel // SHORTER)
            continue
        time *= N_PANEL
        gained, way = gains(tables, mode, i, time, start, at)
        total += (fine - first_force * first_slip) * time + gained * first_slip + way * first_force
        least, most = min(least, low), max(most, high)
        left -= N_PANEL * panel
        panel = min(panel * SHORTER, even_panel(left, longest))
        start, at = at, start
    gained, _ = gains(tables, mode, i, left * clock.tick, start, z)
    return total + gained * before, least, most


@linked_sum
def even_panel(left: int, longest: int) -> int:
    """Ticks of a panel, `longest` at most, for as few equal parts as those that are left need."""
    n_part = max(1, (left + N_PANEL * longest - 1) // (N_PANEL * longest))
    return max(1, left // (N_PANEL * n_part)) if left >= N_PANEL else 0


@linked_sum
def resolved_panel(tables: ModeTables, mode: int, i: int, z: Floats) -> float:
    """Length of a panel, s, by which the quadrature follows force and slip of sliding pair i from (2, m).

    Its error goes as an eighth derivative. Coordinates that decay fast without vibration are left out: two
    rules differ where those matter, while a vibration may have the same phase at all nodes.
    """
    pace, eighth = tables.pace[mode], np.inf
    for j in range(2 * i, 2 * i + 2):
        re, im, turn = tables.switch_re[mode, j], tables.switch_im[mode, j], tables.turn[mode, j]
        least = -np.inf if j == 2 * i else 0.0  # of the slip, but for that of the steady spin
        whole, bend = 0.0, 0.0
        for k in range(z.shape[1]):
            if turn[k] >= 0.0 and pace[k] > least:
                part = (abs(re[k]) + abs(im[k])) * (abs(z[0, k]) + abs(z[1, k]))
                fourth = pace[k] * pace[k] * pace[k] * pace[k]
                whole += part
                bend += part * fourth * fourth
        if bend > 0.0:
            eighth = min(eighth, whole / bend)
    return float(np.sqrt(np.sqrt(np.sqrt(FOLLOWED * eighth))))


@linked_sum
def gains(
    tables: ModeTables, mode: int, i: int, time: float, here: Floats, there: Floats
) -> tuple[float, float]:
    """Integrals of both switch functions of pair i between coordinates (2, m), a `time` (s) apart.

    What a coordinate adds to an integral is the change of its primitive; where it has none, since it does not
    move or grows linearly, its mean times the time.
    """
    first, second = 0.0, 0.0
    for j in range(2 * i, 2 * i + 2):
        re, im, whole_re, whole_im = (
            tables.switch_re[mode, j],
            tables.switch_im[mode, j],
            tables.primitive_re[mode, j],
            tables.primitive_im[mode, j],
        )
        gained, still = 0.0, 0.0
        for k in range(here.shape[1]):
            x, y, u, v = there[0, k], there[1, k], here[0, k], here[1, k]
            gained += whole_re[k] * (x - u) - whole_im[k] * (y - v)
            both = re[k] * (x + u) - im[k] * (y + v)
            still += both if whole_re[k] == 0.0 and whole_im[k] == 0.0 else 0.0
        gained += 0.5 * time * still
        first, second = (gained, second) if j == 2 * i else (first, gained)
    return first, second
