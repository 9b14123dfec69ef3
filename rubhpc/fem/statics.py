"""The rotor under constant loads: how far gravity and other forces bend it, and where stators then see it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError
from rubhpc.fem.constraints import free_row

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Body, Model
    from rubhpc.rig.matrices import MatrixRotor
    from rubhpc.rig.rig import Rotor

    Floats = NDArray[np.float64]


def constant_load(rotor: Rotor | MatrixRotor, body: Body) -> Floats:
    """Weight and constant forces on the rotor's degrees, (n_dof,), N.

    Gravity pulls against "v" at every mass, `-g M e` with e = 1 on every "v". A force along a direction in
    which its node cannot move is not felt.
    """
    upwards = np.array([float(name == "v") for _, name in body.degrees])
    force: Floats = -rotor.gravity * (body.mass @ upwards)
    for load in rotor.load:
        for name, part in (("v", load.vertical), ("w", load.horizontal)):
            row = body.index(load.node, name)
            if row >= 0:
                force[row] += part
    return force


def sag_under(body: Body, load: Floats) -> Floats:
    """Displacement of a body at rest under a constant load, (n_dof,), m and rad.

    Raises
    ------
    InputError
        Where nothing holds the body against it.
    """
    sag = np.zeros(body.n_dof)
    loaded = np.flatnonzero(load)
    if not loaded.size:
        return sag
    if free_row(body, loaded.tolist()):
        problem = "gravity or a load acts on the rotor, and nothing holds it there"
        raise InputError(f"[rotor] {problem}; add a bearing with a stiffness, or leave gravity and loads out")
    rows = np.flatnonzero(np.isin(body.part, body.part[loaded]))
    sag[rows] = np.linalg.solve(body.stiffness[np.ix_(rows, rows)], load[rows])
    return sag


def sag_at_stators(model: Model) -> tuple[Floats, Floats]:
    """What sag takes off each clearance, and how far it puts the tip aside of the disc, (q,) each, m.

    Motion is counted from the shaft at rest: seen from there, the stators stand elsewhere.
    """
    nearer, aside = np.zeros((2, len(model.stators)))
    for i, stator in enumerate(model.stators):
        rows = [model.rotor.index(stator.node, name) for name in ("v", "w")]
        v, w = (model.sag[row] if row >= 0 else 0.0 for row in rows)
        ey, ez = np.cos(stator.angle), np.sin(stator.angle)
        nearer[i], aside[i] = ey * v + ez * w, ez * v - ey * w
    return nearer, aside
