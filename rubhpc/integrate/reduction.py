"""Galerkin reduction: the lowest modes of each body and residual attachment modes, with unit mass."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from rubhpc.errors import InputError
from rubhpc.integrate.packing import carrier_degrees, degrees_of, output_degrees, whole_system
from rubhpc.kernels.contact_modes import Reduced
from rubhpc.kernels.contact_pairs import N_DEGREE, V, W, rim_sense

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.kernels.laws import Law

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]

# Modes up to this multiple of the contact frequency (or the spin, where that is higher), times
# (1e-3 / accuracy)^(1/4): modes above are kept as static shapes, whose error goes with the fourth
# power of the frequency ratio.
CUTOFF_RATIO = 10.0
FEWEST_MODES = 2  # kept of every part, whatever their frequency
# Static response to a damper, as a share of the mode that it slows, times sqrt(accuracy), that is left out:
# the mode's exponent errs by the square.
LEAST_RESPONSE = 0.1
FREE = 1e-12  # square of a frequency over the greatest, below which a mode is free motion
UNSEEN = 1e-9  # relative motion or coupling below which a mode is taken for unseen


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
    carrier : (n_carrier, 2, n)
        Vertical and horizontal displacement of each carrier.
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


def reduce_model(model: Model, spin: float, accuracy: float) -> ReducedModel:
    """Reduce a model so that contact and outputs are met to the accuracy asked for.

    The basis of each uncoupled part holds its undamped modes at standstill up to a cutoff, and residual
    attachment modes: the static responses of what lies above to a unit force on each degree that contact or
    outputs see, or on those together that a probe sees, and to what dampers and cross-coupled springs draw
    from the modes kept. Gyroscopic and damping terms are then projected. Modes that nothing sees are left
    out.

    Parameters
    ----------
    spin : float, rad/s
    accuracy : float
        Relative; 1e-3 keeps waveforms to about 1e-4 on the packaged rig.

    Raises
    ------
    InputError
        Where nothing holds a body: its constant response, on which the modal form of closed contacts rests,
        does not exist.
    """
    mass, damping, stiffness, force = whole_system(model, spin)
    degree, output, carrier = degrees_of(model), output_degrees(model), carrier_degrees(model)
    standstill = _at_standstill(model)
    cutoff = cutoff_frequency(model, spin, accuracy)
    modes = [_parted(part, cutoff) for part in standstill.parts]
    symmetric, seen = standstill.stiffness, _seen(model)
    kept = np.hstack([those.low for those in modes])
    frequency = np.concatenate([those.low_frequency for those in modes])
    drawn = np.hstack([0.5 * (damping + damping.T) @ kept, (stiffness - symmetric) @ (kept / frequency)])
    least = LEAST_RESPONSE * np.sqrt(accuracy)
    patterns = model.probe_patterns
    basis = np.hstack([kept, *(_attachment_modes(those, seen, patterns, drawn, least) for those in modes)])
    stiffness, damping = basis.T @ stiffness @ basis, basis.T @ damping @ basis
    keep = np.flatnonzero(_visible(np.vstack([basis[seen], patterns.T @ basis]), stiffness, damping))
    basis, pick = basis[:, keep], np.ix_(keep, keep)
    return ReducedModel(
        spin=spin,
        basis=basis,
        mass=mass,
        stiffness=stiffness[pick],
        damping=damping[pick],
        force=force @ basis,
        degree=np.where((degree >= 0)[:, :, None], basis[np.maximum(degree, 0)], 0.0),
        output=np.where((output >= 0)[:, None], basis[np.maximum(output, 0)], 0.0),
        carrier=np.where((carrier >= 0)[:, :, None], basis[np.maximum(carrier, 0)], 0.0),
        probe=model.probe_rows @ basis,
    )


def cutoff_frequency(model: Model, spin: float, accuracy: float) -> float:
    """Frequency, rad/s, up to which modes are kept, and up to which probes see what the full model shows.

    Ten times the contact frequency (the rotor's inertia on the stator's static stiffness), or the spin where
    that is higher, times `(1e-3 / accuracy)^(1/4)`; infinite for rigid walls.
    """
    fastest = max(_at_standstill(model).contact_frequency, abs(spin))
    return float(CUTOFF_RATIO * (1e-3 / accuracy) ** 0.25 * fastest)


class _Part(NamedTuple):
    """Undamped modes of what mass and stiffness couple, orthonormal in the mass."""

    n_seen: int  # of its degrees, and of their combinations, are seen by contact, outputs or probes
    mode: Floats  # (n_all, n)
    frequency: Floats  # (n,), rad/s


class _Standstill(NamedTuple):
    """What a model is at every speed."""

    stiffness: Floats  # (n_all, n_all), its symmetric part
    parts: list[_Part]  # those that contact or outputs feel
    contact_frequency: float  # rad/s


@lru_cache(maxsize=4)
def _at_standstill(model: Model) -> _Standstill:
    """Find the modes of a model, once for all speeds."""
    mass, damping, stiffness, _ = whole_system(model, 1.0)  # at a speed, for what gyroscopic terms couple
    symmetric, seen = 0.5 * (stiffness + stiffness.T), _seen(model)
    coupled = (mass != 0) | (stiffness != 0)
    n_part, number = connected_components(csr_array(coupled), directed=False)
    _, whole = connected_components(csr_array(coupled | (damping != 0)), directed=False)
    is_seen, is_felt = np.zeros((2, len(mass)), dtype=bool)
    looked_at = model.probe_patterns != 0.0
    is_seen[seen], is_felt[whole[seen]] = True, True
    is_felt[whole[looked_at.any(axis=1)]] = True
    parts = []
    for i_part in range(n_part):
        rows = np.flatnonzero(number == i_part)
        if not is_felt[whole[rows[0]]]:
            continue
        square, shape = eigh(symmetric[np.ix_(rows, rows)], mass[np.ix_(rows, rows)])
        if square[0] <= FREE * square[-1]:
            raise InputError(
                "[integrator] method: modal needs bodies that are held, and here one is free to move or to "
                'turn; take method = "central-difference"'
            )
        mode = np.zeros((mass.shape[0], rows.size))
        mode[rows] = shape
        n_seen = is_seen[rows].sum() + looked_at[rows].any(axis=0).sum()
        parts.append(_Part(int(n_seen), mode, np.sqrt(square)))
    return _Standstill(symmetric, parts, _contact_frequency(parts, degrees_of(model), model))


def _seen(model: Model) -> Ints:
    """Degrees that contact or outputs see."""
    places = (degrees_of(model), output_degrees(model), carrier_degrees(model))
    return np.unique(np.concatenate([degree[degree >= 0] for degree in places]))


def _contact_frequency(parts: list[_Part], degree: Ints, model: Model) -> float:
    """Highest frequency, rad/s, of a contact: the rotor's inertia on the stator's static stiffness."""
    mode = np.hstack([part.mode for part in parts])
    square = np.concatenate([part.frequency for part in parts]) ** 2
    highest = 0.0
    for stator, (v, w, _, axial, _) in zip(model.stators, degree, strict=True):
        if axial < 0:
            return np.inf  # a rigid wall: no mode is too high
        along = sum(
            share * mode[row]
            for row, share in ((v, np.cos(stator.angle)), (w, np.sin(stator.angle)))
            if row >= 0
        )
        response = along / square  # to a unit force, mode by mode
        inertia = (response @ response) / (along @ response) ** 2  # of that shape, as that of the first mode
        compliance = mode[axial] @ (mode[axial] / square)
        if stator.alone is not None:  # an impact meets the stator before the carrier moves
            tip = stator.alone.axial
            compliance = np.linalg.inv(stator.alone.body.stiffness)[tip, tip]
        highest = max(highest, 1.0 / np.sqrt(inertia * compliance))
    return float(highest)


class _Modes(NamedTuple):
    """Undamped modes of a part, orthonormal in the mass."""

    low: Floats  # (n_all, n_low), kept
    low_frequency: Floats  # (n_low,), rad/s
    high: Floats  # (n_all, n_high), which only static shapes represent
    high_frequency: Floats  # (n_high,), rad/s


def _parted(part: _Part, cutoff: float) -> _Modes:
    """Modes up to a cutoff, rad/s, and beyond; all are kept where modes and shapes would be as many."""
    n_seen, mode, frequency = part
    n_low = max(int(np.count_nonzero(frequency <= cutoff)), min(FEWEST_MODES, frequency.size))
    if n_low + n_seen >= frequency.size:
        n_low = frequency.size
    return _Modes(mode[:, :n_low], frequency[:n_low], mode[:, n_low:], frequency[n_low:])


def _attachment_modes(modes: _Modes, seen: Ints, patterns: Floats, drawn: Floats, least: float) -> Floats:
    """Residual attachment modes: static responses of the modes above the cutoff, (n_all, n_shape).

    They are orthonormal in the mass, and respond to a unit force on each degree seen, to the `patterns`
    (n_all, n_pattern) of forces and to those combinations of the forces `drawn` (n_all, n_force) from modes
    at unit velocity whose strain energy is over `least`^2 of that mode's. Proportional damping draws none: it
    does not couple modes.
    """
    if not modes.high_frequency.size:
        return modes.high
    response = modes.high.T / modes.high_frequency[:, np.newaxis]  # its square is twice the strain energy
    turn, size, _ = np.linalg.svd(response @ drawn, full_matrices=False)
    shape = (
        np.hstack([response[:, seen], response @ patterns, turn[:, size > least]])
        / modes.high_frequency[:, np.newaxis]
    )
    length = np.linalg.norm(shape, axis=0)
    shape = shape[:, length > 0.0] / length[length > 0.0]
    size, mix = np.linalg.eigh(shape.T @ shape)
    independent = size > 1e-8 * size[-1]
    mixed: Floats = modes.high @ (shape @ mix[:, independent] / np.sqrt(size[independent]))
    return mixed


def _visible(seen: Floats, stiffness: Floats, damping: Floats) -> NDArray[np.bool_]:
    """Coordinates that move a seen degree, or that K or C couple to one that does."""
    scale = np.sqrt(np.maximum(np.abs(np.diag(stiffness)), 1.0))
    couples = np.abs(stiffness) > UNSEEN * np.outer(scale, scale)
    couples |= np.abs(damping) > UNSEEN * np.sqrt(np.outer(scale, scale))
    _, group = connected_components(csr_array(couples), directed=False)
    largest = np.abs(seen).max(axis=1, keepdims=True)
    moves = np.any(np.abs(seen) > UNSEEN * np.maximum(largest, np.finfo(float).tiny), axis=0)
    return np.isin(group, group[moves])


def kernel_bodies(
    reduced: ReducedModel,
    model: Model,
    friction: float,
    clearance: Floats,
    law: Law,
    displacement_limit: float,
) -> Reduced:
    """Return the reduced bodies of a case as kernels take them; clearance (q,) and limit in m."""
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
        spring=law.stiffness,
        damper=law.damping,
        clearance=clearance,
        translations=reduced.translations,
        displacement_limit=displacement_limit,
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
    sense = rim_sense(reduced.spin)
    return gap_jacobian, gap_jacobian + sense * friction * along, -sense * along
