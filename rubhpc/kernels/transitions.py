"""From contact mode to contact mode without the motion between: what an event sees, gives and leaves.

Leaving a mode and entering the next is one linear map of modal coordinates, and most of it is known: bodies
that take part in neither keep their coordinates. `integrate.reduced_model.transitions` tabulates what is left
of it, what an event asks of the pairs, and what their impulses do in the coordinates of the next mode. A case
has tables of those transitions that it takes often, and goes by the motion (2 n,) otherwise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked, linked_sum
from rubhpc.kernels._struct import Struct

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

UNKNOWN = -1  # place of what is not tabulated
WORTH_A_TABLE = 32  # passages after which a transition is tabulated
LANES = 8  # columns of a block are filled up to whole vectors
SEEN = 4  # rows of a pair: rate of the gap, slip, and what changes them (`FrictionWork.drawn`)
DECAYED = 1e-60  # coordinates of less are taken for nothing
GIVEN = 2  # rows of a pair: coordinates after a unit impulse, then a unit traction


class Transitions(Struct):
    """Transitions between p contact modes of m coordinates; p is 0 where none are wanted.

    Coordinates count from 0 to 2 m, real parts first. A transition is in `number`: how many coordinates stay
    what they are, how many blocks there are, where those coordinates are, and were; then for each block the
    number of its sources, that of its targets, its place in `value`, its sources and its targets. A form of
    a mode is the number of its blocks, then for each its size, its place in `value` and its coordinates.
    """

    entry: Ints  # (p, p), place in `number` of that from one mode to another; else UNKNOWN less passages
    mode: Ints  # (p,), place in `value` of what is seen and given in a mode, and its reach; or UNKNOWN
    output: Ints  # (p,), place in `value` of the output rows (o, 2, m) of a mode (`span_samples`)
    energy: Ints  # (p,), place in `number` of the form of the loss in a mode
    rub: Ints  # (p, q), likewise of the normal force times the slip of a pair that slides
    number: Ints  # as above
    value: Floats
    source: Floats  # (2 AT_ONCE m,), work space (`product_forms`)
    target: Floats  # (2 AT_ONCE m,), likewise


_NONE, _EMPTY, _ROOM = np.zeros((0, 0), dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0)
NO_TRANSITIONS = Transitions(_NONE, _EMPTY, _EMPTY, _EMPTY, _NONE, _EMPTY, _ROOM, _ROOM, _ROOM)


@linked_sum
def is_far(transitions: Transitions, mode: int, q: int, m: int, limit: float, z: Floats) -> bool:
    """Whether coordinates (2, m) of a mode may take the rotor beyond the limit, m: by the sizes of all."""
    reach = transitions.value[transitions.mode[mode] + 2 * (SEEN + GIVEN) * q * m :]
    most = 0.0
    for k in range(z.shape[1]):
        most += reach[k] * (abs(z[0, k]) + abs(z[1, k]))
    return not most <= limit


@linked_sum
def see(
    transitions: Transitions, mode: int, m: int, i: int, used: int, z: Floats
) -> tuple[float, float, float, float]:
    """What an event sees of pair i at coordinates (2, m) of a mode, of which the first ones are used."""
    rows = transitions.value[transitions.mode[mode] + 2 * SEEN * i * m :]
    z_re, z_im = z[0, :used], z[1, :used]
    a_re, a_im, b_re, b_im = rows[:used], rows[m : m + used], rows[2 * m : 2 * m + used], rows[3 * m :]
    c_re, c_im, d_re, d_im = rows[4 * m :], rows[5 * m :], rows[6 * m :], rows[7 * m :]
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    for k in range(used):
        x, y = z_re[k], z_im[k]
        a += a_re[k] * x - a_im[k] * y
        b += b_re[k] * x - b_im[k] * y
        c += c_re[k] * x - c_im[k] * y
        d += d_re[k] * x - d_im[k] * y
    return a, b, c, d


@linked
def add_impulses(transitions: Transitions, mode: int, q: int, m: int, given: Floats, z: Floats) -> None:
    """Add impulses and tractions (2, q), N s, to the coordinates (2, m) of the mode that goes on."""
    place = transitions.mode[mode] + 2 * SEEN * q * m
    for i in range(q):
        for kind in range(GIVEN):
            share = given[kind, i]
            if share != 0.0:
                for part in range(2):
                    row = transitions.value[place + (2 * (GIVEN * i + kind) + part) * m :]
                    for k in range(m):
                        z[part, k] += share * row[k]


@linked
def pass_over(transitions: Transitions, place: int, m: int, z: Floats, after: Floats) -> None:
    """Fill the coordinates `after` (2, m) in the next mode, but for those that do not move, from `z`."""
    number, source, target = transitions.number, transitions.source, transitions.target
    before, following = z.reshape(2 * m), after.reshape(2 * m)
    n_kept, n_block = number[place], number[place + 1]
    place += 2
    for k in range(2 * m):
        following[k] = 0.0
    for k in range(n_kept):
        following[np.uint64(number[place + k])] = before[np.uint64(number[place + n_kept + k])]
    place += 2 * n_kept
    for _ in range(n_block):
        n_source, n_target, at = number[place], number[place + 1], number[place + 2]
        place += 3
        width = (n_target + LANES - 1) // LANES * LANES
        # Gathered and scattered here, one at a time, by numbers without a sign: vectors of them are slow.
        for k in range(n_source):
            source[k] = before[np.uint64(number[place + k])]
        pass_block(transitions.value[at:], n_source, width, source, target)
        place += n_source
        for k in range(n_target):
            following[np.uint64(number[place + k])] = target[k]
        place += n_target


@linked_sum
def pass_block(rows: Floats, n_row: int, width: int, value: Floats, total: Floats) -> None:
    """Fill `total` (width,) with rows (n_row width,) times coordinates `value` (n_row,), eight at a time.

    Those that have decayed are left out.
    """
    whole, last = n_row - n_row % 8, total[:width]
    for k in range(width):
        last[k] = 0.0
    for row in range(0, whole, 8):
        at = row * width
        a, b, c, d = value[row], value[row + 1], value[row + 2], value[row + 3]
        e, f, g, h = value[row + 4], value[row + 5], value[row + 6], value[row + 7]
        if abs(a) + abs(b) + abs(c) + abs(d) + abs(e) + abs(f) + abs(g) + abs(h) < DECAYED:
            continue
        first, second = rows[at : at + width], rows[at + width : at + 2 * width]
        third, fourth = rows[at + 2 * width : at + 3 * width], rows[at + 3 * width : at + 4 * width]
        fifth, sixth = rows[at + 4 * width : at + 5 * width], rows[at + 5 * width : at + 6 * width]
        seventh, eighth = rows[at + 6 * width : at + 7 * width], rows[at + 7 * width : at + 8 * width]
        for k in range(width):
            last[k] += (first[k] * a + second[k] * b + third[k] * c + fourth[k] * d) + (
                fifth[k] * e + sixth[k] * f + seventh[k] * g + eighth[k] * h
            )
    for row in range(whole, n_row):
        first, a = rows[row * width : (row + 1) * width], value[row]
        for k in range(width):
            last[k] += first[k] * a
