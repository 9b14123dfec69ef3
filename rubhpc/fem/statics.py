"""Static deflection of the rotor under gravity and constant loads, and its effect on the clearances."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError
from rubhpc.fem.constraints import FLOATS, rigid_body_row

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Body, Model

    Floats = NDArray[np.float64]


def sag_under(body: Body, load: Floats) -> Floats:
    """Displacement of a body at rest under a constant load, (n_dof,), m and rad.

    Raises
    ------
    InputError
        When the loaded part of the body is unconstrained.
    """
    sag = np.zeros(body.n_dof)
    loaded = np.flatnonzero(load)
    if not loaded.size:
        return sag
    if rigid_body_row(body, loaded.tolist()):
        problem = f"gravity or a load acts on it, and {FLOATS}"
        raise InputError(f"[rotor] {problem}; add a bearing with a stiffness, or remove gravity and loads")
    rows = np.flatnonzero(np.isin(body.part, body.part[loaded]))
    sag[rows] = np.linalg.solve(body.stiffness[np.ix_(rows, rows)], load[rows])
    return sag


def sag_at_stators(model: Model) -> tuple[Floats, Floats]:
    """Reduction of each clearance by the sag, and tangential offset of the tip from the disc, (q,) each, m.

    Displacements are measured from the sagged shaft, relative to which the stators are offset.
    """
    nearer, aside = np.zeros((2, len(model.stators)))
    if not model.sag.any():
        return nearer, aside
    for i, stator in enumerate(model.stators):
        rows = [model.rotor.index(stator.node, name) for name in ("v", "w")]
        v, w = (model.sag[row] if row >= 0 else 0.0 for row in rows)
        ey, ez = np.cos(stator.angle), np.sin(stator.angle)
        nearer[i], aside[i] = ey * v + ez * w, ez * v - ey * w
    return nearer, aside
