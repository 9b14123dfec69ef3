"""Work space of the contact solution of one case."""

from __future__ import annotations

import numpy as np

from rubhpc.kernels.contact import N_DEGREE, Pairs, Workspace, fill_directions, fill_matrix


def workspace(pairs: Pairs) -> Workspace:
    """Arrays for q pairs, with directions and compliance along the stators' axes filled in."""
    q = pairs.radius.size
    work = Workspace(
        at=np.zeros((q, N_DEGREE)),
        pull=np.zeros((q, N_DEGREE)),
        push=np.zeros((q, N_DEGREE)),
        matrix=np.zeros((q, q)),
        gap=np.zeros(q),
        force=np.zeros(q),
        active=np.zeros(q, dtype=np.bool_),
        elimination=np.zeros((q, q + 1)),
        moved=np.zeros(N_DEGREE),
    )
    for i in range(q):
        fill_directions(pairs, i, pairs.axis_y[i], pairs.axis_z[i], work.pull[i], work.push[i])
    fill_matrix(pairs, work)
    return work
