"""Divergence of a motion: limits of the rotor's displacement and of the energy of all bodies."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.packing import output_degrees

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model

    Floats = NDArray[np.float64]


def energy_limit(model: Model, spin: float, displacement_limit: float) -> float:
    """Mechanical energy, J, beyond which a motion has diverged; inf for an unconstrained rotor.

    It is that of the rotor whose output node whirls with the spin (rad/s) at the displacement limit (m), in
    the shape of its static response to a force there. A stator whose tip bends far stays below it; a body
    whose motion grows without bound does not, even where the rotor hardly moves.
    """
    stiffness, mass = model.rotor.stiffness, model.rotor.mass
    rows = [row for row in output_degrees(model)[:2] if row >= 0]
    try:
        shape = np.linalg.solve(stiffness, np.eye(len(stiffness))[:, rows])
    except np.linalg.LinAlgError:
        return np.inf
    largest = 0.0
    for k, row in enumerate(rows):
        along = shape[:, k] / shape[row, k]
        largest = max(largest, float(along @ (stiffness + spin**2 * mass) @ along))
    return 0.5 * displacement_limit**2 * largest if largest > 0.0 else np.inf


def judged_nodes(model: Model) -> tuple[int, ...]:
    """Nodes whose lateral displacement is compared with the limit: the output node, then that of each rim."""
    return (model.output_node, *(stator.node for stator in model.stators))


def displacement_reason(model: Model, displacement: Floats, limit: float) -> str:
    """Reason with the node whose displacement, of (2 n_node,), v and w of each, has passed the limit (m)."""
    size = np.abs(displacement).reshape(-1, 2).max(axis=1)
    worst = int(np.argmax(np.where(np.isnan(size), np.inf, size)))
    return f"the displacement of the rotor at node {judged_nodes(model)[worst]} passed {limit:.3g} m"


def energy_reason(limit: float) -> str:
    """Reason of a case whose energy has passed its limit, J."""
    return f"the mechanical energy passed {limit:.3g} J, that of the rotor at its displacement limit"
