"""What probes and monitors see: linear functions of the motion of all bodies."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError, located
from rubhpc.fem.beam import rayleigh_coefficients
from rubhpc.fem.carrier import own_matrices
from rubhpc.fem.model import ProbeRows
from rubhpc.rig.bearing_table import BearingTable
from rubhpc.rig.probes import MOTIONS, TWISTS
from rubhpc.rig.rotors import Rotor

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.rig.probes import Probe
    from rubhpc.rig.rig import Rig

    Floats = NDArray[np.float64]

NOTHING = 1e-9  # of a direction, below which a part of it is rounding
DISPLACEMENT, VELOCITY, ACCELERATION = range(3)


def with_probes(model: Model, rig: Rig, probes: Sequence[Probe], spin: float) -> Model:
    """Return a model with probes, at the spin (rad/s) at which its bearings are.

    Monitors look at the nodes that stators face, except the recorded one, and at bearings with a clearance.

    Raises
    ------
    InputError
        Where there is nothing to be measured: no such node, stator or bearing, or one that is held.
    """
    probes = tuple(probes)
    nodes = tuple(dict.fromkeys(s.node for s in model.stators if s.node != model.output_node))
    bearings = [
        (number, bearing.clearance)
        for number, bearing in enumerate(getattr(rig.rotor, "bearing", ()), 1)
        if bearing.clearance is not None
    ]
    known = (
        ProbeRows(probes=(), rows=np.zeros(0), constant=np.zeros(0)) if model.probe is None else model.probe
    )
    clearances = tuple(clearance for _, clearance in bearings)
    is_known = known.probes == probes and known.nodes == nodes and known.clearances == clearances
    if is_known and model.rotor.by_speed is None:  # as it is, with what has been derived from it
        return model
    places: list[tuple[int, int | None]] = [(node, None) for node in nodes]
    places += [(rig.rotor.node_of(rig.rotor.bearing[k - 1]), rig.rotor.stands_on(k)) for k, _ in bearings]
    if not probes and not places:
        return replace(model, probe=None)
    rows = np.zeros((3, len(probes) + 2 * len(places), model.body_start[-1]))
    for i, (node, far) in enumerate(places):
        for k, name in enumerate(("v", "w"), start=len(probes) + 2 * i):
            here, there = model.rotor.index(node, name), model.rotor.index(far or 0, name)
            _add_force(rows[DISPLACEMENT, k], np.ones(1), [here], [there])
    for i, probe in enumerate(probes):
        with located(f"[record] probe {probe.name}: "):
            _fill(rows[:, i], probe, model, rig, spin)
    constant = seen_at_rest(model, probes, rows[DISPLACEMENT])
    return replace(
        model,
        probe=ProbeRows(probes=probes, rows=rows, constant=constant, nodes=nodes, clearances=clearances),
    )


def seen_at_rest(model: Model, probes: Sequence[Probe], rows: Floats) -> Floats:
    """Return what probes see of the sag, (n_probe,), from their factors of displacements (n_probe, n_all)."""
    constant: Floats = rows[:, : model.rotor.n_dof] @ model.sag
    by_speed = model.rotor.by_speed
    journals = {support.node for support in by_speed.supports} if by_speed is not None else set()
    for i, probe in enumerate(probes):
        if model.film is not None and probe.quantity == "bearing_force" and probe.node in journals:
            assert probe.node is not None
            up, aside = model.rotor.at_node(probe.node, model.film)
            constant[i] -= math.cos(probe.angle) * up + math.sin(probe.angle) * aside
    return constant


def probes_at(model: Model, spin: float, before: float) -> Model:
    """Return a model whose probes see its bearings at a spin (rad/s), from one with them at another one."""
    by_speed = model.rotor.by_speed
    if model.probe is None or by_speed is None:
        return model
    rows = model.probe.rows.copy()
    for i, probe in enumerate(model.probe.probes):
        if probe.quantity != "bearing_force":
            continue
        direction = np.array([math.cos(probe.angle), math.sin(probe.angle)])
        for support in by_speed.supports:
            if support.node == probe.node:
                now, then = (support.table.at(speed, support.name) for speed in (spin, before))
                stiffness, damping = now[0] - then[0], now[1] - then[1]
                at = (support.rows, support.far)
                _add_force(rows[DISPLACEMENT, i], direction @ stiffness, *at)
                _add_force(rows[VELOCITY, i], direction @ (damping + by_speed.proportional * stiffness), *at)
    constant = seen_at_rest(model, model.probe.probes, rows[DISPLACEMENT])
    return replace(model, probe=replace(model.probe, rows=rows, constant=constant))


def _fill(rows: Floats, probe: Probe, model: Model, rig: Rig, spin: float) -> None:
    """Fill the factors (3, n_all) of a probe."""
    if probe.quantity == "bearing_force":
        _fill_bearing_force(rows, probe, model, rig, spin)
    elif probe.quantity == "foundation_force":
        _fill_foundation_force(rows, probe, model, rig)
    elif probe.quantity in TWISTS:
        row = _at_node(probe, model, rig, "thx")
        if row < 0:
            raise InputError(f"node: node {probe.node} does not twist; choose another one")
        rows[TWISTS.index(probe.quantity), row] = 1.0
    else:
        looked_at = rows[MOTIONS.index(probe.quantity)]
        for row, share in _along(probe, model, rig):
            looked_at[row] = share
        if not looked_at.any():
            place = f"node {probe.node}" if probe.stator is None else f"the tip of stator {probe.stator}"
            raise InputError(f"angle: {place} does not move in this direction; choose another one")


def _along(probe: Probe, model: Model, rig: Rig) -> list[tuple[int, float]]:
    """Rows that move in the direction of a probe, and their shares of it."""
    if probe.stator is None:
        held = [_at_node(probe, model, rig, name) for name in ("v", "w")]
        angle = probe.angle
    else:
        number = _number(probe, model)
        stator, first = model.stators[number], model.stator_start[number]
        held = [first + row if row >= 0 else -1 for row in (stator.axial, stator.lateral)]
        angle = probe.angle - stator.angle
    shares = zip(held, (math.cos(angle), math.sin(angle)), strict=True)
    return [(row, share) for row, share in shares if row >= 0 and abs(share) > NOTHING]


def _at_node(probe: Probe, model: Model, rig: Rig, name: str) -> int:
    """Row of a degree of a probe's node; -1 where it is held."""
    assert probe.node is not None
    rig.rotor.check_node("node", probe.node)
    return model.rotor.index(probe.node, name)


