"""Packs an assembled model into the arrays of the kernels: uncoupled blocks, contact pairs, unbalance."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from rubhpc.fem.statics import sag_at_stators
from rubhpc.kernels._jit import plain
from rubhpc.kernels.central_difference.linear import Linear
from rubhpc.kernels.contact_pairs import AXIAL, LATERAL, N_DEGREE, TORSION, Pairs, V, W, rim_sense
from rubhpc.kernels.laws import MULTIPLIER, Law
from rubhpc.models import FRICTION_LAWS, NORMAL_LAWS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.study.contact_keys import Contact

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Packed:
    """A model at one speed and step, in kernel order: rows sorted by block, unseen blocks left out.

    Attributes
    ----------
    row : (n_all,)
        Kernel row of each degree of rotor, then stators; -1 where no output depends on it.
    mass, damping, stiffness : (n_dof, n_dof)
        M, C = D + spin G and K in kernel order.
    """

    linear: Linear
    row: Ints
    mass: Floats
    damping: Floats
    stiffness: Floats
    orders: Ints  # (f,), of the forces that turn with the shaft
    force: NDArray[np.complex128]  # (f, n_dof), their phasors, N
    degree_row: Ints  # (q, 5), rows of each pair's degrees
    recorded_row: Ints  # (q or more, 5), the same, then each carrier's motion as axial and lateral
    degree_block: Ints  # (q, 5)
    compliance: Floats  # (q, 5, q, 5), m/N
    output_row: Ints  # (3,), vertical, horizontal, torsion
    probe: Floats  # (3, n_probe, n_dof), weights of displacements, velocities and accelerations


def pack(model: Model, spin: float, step: float) -> Packed:
    """Pack everything of a model that depends on speed and step alone.

    Parameters
    ----------
    spin, step : float
        Rotation speed, rad/s, and time step, s.
    """
    mass, damping, stiffness, force = whole_system(model, spin)
    degree, output, probe = degrees_of(model), output_degrees(model), model.probe_rows
    looked_at = np.flatnonzero(np.any(probe != 0.0, axis=(0, 1)))

    coupled = csr_array((mass != 0) | (stiffness != 0) | (damping != 0))
    n_component, component = connected_components(coupled, directed=False)
    seen = np.unique(component[np.concatenate([degree[degree >= 0], output[output >= 0], looked_at])])
    # Within a block, degrees coupled by K and M are adjacent (the planes of bending): fewer diagonals.
    _, plane = connected_components(csr_array((mass != 0) | (stiffness != 0)), directed=False)
    order = np.concatenate([np.flatnonzero(component == c) for c in seen])
    order = order[np.lexsort((plane[order], component[order]))]
    start = np.cumsum([0, *(np.count_nonzero(component == c) for c in seen)])
    row = np.full(mass.shape[0], -1)
    row[order] = np.arange(order.size)
    block = np.full(n_component, -1)
    block[seen] = np.arange(seen.size)

    pick = np.ix_(order, order)
    mass, stiffness, damping = mass[pick], stiffness[pick], damping[pick]
    phasors = np.zeros((1 + len(model.harmonics), row.size), dtype=np.complex128)
    phasors[0] = force[0] - 1j * force[1]
    for phasor, (_, harmonic) in zip(phasors[1:], model.harmonics, strict=True):
        phasor[: harmonic.size] = harmonic
    orders, phasors = np.array([1, *(one for one, _ in model.harmonics)]), phasors[:, order]
    inverse = _inverses(mass + 0.5 * step * damping, start)
    degree_row = np.where(degree >= 0, row[degree], -1)
    at = carrier_degrees(model)
    carriers = np.full((len(at), N_DEGREE), -1)
    carriers[:, [AXIAL, LATERAL]] = np.where(at >= 0, row[at], -1)
    degree_block = np.where(degree >= 0, block[component[degree]], -1)
    return Packed(
        linear=_linear(inverse, stiffness, damping, orders, phasors, start),
        row=row,
        mass=mass,
        damping=damping,
        stiffness=stiffness,
        orders=orders,
        force=phasors,
        degree_row=degree_row,
        recorded_row=np.concatenate([degree_row, carriers]),
        degree_block=degree_block,
        compliance=_compliance(inverse, start, degree_row, degree_block, step),
        output_row=np.where(output >= 0, row[output], -1),
        probe=np.ascontiguousarray(probe[:, :, order]),
    )


def whole_system(model: Model, spin: float) -> tuple[Floats, Floats, Floats, Floats]:
    """M, C = D + spin G and K of rotor, then stators (n_all, n_all), and the unbalance force (2, n_all), N.

    The rows of the force belong to the cosine and the sine of the shaft's angle; spin in rad/s.
    """
    bodies = model.bodies
    n_all = sum(body.n_dof for body in bodies)
    mass, stiffness, damping = np.zeros((3, n_all, n_all))
    first = 0
    for body in bodies:
        rows = slice(first, first + body.n_dof)
        mass[rows, rows], stiffness[rows, rows] = body.mass, body.stiffness
        damping[rows, rows] = body.damping + spin * body.gyroscopic
        first += body.n_dof
    force = np.zeros((2, n_all))
    force[0, : model.rotor.n_dof] = spin**2 * model.unbalance_cosine
    force[1, : model.rotor.n_dof] = spin**2 * model.unbalance_sine
    return mass, damping, stiffness, force


_DEGREES: WeakKeyDictionary[Model, Ints] = WeakKeyDictionary()


def degrees_of(model: Model) -> Ints:
    """Rows of each pair's degrees (q, 5) among all degrees, rotor first, then stators; -1 where held."""
    if model not in _DEGREES:
        _DEGREES[model] = _find_degrees(model)
        _DEGREES[model].flags.writeable = False
    return _DEGREES[model]


