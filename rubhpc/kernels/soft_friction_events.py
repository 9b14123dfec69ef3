"""Events under set-valued friction and a penalty: pairs are pressed or lifted.

A spring and a damper give the normal force, so that there are no impacts. The motion is continuous, and so
are normal forces, except the damper's where a gap closes. The friction of a sticking pair follows from
Coulomb's law.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels.contact_modes import Reduced  # noqa: TC001 - part of a kernel's signature
from rubhpc.kernels.event_forces import FrictionWork  # noqa: TC001 - likewise
from rubhpc.kernels.friction_states import OPEN, STUCK, lifted_place, state_of
from rubhpc.kernels.mode_change import GAP_TOLERANCE
from rubhpc.kernels.penalty_events import force_of, pressed_or_lifted

Floats = NDArray[np.float64]


@linked_sum
def press_pairs(
    reduced: Reduced,
    states: int,
    crossing: int,
    motion: Floats,
    work: FrictionWork,
) -> int:
    """Bits of the pairs lifted after an event; the forces of the pressed pairs go to `work.solver`.

    All other pairs get an infinite gap.
    """
    q, solver = work.rate.size, work.solver
    lifted = int(np.int64(0))
    for i in range(q):
        state = state_of(states, i)
        first, second = (crossing >> (2 * i)) & 1, (crossing >> (2 * i + 1)) & 1
        was_lifted = (states >> lifted_place(q, i)) & 1 == 1
        is_crossed = state != STUCK and first == 1
        is_closed, is_lifted = pressed_or_lifted(reduced, i, is_crossed, state != OPEN, was_lifted, motion)
        if is_lifted:
            lifted |= 1 << lifted_place(q, i)
        solver.is_sticking[i] = state == STUCK and first == 0 and second == 0
        solver.gap[i], solver.target[i] = np.inf, 0.0
        if is_closed:
            solver.gap[i] = -max(force_of(reduced, i, motion), GAP_TOLERANCE * reduced.spring)
    return lifted
