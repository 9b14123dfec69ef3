"""Undamped modes of a model at standstill, and the choice of those that a reduced model keeps."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from rubhpc.errors import InputError
from rubhpc.fem.statics import find_rigid_body_mode, unheld_message
from rubhpc.integrate.packing import carrier_degrees, degrees_of, output_degrees, whole_system
from rubhpc.integrate.reduced_model.coupling import coupled_parts

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.fem.model import Body, Model

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# Modes up to this multiple of the contact frequency (or the spin, where that is higher), times (1e-3 /
# accuracy)^(1/4): modes above are represented by static shapes, with an error of the fourth power of the
# frequency ratio.
CUTOFF_RATIO = 10.0
FEWEST_MODES = 2  # kept of every part, whatever their frequency
SMALL = 256  # degrees of a body whose modes are cached for other rigs: 1.5 MB
FEW_PAIRS = 5  # where separating parts saves little
FREE = 1e-12  # square of a frequency over the greatest; less is rigid-body motion


def cutoff_frequency(model: Model, spin: float, accuracy: float) -> float:
    """Frequency, rad/s, up to which all modes are kept and probes agree with the full model.

    Ten times the contact frequency (the rotor's inertia on the stator's static stiffness), or the spin where
    that is higher, times `(1e-3 / accuracy)^(1/4)`; infinite for rigid walls.
    """
    fastest = max(at_standstill(model).contact_frequency, abs(spin))
    return float(CUTOFF_RATIO * (1e-3 / accuracy) ** 0.25 * fastest)


class Part(NamedTuple):
    """Undamped modes of a part that mass and stiffness couple, orthonormal in the mass."""

    n_seen: int  # number of degrees and combinations that contact, outputs or probes see
    rows: Ints  # its degrees
    mode: Floats  # (n_all, n)
    frequency: Floats  # (n,), rad/s


class Standstill(NamedTuple):
    """Properties of a model that do not depend on the speed."""

    stiffness: Floats  # (n_all, n_all), its symmetric part
    parts: list[Part]  # those seen by contact or outputs
    contact_frequency: float  # rad/s
    groups: list[Ints]  # degrees that are uncoupled at every speed; one group for few pairs


@lru_cache(maxsize=4)
def at_standstill(model: Model) -> Standstill:
    """Find the modes of a model, once for all speeds."""
    mass, _, stiffness, _ = whole_system(model, 1.0)
    symmetric, seen = 0.5 * (stiffness + stiffness.T), seen_degrees(model)
    number, whole = _coupled_degrees(model.bodies)
    is_seen, is_felt = np.zeros((2, len(mass)), dtype=bool)
    looked_at = model.probe_patterns != 0.0
    is_seen[seen], is_felt[whole[seen]] = True, True
    is_felt[whole[looked_at.any(axis=1)]] = True
    parts = []
    for i_part in range(number.max() + 1):
        rows = np.flatnonzero(number == i_part)
        if not is_felt[whole[rows[0]]]:
            continue
        pick = np.ix_(rows, rows)
        if rows.size <= SMALL:
            square, shape = _eigenmodes(symmetric[pick].tobytes(), mass[pick].tobytes())
        else:
            square, shape = eigh(symmetric[pick], mass[pick])
        if square[0] <= FREE * square[-1]:
            free = find_rigid_body_mode(model) or "here one is free to move or to turn"
            raise InputError(unheld_message(free))
        mode = np.zeros((mass.shape[0], rows.size))
        mode[rows] = shape
        n_seen = is_seen[rows].sum() + looked_at[rows].any(axis=0).sum()
        parts.append(Part(int(n_seen), rows, mode, np.sqrt(square)))
    if len(model.stators) <= FEW_PAIRS:
        whole[:] = 0
    groups = [np.flatnonzero(whole == i) for i in range(whole.max() + 1)]
    return Standstill(symmetric, parts, _contact_frequency(parts, degrees_of(model), model), groups)


def _coupled_degrees(bodies: Sequence[Body]) -> tuple[Ints, Ints]:
    """Number of the part of each degree (n_all,): coupled by mass and stiffness; by all matrices at speed.

    Equal bodies, as in a ring, are analysed once.
    """
    found: dict[int, list[Ints]] = {}
    numbers: list[list[Ints]] = [[], []]
    n_part = [0, 0]
    for body in bodies:
        if id(body) not in found:
            coupled = (body.mass != 0) | (body.stiffness != 0)
            moving = coupled | (body.damping + body.gyroscopic != 0)
            found[id(body)] = [coupled_parts(of) for of in (coupled, moving)]
        for i, own in enumerate(found[id(body)]):
            numbers[i].append(own + n_part[i])
            n_part[i] += own.max(initial=-1) + 1
    parts, whole = (np.concatenate(of) for of in numbers)
    return parts, whole


@lru_cache(maxsize=16)
def _eigenmodes(stiffness: bytes, mass: bytes) -> tuple[Floats, Floats]:
    """Squares of frequencies and modes of matrices (n, n), cached for bodies that rigs share."""
    n = math.isqrt(len(mass) // 8)
    square, shape = eigh(*(np.frombuffer(matrix).reshape(n, n) for matrix in (stiffness, mass)))
    return square, shape


def seen_degrees(model: Model) -> Ints:
    """Degrees that contact or outputs see."""
    places = (degrees_of(model), output_degrees(model), carrier_degrees(model))
    return np.unique(np.concatenate([degree[degree >= 0] for degree in places]))


def _contact_frequency(parts: list[Part], degree: Ints, model: Model) -> float:
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
        if stator.alone is not None:  # an impact acts on the stator before the carrier moves
            tip = stator.alone.axial
            compliance = np.linalg.inv(stator.alone.body.stiffness)[tip, tip]
        highest = max(highest, 1.0 / np.sqrt(inertia * compliance))
    return float(highest)


class Modes(NamedTuple):
    """Undamped modes of a part, orthonormal in the mass."""

    rows: Ints  # its degrees
    kept: Floats  # (n_all, n_kept)
    kept_frequency: Floats  # (n_kept,), rad/s
    rest: Floats  # (n_all, n_rest), represented only by static shapes
    rest_frequency: Floats  # (n_rest,), rad/s


def parted(part: Part, is_kept: Bools) -> Modes:
    """Modes kept (n,), and the others."""
    order, n_kept = np.argsort(~is_kept, kind="stable"), np.count_nonzero(is_kept)
    mode, frequency = part.mode.take(order, axis=1), part.frequency[order]
    return Modes(part.rows, mode[:, :n_kept], frequency[:n_kept], mode[:, n_kept:], frequency[n_kept:])


def modes_below(part: Part, cutoff: float) -> Bools:
    """Which modes (n,) are kept for a cutoff, rad/s."""
    return completed(part, part.frequency <= cutoff)


def completed(part: Part, is_kept: Bools) -> Bools:
    """Kept modes (n,): at least two, and all where modes and shapes would be as many."""
    is_kept = is_kept | (np.arange(is_kept.size) < FEWEST_MODES)
    return is_kept | (np.count_nonzero(is_kept) + part.n_seen >= is_kept.size)
