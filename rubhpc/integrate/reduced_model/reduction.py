"""Galerkin reduction: the lowest modes of each body and residual attachment modes, with unit mass."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.packing import carrier_degrees, degrees_of, output_degrees, whole_system
from rubhpc.integrate.reduced_model.coupling import Grouped, coupled_rows
from rubhpc.integrate.reduced_model.truncation import (
    SMOOTH,
    Modes,
    at_standstill,
    completed,
    kept_modes,
    parted,
    seen_degrees,
)
from rubhpc.kernels._jit import plain
from rubhpc.kernels.closed_form.mode_change import GAP_TOLERANCE
from rubhpc.kernels.contact_modes import Reduced
from rubhpc.kernels.contact_pairs import LATERAL, N_DEGREE, TORSION, V, W, rim_sense

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from numpy.typing import NDArray

    from rubhpc.fem.free_spin import FreeSpin
    from rubhpc.fem.model import Model
    from rubhpc.integrate.reduced_model.truncation import Touch
    from rubhpc.kernels.laws import Law

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]
    Bools = NDArray[np.bool_]


# Limit of omitted static responses to dampers, relative to the damped mode, times sqrt(accuracy): the error
# of the mode's exponent is its square.
LEAST_RESPONSE = 0.1
UNSEEN = 1e-9  # relative motion or coupling below which a mode counts as unseen


@dataclass(frozen=True, kw_only=True, eq=False)
class ReducedModel:
    """A model at one speed in n reduced coordinates with the identity for a mass matrix.

    Attributes
    ----------
    basis : (n_all, n)
        Degrees of rotor, then stators, for unit coordinates.
    mass : (n_all, n_all)
        Mass matrix of the full model.
    stiffness, damping : (n, n)
        K and D + spin G.
    force : (2, n)
        Cosine and sine part of the unbalance force.
    degree : (q, 5, n)
        Each pair's degrees (v, w, torsion, axial, lateral); zero where held.
    output : (3, n)
        Vertical, horizontal and torsional displacement of the output node.
    carrier : (n_place, 2, n)
        Vertical and horizontal displacement of each carrier, then zero and the rotation of those that turn.
    probe : (3, n_probe, n)
        What each probe sees of displacements, velocities and accelerations.
    """

    spin: float
    basis: Floats
    mass: Floats
    stiffness: Floats
    damping: Floats
    force: Floats
    degree: Floats
    output: Floats
    carrier: Floats
    probe: Floats

    @cached_property
    def translations(self) -> Floats:
        """Lateral motion of the output node, then of the rims (`divergence.judged_nodes`), (2 + 2 q, n)."""
        return np.concatenate([self.output[:2], self.degree[:, [V, W]].reshape(-1, self.degree.shape[2])])

    @cached_property
    def project(self) -> Floats:
        """`basis.T @ mass` (n, n_all), which takes a motion to its coordinates."""
        return self.basis.T @ self.mass

    def part(self, rows: Ints, pairs: Ints) -> ReducedModel:
        """The model in some of the coordinates, with some of the pairs."""
        at = rows[:, None], rows
        return replace(
            self,
            basis=self.basis[:, rows],
            stiffness=self.stiffness[at],
            damping=self.damping[at],
            force=self.force[:, rows],
            degree=self.degree[pairs][:, :, rows],
            output=self.output[:, rows],
            carrier=self.carrier[:, :, rows],
            probe=self.probe[:, :, rows],
        )


def reduce_model(
    model: Model,
    spin: float,
    accuracy: float,
    free_spin: FreeSpin | None = None,
    *,
    touch: Touch = SMOOTH,
) -> ReducedModel:
    """Reduce a model such that contact and outputs have the requested accuracy.

    The basis of each uncoupled part consists of the undamped modes at standstill chosen by
    `truncation.kept_modes`, and of residual attachment modes. These are the static responses of the other
    modes to a unit force on each degree that contact or outputs see, or on the combination that a probe sees;
    to the forces of dampers and cross-coupled springs on the kept modes; and, for bent stators, to the axial
    force on the bent shape (`bending_loads`). Gyroscopic and damping terms are then projected. Unseen modes
    are left out.

    Parameters
    ----------
    spin : float, rad/s
    accuracy : float
        Relative, of each signal and force (`truncation.modal_error`); on the packaged rig 1e-3 keeps
        waveforms to about 1e-4.
    free_spin : FreeSpin, optional
        For a driven rotor: contacts then see rotations about the mean of rotor and drive.
    touch : Touch
        Sensitivity of contacts to motion along the rim, which needs more modes.

    Raises
    ------
    InputError
        A body is unconstrained: the modal form of closed contacts needs its static response, which does not
        exist.
    """
    return reduce_to(model, spin, accuracy, kept_modes(model, spin, accuracy, touch), free_spin)


def reduce_to(
    model: Model, spin: float, accuracy: float, are_kept: list[Bools], free_spin: FreeSpin | None = None
) -> ReducedModel:
    """The same with given kept modes of each part (`truncation.kept_modes`)."""
    mass, damping, stiffness, force = whole_system(model, spin)
    degree, output, carrier = degrees_of(model), output_degrees(model), carrier_degrees(model)
    standstill = at_standstill(model)
    modes = [parted(part, is_kept) for part, is_kept in zip(standstill.parts, are_kept, strict=True)]
    symmetric, seen = standstill.stiffness, seen_degrees(model)
    kept = np.hstack([those.kept for those in modes])
    frequency = np.concatenate([those.kept_frequency for those in modes])
    drawn = np.hstack(
        [
            Grouped(standstill.groups, kept).under(0.5 * (damping + damping.T)),
            Grouped(standstill.groups, kept / frequency).under(stiffness - symmetric),
        ]
    )
    least = LEAST_RESPONSE * np.sqrt(accuracy)
    patterns = np.hstack([model.probe_patterns, bending_loads(model)])
    find = _attachments_once() if len(standstill.groups) > 1 else _attachment_modes
    basis = np.hstack([kept, *(find(those, seen, patterns, drawn, least) for those in modes)])
    grouped = Grouped(standstill.groups, basis)
    stiffness, damping = grouped.form(stiffness), grouped.form(damping)
    keep = np.flatnonzero(_visible(np.vstack([basis[seen], patterns.T @ basis]), stiffness, damping))
    basis, pick = basis[:, keep], np.ix_(keep, keep)
    at_contacts = np.where((degree >= 0)[:, :, None], basis[np.maximum(degree, 0)], 0.0)
    for i, (first, stator) in enumerate(zip(model.stator_start, model.stators, strict=True)):
        if stator.torsion >= 0:  # the wall of a bore that turns slides along with the rim
            at_contacts[i, TORSION] -= basis[first + stator.torsion]
    if free_spin is not None:
        at_contacts[:, TORSION] -= free_spin.share @ basis[: free_spin.share.size]
    return ReducedModel(
        spin=spin,
        basis=basis,
        mass=mass,
        stiffness=stiffness[pick],
        damping=damping[pick],
        force=force @ basis,
        degree=at_contacts,
        output=np.where((output >= 0)[:, None], basis[np.maximum(output, 0)], 0.0),
        carrier=np.where((carrier >= 0)[:, :, None], basis[np.maximum(carrier, 0)], 0.0),
        probe=model.probe_rows @ basis,
    )


def reduced_sag(model: Model, reduced: ReducedModel) -> Floats:
    """Sag (n_dof,), m, of a rotor of little stiffness: in reduced coordinates, whose stiffness holds it."""
    n = model.rotor.n_dof
    basis, project = reduced.basis[:n], reduced.project[:, :n]
    rests = np.linalg.solve(reduced.stiffness, basis.T @ model.load)
    sag: Floats = model.sag + basis @ (rests - project @ model.sag)
    return sag


def bending_loads(model: Model) -> Floats:
    """Forces on each bent stator, (n_all, n_bent), where a lateral force at its tip meets an axial one.

    An axial force N adds `-N S x` to the forces on a stator, with S the form of its squared slope: a lateral
    load along its length, which static responses to tip forces do not represent. Here x is its static bending
    by a lateral force of 1 N at the tip, and N is 1 N.
    """
    loads = []
    for first, stator, degree in zip(model.stator_start, model.stators, degrees_of(model), strict=True):
        if stator.squared_slope is None:
            continue
        rows = slice(int(first), int(first) + stator.body.n_dof)
        bending = sum(
            part.mode[rows] @ (part.mode[degree[LATERAL]] / part.frequency**2)
            for part in at_standstill(model).parts
        )
        loads.append(np.zeros(len(model.probe_patterns)))
        loads[-1][rows] = stator.squared_slope @ bending
    return np.array(loads).reshape(-1, len(model.probe_patterns)).T


def _attachment_modes(modes: Modes, seen: Ints, patterns: Floats, drawn: Floats, least: float) -> Floats:
    """Residual attachment modes: static responses of the omitted modes, (n_all, n_shape).

    They are orthonormal in the mass. They are responses to a unit force on each seen degree, to the
    `patterns` (n_all, n_pattern) of forces, and to combinations of the forces `drawn` (n_all, n_force) by
    modes at unit velocity whose strain energy is over `least`^2 of that of the mode. Proportional damping
    gives none: it does not couple modes.
    """
    if not modes.rest_frequency.size:
        return modes.rest
    response = modes.rest.T / modes.rest_frequency[:, np.newaxis]  # its square is twice the strain energy
    turn, size, _ = np.linalg.svd(response @ drawn, full_matrices=False)
    shape = (
        np.hstack([response[:, seen], response @ patterns, turn[:, size > least]])
        / modes.rest_frequency[:, np.newaxis]
    )
    length = np.linalg.norm(shape, axis=0)
    shape = shape[:, length > 0.0] / length[length > 0.0]
    size, mix = np.linalg.eigh(shape.T @ shape)
    independent = size > 1e-8 * size[-1]
    mixed: Floats = modes.rest @ (shape @ mix[:, independent] / np.sqrt(size[independent]))
    return mixed


def _attachments_once() -> Callable[[Modes, Ints, Floats, Floats, float], Floats]:
    """Return `_attachment_modes` with a cache for equal bodies, as in a ring."""
    known: dict[bytes, Floats] = {}

    def find(modes: Modes, seen: Ints, patterns: Floats, drawn: Floats, least: float) -> Floats:
        rows = modes.rows
        place = np.full(len(modes.rest), -1)
        place[rows] = np.arange(rows.size)
        own = modes._replace(rows=place[rows], kept=modes.kept[rows], rest=modes.rest[rows])
        seen, patterns, drawn = place[seen[place[seen] >= 0]], patterns[rows], drawn[rows]
        drawn, patterns = (forces[:, forces.any(axis=0)] for forces in (drawn, patterns))
        name = b"".join(a.tobytes() for a in (own.rest, own.rest_frequency, seen, patterns, drawn))
        if name not in known:
            known[name] = _attachment_modes(own, seen, patterns, drawn, least)
        found = np.zeros((len(modes.rest), known[name].shape[1]))
        found[rows] = known[name]
        return found

    return find


def _visible(seen: Floats, stiffness: Floats, damping: Floats) -> NDArray[np.bool_]:
    """Coordinates that move a seen degree, or are coupled by K or C to one that does."""
    scale = np.sqrt(np.maximum(np.abs(np.diag(stiffness)), 1.0))
    couples = np.abs(stiffness) > UNSEEN * np.outer(scale, scale)
    couples |= np.abs(damping) > UNSEEN * np.sqrt(np.outer(scale, scale))
    largest = np.abs(seen).max(axis=1, keepdims=True)
    moves = np.any(np.abs(seen) > UNSEEN * np.maximum(largest, np.finfo(float).tiny), axis=0)
    is_visible = np.zeros(len(couples), dtype=bool)
    for rows in coupled_rows(couples):
        is_visible[rows] = moves[rows].any()
    return is_visible


def kernel_bodies(
    reduced: ReducedModel,
    model: Model,
    friction: float,
    clearance: Floats,
    law: Law,
    displacement_limit: float,
) -> Reduced:
    """Return the reduced bodies of a case for kernels; clearance (q,) and limit in m."""
    gap_jacobian, force_direction, slip = directions(reduced, model, friction)
    radius = np.array([stator.radius for stator in model.stators])
    return Reduced(
        stiffness=reduced.stiffness,
        damping=reduced.damping,
        force_cosine=reduced.force[0].copy(),
        force_sine=reduced.force[1].copy(),
        gap_jacobian=gap_jacobian,
        force_direction=force_direction,
        delassus=gap_jacobian @ force_direction.T,
        friction=np.full(clearance.size, friction),
        radius=radius,
        rim_speed=radius * abs(reduced.spin),
        slip=slip,
        restitution=law.restitution,
        clearance=clearance,
        translations=reduced.translations,
        displacement_limit=displacement_limit,
        overlap=GAP_TOLERANCE,
    )


def directions(reduced: ReducedModel, model: Model, friction: float) -> tuple[Floats, Floats, Floats]:
    """Rate of each gap, force of a unit contact, and slip, each (q, n), for the fixed normal.

    With e the stator's axis and t = x_hat x e: the gap is `clearance + axial - e . (v, w)`; the disc feels
    `-e - mu t` and `-mu r_d` in torsion, the tip the opposite (paper, Eqs. 4, 8-10, 19), with mu signed as
    the spin; the slip speed is `sign(spin) (r_d (spin + thx') + t . (vA - vB))`.
    """
    angle = np.array([stator.angle for stator in model.stators])
    radius = np.array([stator.radius for stator in model.stators])
    ey, ez = np.cos(angle)[:, None], np.sin(angle)[:, None]
    v, w, torsion, axial, lateral = (reduced.degree[:, a] for a in range(N_DEGREE))
    gap_jacobian = axial - ey * v - ez * w
    along = lateral + ez * v - ey * w - radius[:, None] * torsion
    sense = plain(rim_sense)(reduced.spin)
    return gap_jacobian, gap_jacobian + sense * friction * along, -sense * along


class AlongSpeeds:
    """Reduces a model once for a range of speeds, so that all speeds share one basis.

    The basis has the modes that any of the given speeds needs. Gyroscopic terms are proportional to the
    speed, unbalance forces to its square. Nothing else changes, unless bearings do.

    Parameters
    ----------
    spins : iterable of float, rad/s
        Speeds of the range, its ends above all.
    accuracy : float
    touch : Touch
        As of `reduce_model`.
    """

    def __init__(self, model: Model, spins: Iterable[float], accuracy: float, touch: Touch = SMOOTH) -> None:
        """Choose the basis, and project on it."""
        spins = sorted(spins, key=abs)
        choices = zip(*(kept_modes(model, spin, accuracy, touch) for spin in spins), strict=True)
        parts = at_standstill(model).parts
        are_kept = [
            completed(part, reduce(np.logical_or, of)) for part, of in zip(parts, choices, strict=True)
        ]
        self._fastest = reduce_to(model, spins[-1], accuracy, are_kept)
        basis = self._fastest.basis
        for name in ("project", "translations"):  # found once, for `at` to copy
            getattr(self._fastest, name)
        _, still, _, _ = whole_system(model, 0.0)
        _, _, _, force = whole_system(model, 1.0)
        self._damping = basis.T @ still @ basis
        gyroscopic = np.zeros_like(still)
        first = 0
        for body in model.bodies:
            rows = slice(first, first + body.n_dof)
            gyroscopic[rows, rows] = body.gyroscopic
            first += body.n_dof
        self._gyroscopic, self._force = basis.T @ gyroscopic @ basis, force @ basis

    def at(self, spin: float) -> ReducedModel:
        """The model at a speed, rad/s."""
        found = copy(self._fastest)  # including its cached projections
        damping, force = self._damping + spin * self._gyroscopic, spin**2 * self._force
        vars(found).update(spin=spin, damping=damping, force=force)
        return found
