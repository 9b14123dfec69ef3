"""Static deflection of the rotor under gravity and constant loads, and its effect on the clearances."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from rubhpc.errors import InputError
from rubhpc.fem.modes import KINDS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Body, Model

    Floats = NDArray[np.float64]

CROSSED = 1e-12  # of the greatest stiffness, above which a difference across the diagonal is no rounding


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


def at_rest_under(body: Body, load: Floats, spin: float) -> tuple[Floats, Floats | None]:
    """Return where a rotor at a spin (rad/s) rests under a constant load: `sag` and `film` of a model.

    The sag is that of the dynamic coefficients, `K sag = load`, or, where bearings state the static position
    of their journals, `K sag = load + film` with the forces (n_dof,) on the journals that hold them there.
    """
    sag = sag_under(body, load)
    if body.by_speed is None:
        return sag, None
    rows, positions = body.by_speed.journals_at(spin)
    if not len(rows):
        return sag, None
    moved = np.stack([sag_under(body, row) for row in rows], axis=1)
    film = np.linalg.solve(rows @ moved, positions - rows @ sag) @ rows
    return sag_under(body, load + film), film


def sag_remark(model: Model) -> str:
    """Return a remark where the sag is that of dynamic coefficients, not of journals at rest; else ""."""
    rotor = model.rotor
    skew = np.abs(rotor.stiffness - rotor.stiffness.T).max(initial=0.0)
    is_dynamic = rotor.by_speed is not None or skew > CROSSED * np.abs(rotor.stiffness).max(initial=0.0)
    if not (model.load.any() and is_dynamic and model.film is None):
        return ""
    return (
        "the sag under gravity and loads is that of the dynamic coefficients of the bearings; journals rest "
        "elsewhere in a fluid film: give their tables eccentricity_y and eccentricity_z, m"
    )


def sag_at_stators(model: Model) -> tuple[Floats, Floats]:
    """Reduction of each clearance by the sag, and tangential offset of the tip from the disc, (q,) each, m.

    Displacements are measured from the sagged shaft, relative to which the stators are offset; they are set
    about their `centre`.
    """
    nearer, aside = np.zeros((2, len(model.stators)))
    if not model.sag.any() and not any(any(stator.centre) for stator in model.stators):
        return nearer, aside
    for i, stator in enumerate(model.stators):
        at = model.rotor.at_node(stator.node, model.sag)
        v, w = (now - then for now, then in zip(at, stator.centre, strict=True))
        ey, ez = np.cos(stator.angle), np.sin(stator.angle)
        nearer[i], aside[i] = ey * v + ez * w, ez * v - ey * w
    return nearer, aside


SOFTNESS = 100.0  # 1/s2: a thousandth of the weight in a clearance of 0.1 mm


def caught(body: Body, nodes: set[int]) -> Body:
    """Return a rotor that only bores at some nodes hold: with a softness, so that it has a static position.

    Modes of 1.6 Hz stand for lateral rigid-body modes. A rotor that is held at standstill is unchanged.
    """
    at = [body.index(node, name) for node in nodes for name in ("v", "w")]
    if not rigid_body_row(body, [row for row in at if row >= 0]):
        return body
    lateral = np.array([name in KINDS["lateral"] for _, name in body.degrees])
    soft = SOFTNESS * np.where(np.outer(lateral, lateral), body.mass, 0.0)
    tables = body.by_speed
    if tables is not None:
        tables = replace(tables, stiffness=tables.stiffness + soft)
    return replace(body, stiffness=body.stiffness + soft, softness=SOFTNESS, by_speed=tables)


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
    if body.softness:
        seen = [row for row in seen if body.degrees[row][1] not in KINDS["lateral"]]
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
