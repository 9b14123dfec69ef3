"""Small changes of a motion through its pieces: exponentials, and saltation matrices at events."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum, linked_sum
from rubhpc.kernels._struct import Struct
from rubhpc.kernels.closed_form.flow import GRADIENT, RATE_BEGUN, RATE_ENDED
from rubhpc.kernels.closed_form.mode_change import AT_REST, product
from rubhpc.kernels.closed_form.revolutions import AFTER, PieceModes, PieceRows
from rubhpc.kernels.contact_modes import Reduced, add_rows, find_mode
from rubhpc.kernels.coordinate_steps import floor_log2
from rubhpc.kernels.elimination import eliminate

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ALL_CARRIED = -1
NO_IMPULSE = 1e-12  # of the largest impulse of an event


class ChangeRoom(Struct):
    """Work space for k small changes; m coordinates, n reduced degrees, q pairs."""

    z_re: Floats  # (m, k), their coordinates
    z_im: Floats
    weight: Floats  # (2, 2 n), what a motion adds to a coordinate
    row: Floats  # (k,), what they do to a switch function, over its rate
    jump: Floats  # (2 n,), rate of the motion after an event less what the impact makes of that before
    pair: Ints  # (q,), those with an impulse in an impact
    rows: Floats  # (q, q + n), these impulses by the velocities before, behind a matrix
    impulse: Floats  # (q, k)


def change_room(m: int, n: int, q: int, k: int) -> ChangeRoom:
    """Room for k changes."""
    return ChangeRoom(
        z_re=np.empty((m, k)),
        z_im=np.empty((m, k)),
        weight=np.empty((2, 2 * n)),
        row=np.empty(k),
        jump=np.empty(2 * n),
        pair=np.empty(q, dtype=np.int64),
        rows=np.empty((q, q + n)),
        impulse=np.empty((q, k)),
    )


@jit_sum
def carry_pieces(
    modes: PieceModes,
    reduced: Reduced,
    rows: PieceRows,
    first: int,
    last: int,
    room: ChangeRoom,
    columns: Floats,
    kept: Floats,
) -> int:
    """Carry small changes through the pieces from `first` up to `last`, which is not among them.

    Through a piece they go as `Re(M exp(Lambda t) E)`, with the entry E into the contact mode and its motions
    M; an event applies `S = DR + (f+ - DR f-) (grad h)^T / (dh/dt)`, with h the switch function that
    vanishes, dh/dt its rate before the event, f the rate of the motion and DR the derivative of the impact
    (Leine and Nijmeijer 2004).

    Parameters
    ----------
    columns : (2 n, k)
        Changes of the motion with which piece `first` begins; in place.
    kept : (p, 2 n, k)
        Filled in: what they are after each piece and the event that ends it; of none where p is 0.

    Returns
    -------
    int
        The piece before which they are, whose contact mode is not known; or `ALL_CARRIED`.
    """
    for k in range(first, last):
        place = find_mode(modes.mask, rows.states[k, 0])
        if place < 0 or not modes.is_known[place]:
            return k
        move_changes(
            modes.n_moving[place],
            modes.exponent[place],
            modes.enter_re[place],
            modes.enter_im[place],
            modes.shape_re[place],
            modes.shape_im[place],
            rows.times[k, 1],
            room,
            columns,
        )
        if rows.states[k, 2] != 0:  # nothing jumps where a pair opens
            saltate(
                reduced,
                rows.states[k],
                rows.motions[k],
                rows.rates[k],
                rows.given[k],
                rows.motions[k + 1, RATE_BEGUN],
                room,
                columns,
            )
        if kept.shape[0] > 0:
            for row in range(columns.shape[0]):
                for j in range(columns.shape[1]):
                    kept[k - first, row, j] = columns[row, j]
    return ALL_CARRIED


@linked_sum
def move_changes(
    n_moving: int,
    exponent: Floats,
    enter_re: Floats,
    enter_im: Floats,
    shape_re: Floats,
    shape_im: Floats,
    duration: float,
    room: ChangeRoom,
    columns: Floats,
) -> None:
    """Carry changes (2 n, k) for a time, s, in a contact mode whose first `n_moving` coordinates move."""
    n_column, z_re, z_im = columns.shape[1], room.z_re, room.z_im
    from_re, from_im = room.weight[0], room.weight[1]
    for i in range(n_moving):
        growth = np.exp(exponent[0, i] * duration)
        turn = exponent[1, i] * duration
        cosine, sine = growth * np.cos(turn), growth * np.sin(turn)
        re, im = z_re[i], z_im[i]
        for j in range(n_column):
            re[j], im[j] = 0.0, 0.0
        for row in range(from_re.size):
            from_re[row], from_im[row] = enter_re[row, i], enter_im[row, i]
        add_rows_twice(columns, from_re, from_im, re, im)
        for j in range(n_column):
            a, b = re[j], im[j]
            re[j] = cosine * a - sine * b
            im[j] = -(cosine * b + sine * a)  # its negative: the real part of a product is a sum
    n = columns.shape[0] // 2
    for row in range(n):  # displacement and velocity of a degree
        first, second = columns[row], columns[n + row]
        for j in range(n_column):
            first[j], second[j] = 0.0, 0.0
        for part in range(2):
            shape, z = (shape_re, z_re) if part == 0 else (shape_im, z_im)
            add_rows_twice(z, shape[row, :n_moving], shape[n + row, :n_moving], first, second)


@linked_sum
def add_rows_twice(rows: Floats, a: Floats, b: Floats, first: Floats, second: Floats) -> None:
    """Add rows (k or more, m), times values (k,), to two targets (m,) of their own: four rows at a time."""
    n_whole = a.size - a.size % 4
    for row in range(0, n_whole, 4):
        w, x, y, z = rows[row], rows[row + 1], rows[row + 2], rows[row + 3]
        a_w, a_x, a_y, a_z = a[row], a[row + 1], a[row + 2], a[row + 3]
        b_w, b_x, b_y, b_z = b[row], b[row + 1], b[row + 2], b[row + 3]
        for j in range(first.size):
            first[j] += a_w * w[j] + a_x * x[j] + a_y * y[j] + a_z * z[j]
            second[j] += b_w * w[j] + b_x * x[j] + b_y * y[j] + b_z * z[j]
    for row in range(n_whole, a.size):
        last, a_w, b_w = rows[row], a[row], b[row]
        for j in range(first.size):
            first[j] += a_w * last[j]
            second[j] += b_w * last[j]


@linked_sum
def saltate(
    reduced: Reduced,
    states: Ints,
    motions: Floats,
    rates: Floats,
    given: Floats,
    rate_begun: Floats,
    room: ChangeRoom,
    columns: Floats,
) -> None:
    """Apply the saltation matrix of the event that ends a piece to changes (2 n, k).

    Parameters
    ----------
    states, motions, rates, given
        Of the piece, as `revolutions.PieceRows` has them.
    rate_begun : (2 n,)
        Rate of the motion after the event.
    """
    n, row, jump = reduced.damping.shape[0], room.row, room.jump
    rate = rates[floor_log2(states[1] & -states[1])]
    for j in range(row.size):
        row[j] = 0.0
    add_rows(columns, motions[GRADIENT], row)
    for i in range(jump.size):
        jump[i] = motions[RATE_ENDED, i]
    n_impulse = impulses_of(reduced, given, motions[AFTER, n:], room)
    for i in range(n_impulse):
        gain, direction, impulse = gain_of(room, i), reduced.force_direction[room.pair[i]], room.impulse[i]
        strength = product(gain, motions[RATE_ENDED, n:])
        for k in range(n):
            jump[n + k] -= direction[k] * strength
        for j in range(row.size):
            impulse[j] = 0.0
        add_rows(columns[n:], gain, impulse)
    for i in range(n_impulse):
        direction, impulse = reduced.force_direction[room.pair[i]], room.impulse[i]
        for k in range(n):
            along, target = direction[k], columns[n + k]
            for j in range(row.size):
                target[j] -= along * impulse[j]
    for i in range(jump.size):
        change, target = (rate_begun[i] - jump[i]) / rate, columns[i]
        for j in range(row.size):
            target[j] += change * row[j]


@linked_sum
def gain_of(room: ChangeRoom, i: int) -> Floats:
    """Impulse i, by the velocities before it, (n,)."""
    return room.rows[i, room.rows.shape[0] :]


@linked_sum
def impulses_of(reduced: Reduced, given: Floats, velocity: Floats, room: ChangeRoom) -> int:
    """Fill in what an impact makes of velocities: `dv+ = dv- - F (R F)^-1 R dv-`; returns the rows of R.

    The rows R are those of the gap velocities that impulses change, each times 1 + restitution where the pair
    parts; F are the directions of the impulses of these pairs (`room.pair`), friction included, and `gain_of`
    has the rows of `(R F)^-1 R`. `given` (q,) are the impulses, `velocity` (n,) is what they leave.
    """
    q, n = reduced.gap_jacobian.shape
    largest = 0.0
    for i in range(q):
        largest = max(largest, abs(given[i]))
    if largest == 0.0:
        return 0
    n_row, pair, rows = 0, room.pair, room.rows
    for i in range(q):
        if given[i] > NO_IMPULSE * largest:
            pair[n_row] = i
            n_row += 1
    for a in range(n_row):
        gap = reduced.gap_jacobian[pair[a]]
        parts = abs(product(gap, velocity)) > AT_REST
        scale = 1.0 + reduced.restitution if parts else 1.0
        for b in range(q):
            rows[a, b] = reduced.delassus[pair[a], pair[b]] if b < n_row else 0.0
        for k in range(n):
            rows[a, q + k] = scale * gap[k]
    eliminate(rows, n_row)
    return n_row