def _find_degrees(model: Model) -> Ints:
    first = model.stator_start
    degree = np.full((len(model.stators), N_DEGREE), -1)
    for i, stator in enumerate(model.stators):
        degree[i, V], degree[i, W] = model.rotor.index(stator.node, "v"), model.rotor.index(stator.node, "w")
        degree[i, TORSION] = model.rotor.index(stator.node, "thx")
        degree[i, AXIAL] = first[i] + stator.axial if stator.axial >= 0 else -1
        degree[i, LATERAL] = first[i] + stator.lateral if stator.lateral >= 0 else -1
    return degree


def carrier_degrees(model: Model) -> Ints:
    """Rows of each carrier's vertical and horizontal displacement, (n, 2); -1 where held.

    Those that turn have a further row, with -1 and their rotation.
    """
    start = model.stator_start
    wanted = [(carrier, ("v", "w")) for carrier in model.carriers]
    wanted += [(carrier, ("", "thx")) for carrier in model.turning_carriers]
    rows = [
        [start[carrier.stators[0] - 1] + row if row >= 0 else -1 for row in at]
        for carrier, names in wanted
        for at in [[carrier.body.index(1, name) for name in names]]
    ]
    return np.array(rows, dtype=np.int64).reshape(-1, 2)


def output_degrees(model: Model) -> Ints:
    """Rows (3,) of vertical, horizontal and torsional displacement of the output node; -1 where held."""
    return np.array([model.rotor.index(model.output_node, name) for name in ("v", "w", "thx")])


def law_of(contact: Contact) -> Law:
    """Laws of a study for kernels; what it omits keeps its default."""
    given = {key: getattr(contact, key) for key in Law._fields if not key.endswith("_law")}
    values: dict[str, Any] = {
        key: np.array(value) if isinstance(value, tuple) else float(value)
        for key, value in given.items()
        if value is not None
    }
    friction, normal = FRICTION_LAWS.index(contact.friction_law), NORMAL_LAWS.index(contact.law)
    return Law(friction_law=friction, normal_law=normal, **values)


def normal_laws(model: Model, law: Law) -> dict[str, Any]:
    """Contact law of each stator, (q,) each: its own, or that of the case (N/m, N s/m, or those of Hertz)."""
    found: list[tuple[float, ...]] = []
    for stator in model.stators:
        own = stator.law
        if own is None:
            found.append((law.normal_law, law.stiffness, law.damping, law.restitution))
        else:
            given = (own.stiffness, own.damping, own.restitution)
            found.append((NORMAL_LAWS.index(own.kind), *(value or 0.0 for value in given)))
    names = ("normal_law", "stiffness", "damping", "restitution")
    columns = dict(zip(names, np.array(found, dtype=np.float64).T.copy(), strict=True))
    return columns | {"normal_law": columns["normal_law"].astype(np.int64)}