def _number(probe: Probe, model: Model) -> int:
    """Position of the stator of a probe."""
    assert probe.stator is not None
    if probe.stator > len(model.stators):
        raise InputError(f"stator: {probe.stator} is not there; the rig has {len(model.stators)}")
    return probe.stator - 1


def _fill_bearing_force(rows: Floats, probe: Probe, model: Model, rig: Rig, spin: float) -> None:
    """Force of the shaft on the bearings of a node, `e . (M u'' + (C + alpha M + beta K) u' + K u)`.

    M is the mass of the bearings, alpha and beta are Rayleigh's, and u is the motion of the shaft relative to
    what they stand on.
    """
    near = [_at_node(probe, model, rig, name) for name in ("v", "w")]
    rotor = rig.rotor
    nodes = [rotor.node_of(bearing) for bearing in rotor.bearing]
    if probe.node not in nodes:
        listed = ", ".join(str(n) for n in sorted(set(nodes))) or "none"
        raise InputError(f"node: {probe.node} has no bearing; nodes with one: {listed}")
    alpha, beta = rayleigh_coefficients(rotor.damping) if isinstance(rotor, Rotor) else (0.0, 0.0)
    direction = np.array([math.cos(probe.angle), math.sin(probe.angle)])
    for number, (node, support) in enumerate(zip(nodes, rotor.bearing, strict=True), 1):
        if node != probe.node:
            continue
        if isinstance(support, BearingTable):
            stiffness, damping = support.at(spin, f"rotor.bearing.{number}")
        else:
            stiffness, damping = np.array(support.stiffness_matrix), np.array(support.damping_matrix)
        mass = np.array(support.mass_matrix)
        far = [model.rotor.index(rotor.stands_on(number) or 0, name) for name in ("v", "w")]
        _add_force(rows[DISPLACEMENT], direction @ stiffness, near, far)
        _add_force(rows[VELOCITY], direction @ (damping + alpha * mass + beta * stiffness), near, far)
        _add_force(rows[ACCELERATION], direction @ mass, near, far)


def _add_force(row: Floats, factors: Floats, near: Sequence[int], far: Sequence[int]) -> None:
    """Add a force by the motion of two rows relative to two others to what a probe sees, (n_all,)."""
    for places, sign in ((near, 1.0), (far, -1.0)):
        for place, factor in zip(places, factors, strict=True):
            if place >= 0:
                row[place] += sign * factor


def _fill_foundation_force(rows: Floats, probe: Probe, model: Model, rig: Rig) -> None:
    """Force on the ground under a stator's root, or under the carrier that it stands on.

    It is `r . (K u + D u')` with r the motion of the whole body by a unit along the direction: what springs
    and dampers do not pass on inside the body they pass on to the ground.
    """
    number = _number(probe, model)
    stator, first = model.stators[number], model.stator_start[number]
    carrier = next((c for c in model.carriers if number + 1 in c.stators), None)
    if carrier is not None:
        part = next(part for part in rig.carrier if part.name == carrier.name)
        (_, damping, stiffness), names = own_matrices(part)
        whole = {"v": math.cos(probe.angle), "w": math.sin(probe.angle), "thx": 0.0}
    else:
        damping, stiffness = stator.body.damping, stator.body.stiffness
        names = tuple(name for _, name in stator.body.degrees)
        angle = probe.angle - stator.angle
        whole = {"axial": math.cos(angle), "lateral": math.sin(angle), "rotation": 0.0}
    if unknown := [name for name in names if name not in whole]:
        problem = f'its degree "{unknown[0]}" leaves open how it moves as a whole'
        raise InputError(f"stator: {probe.stator}: {problem}; the force on its foundation is unknown")
    moved = np.array([whole[name] for name in names])
    rows[DISPLACEMENT, first : first + moved.size] = moved @ stiffness
    rows[VELOCITY, first : first + moved.size] = moved @ damping
    if not rows.any():
        raise InputError(
            f"stator: {probe.stator} is rigid; it has no degrees of freedom to find its force by"
        )
