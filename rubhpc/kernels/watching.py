"""Gaps and forces along a periodic motion, and how small changes of its section change them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum, linked_sum
from rubhpc.kernels._struct import Struct
from rubhpc.kernels.contact_modes import Reduced, add_rows, find_mode
from rubhpc.kernels.linear_theory import BEGINS, ENDS, FIRST, LAST
from rubhpc.kernels.revolutions import AFTER, PieceModes, PieceRows
from rubhpc.kernels.small_changes import ALL_CARRIED, ChangeRoom, add_rows_twice, carry_pieces

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

PIECE, N_TIME, N_PART = range(3)  # items of `reached`


class Watching(Struct):
    """What is filled in along the pieces of a period, all in place, and its work space; k pieces."""

    n_time: Ints  # (k,), times at which its gaps and forces are taken, in the middle of as many equal parts
    reached: Ints  # (3,), pieces, times and parts filled in
    columns: Floats  # (2 n, 2 n), derivative of the motion with which the piece begins by that at the section
    begun: Floats  # (2 n,), motion with which the piece begins
    parts: Ints  # (q k, 4)
    value: Floats  # (t,)
    change: Floats  # (t, 2 n), by the motion at the section
    none_kept: Floats  # (0, 2 n, 2 n)
    coordinates: Floats  # (2, m)
    passing: Floats  # (4, m)


def begin_watching(motion: Floats, n_time: Ints, q: int, m: int) -> Watching:
    """Begin with the motion (2 n,) at the section."""
    most, width = q * int(n_time.sum()), motion.size
    return Watching(
        n_time=n_time,
        reached=np.zeros(3, dtype=np.int64),
        columns=np.eye(width),
        begun=motion.copy(),
        parts=np.empty((q * n_time.size, 4), dtype=np.int64),
        value=np.empty(most),
        change=np.empty((most, width)),
        none_kept=np.empty((0, width, width)),
        coordinates=np.empty((2, m)),
        passing=np.empty((4, m)),
    )


@jit_sum
def watch_pieces(
    modes: PieceModes,
    reduced: Reduced,
    spin: float,
    rows: PieceRows,
    watching: Watching,
    room: ChangeRoom,
) -> int:
    """Fill in what is watched along the pieces of a period (`linear_theory.Watched`).

    Returns
    -------
    int
        The piece whose contact mode is not known, or `ALL_CARRIED`.
    """
    n_time, reached, begun = watching.n_time, watching.reached, watching.begun
    columns, parts, coordinates = watching.columns, watching.parts, watching.coordinates
    n_piece, m = n_time.size, coordinates.shape[1]
    while reached[PIECE] < n_piece:
        k = reached[PIECE]
        place = find_mode(modes.mask, rows.states[k, 0])
        if place < 0 or not modes.is_known[place]:
            return int(k)
        angle, n_moving = spin * rows.times[k, 0], modes.n_moving[place]
        enter_changes(n_moving, modes.enter_re[place], modes.enter_im[place], room, columns)
        for part in range(2):
            entered, offset = coordinates[part], modes.offset[place, part]
            for i in range(m):
                entered[i] = offset[0, i] * np.cos(angle) + offset[1, i] * np.sin(angle) + offset[2, i]
            add_rows(modes.enter_re[place] if part == 0 else modes.enter_im[place], begun, entered)
        step = rows.times[k, 1] / n_time[k]
        before = k - 1 if k > 0 else n_piece - 1
        begins = rows.states[before, 1] != 0 and rows.states[before, 0] != rows.states[k, 0]
        for j in range(modes.bound.shape[1]):
            first, part = reached[N_TIME], reached[N_PART]
            parts[part, FIRST], parts[part, LAST] = first, first + n_time[k]
            parts[part, BEGINS], parts[part, ENDS] = begins, (rows.states[k, 1] >> j) & 1
            watch_function(
                n_moving,
                modes.exponent[place],
                modes.switch_re[place, j],
                modes.switch_im[place, j],
                step,
                coordinates,
                watching.passing,
                room,
                watching.value[first : first + n_time[k]],
                watching.change[first : first + n_time[k]],
            )
            reached[N_TIME], reached[N_PART] = first + n_time[k], part + 1
        carry_pieces(modes, reduced, rows, int(k), int(k + 1), room, columns, watching.none_kept)
        for i in range(begun.size):
            begun[i] = rows.motions[k, AFTER, i]
        reached[PIECE] = k + 1
    return ALL_CARRIED


@linked_sum
def enter_changes(
    n_moving: int, enter_re: Floats, enter_im: Floats, room: ChangeRoom, columns: Floats
) -> None:
    """Fill `room.z_re` and `room.z_im` with the coordinates of changes (2 n, k) in a contact mode."""
    from_re, from_im = room.weight[0], room.weight[1]
    for i in range(n_moving):
        re, im = room.z_re[i], room.z_im[i]
        for j in range(columns.shape[1]):
            re[j], im[j] = 0.0, 0.0
        for row in range(from_re.size):
            from_re[row], from_im[row] = enter_re[row, i], enter_im[row, i]
        add_rows_twice(columns, from_re, from_im, re, im)


@linked_sum
def watch_function(
    n_moving: int,
    exponent: Floats,
    switch_re: Floats,
    switch_im: Floats,
    step: float,
    z: Floats,
    passing: Floats,
    room: ChangeRoom,
    value: Floats,
    change: Floats,
) -> None:
    """Fill in a switch function (t,) along a piece, and its derivative (t, 2 n) by the motion at the section.

    `z` (2, m) are the coordinates with which the piece begins, `room.z_re` and `room.z_im` those of changes.
    """
    m, (weight_re, weight_im) = z.shape[1], (room.weight[0], room.weight[1])
    for i in range(m):
        size, turn = np.exp(0.5 * step * exponent[0, i]), 0.5 * step * exponent[1, i]
        re, im = size * np.cos(turn), size * np.sin(turn)
        passing[0, i], passing[1, i] = re, im
        passing[2, i], passing[3, i] = re * re - im * im, 2.0 * re * im
    for i_time in range(value.size):
        total = 0.0
        for i in range(m):
            re, im = passing[0, i], passing[1, i]
            a, b = switch_re[i] * re - switch_im[i] * im, switch_re[i] * im + switch_im[i] * re
            total += a * z[0, i] - b * z[1, i]
            if i < n_moving:
                weight_re[i], weight_im[i] = a, -b
        value[i_time] = total
        row = change[i_time]
        for j in range(row.size):
            row[j] = 0.0
        add_rows(room.z_re, weight_re[:n_moving], row)
        add_rows(room.z_im, weight_im[:n_moving], row)
        for i in range(m):
            re, im = passing[0, i], passing[1, i]
            passing[0, i] = re * passing[2, i] - im * passing[3, i]
            passing[1, i] = re * passing[3, i] + im * passing[2, i]
