"""Where a case begins unless told: at rest, under its constant loads, on the stators that these reach."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError
from rubhpc.fem.statics import sag_at_stators
from rubhpc.integrate.record import State
from rubhpc.kernels.complementarity import UNSOLVED, solve_complementarity

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Body, Model

    Floats = NDArray[np.float64]

GAP_TOLERANCE = 1e-14  # m


def state_at_rest(model: Model, clearance: float) -> State:
    """Equilibrium of rotor and stators at rest: the sag, less what the stators hold up, without friction.

    Parameters
    ----------
    clearance : float, m
        Of the shaft without loads; a stator's `clearance_offset` is added.

    Raises
    ------
    InputError
        Where the stators that the shaft rests on have no equilibrium with it.
    """
    state = State.at_rest(model)
    gap = np.array([clearance + stator.clearance_offset for stator in model.stators])
    gap -= sag_at_stators(model)[0]
    if not model.sag.any() or gap.min() >= 0.0:
        return state
    q = gap.size
    push, axial = np.zeros((model.rotor.n_dof, q)), np.zeros(q)  # what unit forces do
    for i, stator in enumerate(model.stators):
        for name, share in (("v", -np.cos(stator.angle)), ("w", -np.sin(stator.angle))):
            row = model.rotor.index(stator.node, name)
            if row >= 0:
                push[row, i] = share
    bent = _answer(model.rotor, push)
    tips = []
    for i, stator in enumerate(model.stators):
        along = np.zeros((stator.body.n_dof, 1))
        if stator.axial >= 0:
            along[stator.axial] = 1.0
        tips.append(_answer(stator.body, along)[:, 0])
        axial[i] = tips[i][stator.axial] if stator.axial >= 0 else 0.0
    force = np.zeros(q)
    pivots = solve_complementarity(
        push.T @ bent + np.diag(axial), gap, GAP_TOLERANCE, force, gap < 0.0, np.zeros((q, q + 1))
    )
    if pivots == UNSOLVED:
        raise InputError(
            "[rotor] gravity: the shaft finds no rest between its stators; give an initial state"
        )
    return replace(
        state,
        rotor_displacement=state.rotor_displacement + bent @ force,
        stator_displacement=tuple(tip * pressed for tip, pressed in zip(tips, force, strict=True)),
        contact_force=force,
    )


def _answer(body: Body, force: Floats) -> Floats:
    """Displacements (n_dof, k) of a body under constant forces (n_dof, k) on what is held."""
    answer = np.zeros_like(force)
    if not body.n_dof:  # a wall
        return answer
    rows = np.flatnonzero(np.isin(body.part, body.part[np.any(force != 0.0, axis=1)]))
    try:
        answer[rows] = np.linalg.solve(body.stiffness[np.ix_(rows, rows)], force[rows])
    except np.linalg.LinAlgError:
        problem = "the shaft rests on a stator, and nothing holds one of the two"
        raise InputError(f"[rotor] gravity: {problem}; hold it, or give an initial state") from None
    return answer