def pairs_of(
    model: Model,
    *,
    row: Ints,
    block: Ints,
    compliance: Floats,
    clearance: float,
    friction: float,
    spin: float,
    is_updated: bool,
    law: Law = MULTIPLIER,
) -> Pairs:
    """Contact pairs of a case.

    Parameters
    ----------
    row, block : (q, 5)
        Row and block of each degree in the state of the scheme; -1 where it is constrained or absent.
    compliance : (q, 5, q, 5), m/N
        Displacement of a degree for a unit force on another over a step.
    clearance : float, m
    friction : float
        Coefficient, not negative; the spin (rad/s) determines its sign.
    """
    angle = np.array([stator.angle for stator in model.stators])
    nearer, aside = sag_at_stators(model)
    return Pairs(
        row=row,
        block=block,
        axis_y=np.cos(angle),
        axis_z=np.sin(angle),
        radius=np.array([stator.radius for stator in model.stators]),
        clearance=np.array([clearance + stator.clearance_offset for stator in model.stators]) - nearer,
        aside=aside,
        friction=np.full(angle.size, plain(rim_sense)(spin) * friction),
        compliance=compliance,
        is_updated=is_updated,
        law=law,
    )


def _inverses(effective: Floats, start: Ints) -> Floats:
    """Inverse of each diagonal block, transposed, (n_block, n_max, n_max)."""
    widest = int(np.diff(start).max())
    inverse = np.zeros((start.size - 1, widest, widest))
    for b, (i, j) in enumerate(pairwise(start)):
        inverse[b, : j - i, : j - i] = np.linalg.inv(effective[i:j, i:j]).T
    return inverse


def _diagonals(matrix: Floats) -> tuple[Floats, Ints]:
    """Diagonals that are not zero, (n_diagonal, n_dof), and the offset and column span of each."""
    row, column = np.nonzero(matrix)
    offsets = np.unique(column - row)
    values = np.zeros((offsets.size, matrix.shape[0]))
    values[np.searchsorted(offsets, column - row), column] = matrix[row, column]
    span = np.empty((offsets.size, 3), dtype=np.int64)
    for k, offset in enumerate(offsets):
        used = np.flatnonzero(values[k])
        span[k] = offset, used[0], used[-1] + 1
    return values, span


def _linear(
    inverse: Floats,
    stiffness: Floats,
    damping: Floats,
    orders: Ints,
    force: NDArray[np.complex128],
    start: Ints,
) -> Linear:
    stiffness_values, stiffness_span = _diagonals(stiffness)
    damping_values, damping_span = _diagonals(damping)
    skew = 0.5 * (stiffness - stiffness.T)
    skew[abs(skew) <= 1e-12 * abs(stiffness).max()] = 0.0  # rounding of the assembly
    # Contiguous: otherwise kernels are compiled again for such rigs.
    skew_row, skew_column = (np.ascontiguousarray(index) for index in np.nonzero(skew))
    which, force_row = (np.ascontiguousarray(index) for index in np.nonzero(force))
    return Linear(
        start=start,
        inverse=inverse,
        stiffness=stiffness_values,
        stiffness_span=stiffness_span,
        damping=damping_values,
        damping_span=damping_span,
        circulation=skew[skew_row, skew_column],
        circulation_row=skew_row,
        circulation_column=skew_column,
        force_row=force_row,
        force_order=orders[which],
        force_cosine=force.real[which, force_row],
        force_sine=-force.imag[which, force_row],
    )


def _compliance(inverse: Floats, start: Ints, row: Ints, block: Ints, step: float) -> Floats:
    """Displacement of each pair's degrees for a unit force on another's over one step, h^2 Mt^-1."""
    q = row.shape[0]
    compliance = np.zeros((q, N_DEGREE, q, N_DEGREE))
    for i, a, j, b in np.ndindex(q, N_DEGREE, q, N_DEGREE):
        if block[i, a] >= 0 and block[i, a] == block[j, b]:
            origin = start[block[i, a]]
            compliance[i, a, j, b] = step**2 * inverse[block[i, a], row[j, b] - origin, row[i, a] - origin]
    return compliance
