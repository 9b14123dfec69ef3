"""Work space of the contact solution of one case."""

from __future__ import annotations

import numpy as np

from rubhpc.kernels.central_difference.contact_forces import fill_compliances
from rubhpc.kernels.contact_pairs import N_DEGREE, Pairs, Workspace, fill_directions, fill_friction_direction


def workspace(pairs: Pairs, step: float, n_place: int = 0) -> Workspace:
    """Arrays for q pairs and a step (s), with directions and compliance along the stators' axes filled in.

    The motion of `n_place` places, more than pairs, may be read.
    """
    q = pairs.radius.size
    work = empty_workspace(q)
    if n_place > q:
        work = work._replace(now=np.zeros((n_place, N_DEGREE)), rate=np.zeros((n_place, N_DEGREE)))
    for i in range(q):
        fill_directions(
            pairs, i, pairs.axis_y[i], pairs.axis_z[i], work.force_direction[i], work.gap_jacobian[i]
        )
        fill_friction_direction(pairs, i, pairs.axis_y[i], pairs.axis_z[i], work.friction_direction[i])
    fill_compliances(pairs, work, step)
    return work


def empty_workspace(q: int) -> Workspace:
    """Arrays for q pairs, all zero."""
    return Workspace(
        at=np.zeros((q, N_DEGREE)),
        now=np.zeros((q, N_DEGREE)),
        rate=np.zeros((q, N_DEGREE)),
        force_direction=np.zeros((q, N_DEGREE)),
        gap_jacobian=np.zeros((q, N_DEGREE)),
        friction_direction=np.zeros((q, N_DEGREE)),
        matrix=np.zeros((q, q)),
        gap=np.zeros(q),
        force=np.zeros(q),
        traction=np.zeros(q),
        active=np.zeros(q, dtype=np.bool_),
        is_sticking=np.zeros(q, dtype=np.bool_),
        elimination=np.zeros((q, q + 1)),
        moved=np.zeros(N_DEGREE),
        target=np.zeros(q),
        delay=np.zeros(q),
        slip=np.zeros(q),
        cone=np.zeros(q),
        coupling=np.zeros((q, q)),
        tangential=np.zeros((2, q, q)),
        tableau=np.zeros((3 * q, 6 * q + 2)),
        basis=np.zeros(3 * q, dtype=np.int64),
        members=np.zeros(q, dtype=np.int64),
        solution=np.zeros(3),
    )
