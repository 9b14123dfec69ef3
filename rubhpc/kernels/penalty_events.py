"""Events under a penalty: pairs are pressed, lifted or open. Motion and forces are continuous.

A pair is pressed from the closing of its gap until its force `-k g - c g'` vanishes. With a damper the gap
still overlaps then: the pair is lifted until the gap opens or the force would be compressive again. A set of
states has bit i for a pressed pair i and bit q + i for a lifted one. The switch function of a lifted pair is
`k g + c g'`. It also vanishes before the next touch, where the pair becomes open.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum, linked_sum
from rubhpc.kernels.contact_modes import Reduced  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.mode_change import product

Floats = NDArray[np.float64]

MOST_PAIRS = 31  # whose states fit into an integer


@linked_sum
def gap_of(reduced: Reduced, i: int, motion: Floats) -> float:
    """Gap of pair i, m, of a reduced motion (2 n,)."""
    n = reduced.gap_jacobian.shape[1]
    return float(reduced.clearance[i] + product(reduced.gap_jacobian[i], motion[:n]))


@linked_sum
def force_of(reduced: Reduced, i: int, motion: Floats) -> float:
    """Force of the spring and damper of pair i, N, in a motion (2 n,); negative where they would pull."""
    rate = product(reduced.gap_jacobian[i], motion[reduced.gap_jacobian.shape[1] :])
    return float(-reduced.spring * gap_of(reduced, i, motion) - reduced.damper * rate)


@jit_sum
def pressed_pairs(reduced: Reduced, motion: Floats) -> int:
    """States of the pairs in a motion (2 n,) without a history."""
    q = reduced.gap_jacobian.shape[0]
    found = int(np.int64(0))
    for i in range(q):
        if gap_of(reduced, i, motion) < 0.0:
            found |= 1 << (i if force_of(reduced, i, motion) > 0.0 else q + i)
    return found


@linked_sum
def pressed_or_lifted(
    reduced: Reduced, i: int, is_crossed: bool, is_pressed: bool, is_lifted: bool, motion: Floats
) -> tuple[bool, bool]:
    """Whether pair i is pressed after an event, and whether it is lifted.

    `is_crossed`: the event is that of its gap, or of its force.
    """
    if not is_crossed:
        return is_pressed, is_lifted and gap_of(reduced, i, motion) < 0.0
    if is_pressed:
        return False, reduced.damper > 0.0
    return not is_lifted or gap_of(reduced, i, motion) < 0.0, False


@jit_sum
def change_pressed(reduced: Reduced, states: int, crossing: int, motion: Floats) -> int:
    """States after the switch functions `crossing` (bits) vanish, in a motion (2 n,)."""
    q = reduced.gap_jacobian.shape[0]
    found = int(np.int64(0))
    for i in range(q):
        was_pressed, was_lifted = (states >> i) & 1 == 1, (states >> (q + i)) & 1 == 1
        is_pressed, is_lifted = pressed_or_lifted(
            reduced, i, (crossing >> i) & 1 == 1, was_pressed, was_lifted, motion
        )
        if is_pressed:
            found |= 1 << i
        elif is_lifted:
            found |= 1 << (q + i)
    return found
