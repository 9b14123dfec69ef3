"""Assembly of a carrier with the stators that stand on it, as one body.

The degrees of a stator stay those of its tip and nodes in space, along and across its axis. A place at the
angle a and the distance rho from the shaft's axis that follows the carrier's motion (v, w, thx) moves by

    axial = v cos a + w sin a,   lateral = -v sin a + w cos a + rho thx,   rotation = -thx,

the shape Phi of the stator. Springs and dampers act on the motion relative to it, `B = (-Phi, 1)`: with the
matrices K and D of the stator on a carrier that is held, they are `B^T K B` and `B^T D B`, so that a stator
moved as a whole is neither strained nor damped. The squared slope of a bent one is relative, too. The mass
matrix of a cantilever is that of the free beam, with the root following the carrier.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import singledispatch
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag

from rubhpc.fem.beam import STATOR_DEGREES, join, stator_element
from rubhpc.fem.model import Body, CarrierModel
from rubhpc.rig.carriers import MOTIONS, Carrier
from rubhpc.rig.stators import Bore, LumpedStator, Stator

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.fem.model import StatorModel
    from rubhpc.rig.carriers import AnyCarrier
    from rubhpc.rig.stators import AnyStator

    Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Mounting:
    """What a stator needs beyond its own matrices to stand on a carrier.

    Attributes
    ----------
    shape : (n_dof, 3)
        Its degrees for a unit v, w and thx of the carrier.
    mass : (3 + n_dof, 3 + n_dof)
        Mass matrix over the carrier's v, w and thx and its own degrees.
    """

    shape: Floats
    mass: Floats


def followed(angle: float, distance: float) -> Floats:
    """Axial, lateral displacement and rotation (3, 3) for a unit v, w, thx; distance from the axis in m."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s, 0.0], [-s, c, distance], [0.0, 0.0, -1.0]])


@singledispatch
def mount(stator: object, model: StatorModel) -> Mounting:
    """How a stator stands on a carrier; register a function for each kind that can."""
    raise TypeError(f"no mounting for {type(stator).__name__}")


@mount.register(Stator)
def _(stator: Stator, model: StatorModel) -> Mounting:
    """Cantilever whose root follows the carrier."""
    beam = join([stator_element(stator)] * stator.elements)
    away = np.linspace(stator.length, 0.0, stator.elements + 1)
    shape = np.vstack([followed(stator.angle, model.radius + distance) for distance in away])
    n_root = len(STATOR_DEGREES)
    with_root = block_diag(shape[:n_root], np.eye(len(shape) - n_root))
    return Mounting(shape=shape[n_root:], mass=with_root.T @ beam.mass @ with_root)


@mount.register(LumpedStator)
def _(stator: LumpedStator, model: StatorModel) -> Mounting:
    """A mass on springs; their other ends, at the contact radius, follow the carrier."""
    shape = followed(stator.angle, model.radius)[:2]
    return Mounting(shape=shape, mass=block_diag(np.zeros((3, 3)), model.body.mass))


@mount.register(Bore)
def _(stator: Bore, model: StatorModel) -> Mounting:
    """A hole whose springs stand on the carrier, or a rigid one, which is a part of it."""
    n = model.body.n_dof
    return Mounting(shape=followed(stator.angle, 0.0)[:n], mass=block_diag(np.zeros((3, 3)), model.body.mass))


def assemble_carrier(
    carrier: AnyCarrier, stators: Sequence[tuple[int, AnyStator, StatorModel]]
) -> tuple[CarrierModel, list[StatorModel]]:
    """Return a carrier with its stators, and the stators as parts of it.

    Parameters
    ----------
    stators : sequence of (number, stator, model)
        Those that stand on it; the model is that of the stator on a carrier that is held.
    """
    own, names = own_matrices(carrier)
    n = len(names)
    n_all = n + sum(model.body.n_dof for _, _, model in stators)
    mass, damping, stiffness = np.zeros((3, n_all, n_all))
    for whole, part in zip((mass, damping, stiffness), own, strict=True):
        whole[:n, :n] = part
    at = [names.index(name) for name in MOTIONS if name in names]  # of the motions that are not held
    motions = [i for i, name in enumerate(MOTIONS) if name in names]
    degrees = [(1, name) for name in names]
    rows: list[list[int]] = []
    slopes: list[Floats | None] = []
    for _, stator, model in stators:
        mounting = mount(stator, model)
        first, n_node = len(degrees), max(node for node, _ in degrees)
        rows.append(list(range(first, first + model.body.n_dof)))
        degrees += [(n_node + node, name) for node, name in model.body.degrees]
        met = np.ix_([*at, *rows[-1]], [*at, *rows[-1]])
        relative = np.hstack([-mounting.shape[:, motions], np.eye(model.body.n_dof)])
        damping[met] += relative.T @ model.body.damping @ relative
        stiffness[met] += relative.T @ model.body.stiffness @ relative
        slope = None if model.squared_slope is None else np.zeros_like(mass)
        if slope is not None:
            slope[met] = relative.T @ model.squared_slope @ relative
        slopes.append(slope)
        kept = [*motions, *range(3, 3 + model.body.n_dof)]
        mass[met] += mounting.mass[np.ix_(kept, kept)]
    body = Body(
        mass=0.5 * (mass + mass.T),
        damping=damping,
        gyroscopic=np.zeros_like(mass),
        stiffness=0.5 * (stiffness + stiffness.T) if not np.any(own[2] - own[2].T) else stiffness,
        degrees=tuple(degrees),
    )
    numbers = tuple(number for number, _, _ in stators)
    placed = []
    for of, slope, (_, _, model) in zip(rows, slopes, stators, strict=True):
        axial, lateral = (of[model.axial], of[model.lateral]) if of else (body.index(1, m) for m in "vw")
        turn = body.index(1, "thx") if model.is_bore else -1
        alone = replace(model, body=body, alone=model, squared_slope=slope)
        placed.append(replace(alone, axial=axial, lateral=lateral, torsion=turn))
    return CarrierModel(name=carrier.name, body=body, stators=numbers), placed


def own_matrices(carrier: AnyCarrier) -> tuple[tuple[Floats, Floats, Floats], tuple[str, ...]]:
    """M, C and K of a carrier without stators, and the names of their rows."""
    if not isinstance(carrier, Carrier):
        assert carrier.damping is not None
        return (carrier.mass, carrier.damping, carrier.stiffness), carrier.degrees
    horizontal = carrier.stiffness if carrier.horizontal_stiffness is None else carrier.horizontal_stiffness
    values = [
        (carrier.mass, carrier.damping, carrier.stiffness),
        (carrier.mass, carrier.damping, horizontal),
    ]
    if carrier.inertia is not None:
        assert carrier.torsional_stiffness is not None
        values.append((carrier.inertia, carrier.torsional_damping, carrier.torsional_stiffness))
    M, C, K = (np.diag(column) for column in np.array(values).T)
    return (M, C, K), MOTIONS[: len(values)]
