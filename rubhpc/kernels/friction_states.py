"""States of a pair under set-valued friction, two bits per pair in a set of states.

Under a penalty with a damper an open pair may be lifted: it still overlaps, but the damper has ended its
force. This is a further bit per pair, after those of all states.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum, linked_sum
from rubhpc.kernels._struct import Struct

Floats = NDArray[np.float64]

OPEN, FORWARD, BACKWARD, STUCK = range(4)  # FORWARD: the rim is faster than the tip; BACKWARD: slower
MOST_PAIRS = 31  # whose states fit into an integer
MOST_SOFT_PAIRS = 20  # likewise, with the bits of lifted pairs


class FrictionBodies(Struct):
    """Properties of the reduced bodies for set-valued friction, q pairs."""

    sliding: Floats  # (q,), coefficient
    static: Floats  # (q,), coefficient of a pair that sticks
    rim_speed: Floats  # (q,), m/s, not negative
    # Accelerations of gaps, then of slips without contact forces, m/s2: by the motion (2 n,), negative, and
    # by the unbalance
    pull: Floats  # (2 q, 2 n)
    turned: Floats  # (2 q, 2), times the cosine and the sine of the shaft's angle


@jit_sum
def state_of(states: int, i: int) -> int:
    """State of pair i in a set of states."""
    return (states >> (2 * i)) & 3


@jit_sum
def lifted_place(q: int, i: int) -> int:
    """Place of the bit for pair i of q being lifted."""
    return 2 * q + i


@linked_sum
def stuck_pairs(states: int) -> int:
    """Bits of the sticking pairs, two places per pair; 0 where none sticks."""
    return states & (states >> 1) & 0x1555555555555555
