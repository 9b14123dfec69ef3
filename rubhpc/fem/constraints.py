"""Search for rigid-body modes in what contact and outputs depend on: these have no constant response."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from rubhpc.fem.modes import KINDS

if TYPE_CHECKING:
    from rubhpc.fem.model import Body, Model

FLOATS = "the rotor floats freely: its bearings do not hold it"
RIGID = 1e-12  # square of a frequency over the greatest, below which a mode is a rigid-body mode


def find_rigid_body_mode(model: Model) -> str:
    """Describe a rigid-body mode that contact or outputs depend on; "" when all of them are constrained."""
    nodes = {model.output_node, *(stator.node for stator in model.stators)}
    seen = [model.rotor.index(node, name) for node in sorted(nodes) for name in ("v", "w", "thx")]
    if row := rigid_body_row(model.rotor, [row for row in seen if row >= 0]):
        is_torsion = model.rotor.degrees[row - 1][1] in KINDS["torsional"]
        return "the rotor is free to turn (torsion)" if is_torsion else FLOATS
    held = set()  # bodies, which the stators of a ring or a carrier share
    for i, stator in enumerate(model.stators, 1):
        rows = [row for row in (stator.axial, stator.lateral) if row >= 0]
        if (place := (id(stator.body), *rows)) in held:
            continue
        held.add(place)
        if rigid_body_row(stator.body, rows):
            on = next((carrier.name for carrier in model.carriers if i in carrier.stators), "")
            return f"{f'carrier {on}' if on else f'stator {i}'} is free to move"
    return ""


def unheld_message(free: str, at: str = "") -> str:
    """Return why the modal scheme is refused for what `find_rigid_body_mode` describes."""
    hold = {FLOATS: "add a bearing with a stiffness"}.get(free, "hold it")
    if "torsion" in free:  # friction turns a free rotor back for ever: it has no steady twist
        hold = "give it a stiffness, however soft"
    problem = f"modal needs constrained bodies, and {free}{f' at {at}' if at else ''}"
    return f'[integrator] method: {problem}; {hold}, or set method = "central-difference"'


def rigid_body_row(body: Body, seen: list[int]) -> int:
    """Row, from 1, that moves most in a rigid-body mode of the parts that hold the rows `seen`; 0: none."""
    couples = csr_array((body.mass != 0) | (body.stiffness != 0))
    part = connected_components(couples, directed=False)[1] if body.n_dof else np.zeros(0)
    for number in np.unique(part[seen]):
        rows = np.flatnonzero(part == number)
        block = np.ix_(rows, rows)
        stiffness = body.stiffness[block]
        square, shape = eigh(0.5 * (stiffness + stiffness.T), body.mass[block])
        if square[0] <= RIGID * square[-1]:
            return int(rows[np.abs(shape[:, 0]).argmax()]) + 1
    return 0
