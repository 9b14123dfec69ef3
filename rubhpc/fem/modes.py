"""Damped, gyroscopic modes of a body, with their kind and sense of whirl."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import LinAlgError, eig, eigh, null_space

from rubhpc.errors import InputError
from rubhpc.fem.model import FAR_APART

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from rubhpc.fem.model import Body

    Vector = NDArray[np.complex128]
    Pair = tuple[complex, complex, Vector]
    Matrix = NDArray[np.float64]

EPS = float(np.finfo(np.float64).eps)


def undamped_modes(mass: Matrix, stiffness: Matrix) -> tuple[Matrix, Matrix]:
    """Solve `K x = w^2 M x`.

    Parameters
    ----------
    mass, stiffness : (n_dof, n_dof)
        Symmetric, the mass positive definite.

    Returns
    -------
    square : (n_dof,)
        w^2, rad^2/s^2: exactly 0 for a rigid body's modes, which come first, then rising.
    basis : (n_dof, n_dof)
        Shapes as columns, `basis^T M basis = 1`.

    Raises
    ------
    InputError
        When the matrices are too ill-conditioned.

    Notes
    -----
    The eigenvalues of `(K, M)` carry the rounding of the highest, that of a short stiff element. Those of
    `(M, K)` are 1/w^2, exact for the lowest, and inexact only for frequencies some 1e7 times as high.
    """
    try:
        return _undamped_modes(mass, stiffness)
    except (LinAlgError, ValueError):  # which scipy raises for what is not finite
        raise InputError(f"modes: {FAR_APART}") from None


def _undamped_modes(mass: Matrix, stiffness: Matrix) -> tuple[Matrix, Matrix]:
    rigid = _rigid_shapes(mass, stiffness)
    if rigid.shape[1] == len(mass):
        return np.zeros(len(mass)), rigid
    complement = null_space((mass @ rigid).T) if rigid.size else np.eye(len(mass))
    M, K = (complement.T @ matrix @ complement for matrix in (mass, stiffness))
    try:
        flexibility, shapes = eigh(M, K)
    except LinAlgError:  # not positive definite: a negative stiffness
        square, shapes = eigh(K, M)
    else:
        flexibility = np.maximum(flexibility, EPS * flexibility.max())[::-1]
        square, shapes = 1 / flexibility, shapes[:, ::-1] / np.sqrt(flexibility)
    return np.append(np.zeros(rigid.shape[1]), square), np.hstack([rigid, complement @ shapes])


def _rigid_shapes(mass: Matrix, stiffness: Matrix) -> Matrix:
    """Motions that meet no stiffness, (n_dof, n_rigid), of unit modal mass.

    They are the null space of K scaled to a unit diagonal, whose smallest other value falls only with the
    number of elements, not with the frequencies of the mesh.
    """
    scale = np.sqrt(np.abs(np.diag(stiffness)))
    scale[scale == 0.0] = 1.0
    values, vectors = eigh(stiffness / np.outer(scale, scale))
    shapes = vectors[:, np.abs(values) < 4 * len(values) * EPS] / scale[:, np.newaxis]
    to_unit_mass = np.linalg.inv(np.linalg.cholesky(shapes.T @ mass @ shapes)).T
    rigid: Matrix = shapes @ to_unit_mass
    return rigid


# Kind of motion by degree. Beams do not couple the kinds; user-supplied matrices may.
KINDS = {
    "lateral": ("v", "w", "thy", "thz", "lateral", "rotation"),
    "torsional": ("thx",),
    "axial": ("u", "axial"),
}
_EXACT = 1e-10  # rounding of an eigenvalue, over its size, that is accepted
OTHER = "other"  # kind of the degrees that only user-supplied matrices have


@dataclass(frozen=True, kw_only=True, eq=False)
class Mode:
    """One mode `Re(shape exp(eigenvalue t))` of a body at one spin.

    Attributes
    ----------
    frequency : float
        Natural frequency, `|eigenvalue| / 2 pi`, Hz; modes are sorted by it. An overdamped mode has two real
        eigenvalues a and b, and the frequency `sqrt(|a b|) / 2 pi`; a rigid-body mode has 0.
    damped_frequency : float
        Frequency of the free oscillation, `Im(eigenvalue) / 2 pi`, Hz; 0 for an overdamped mode.
    damping_ratio : float
        `-Re(eigenvalue) / |eigenvalue|` for an oscillating mode, negative if it is unstable;
        `-(a + b) / (2 sqrt(a b))`, at least 1, for an overdamped one, and -1 if it is unstable. A rigid-body
        mode has 0, or 1 if a damper stops it.
    kind : str
        "lateral", "torsional" or "axial"; if matrices couple them, the one with most of the kinetic energy,
        which is "other" for user-defined coordinates.
    whirl : str
        "forward" (in the sense of the spin), "backward", "mixed" if some nodes whirl forward and others
        backward, or "planar" if neither dominates, as in the two equal modes of an isotropic rotor at
        standstill. "none" for other kinds, for stators, and if some node moves in one plane only.
    eigenvalue : complex
        rad/s, with an imaginary part of at least 0; of two real eigenvalues the one that decays more slowly.
    shape : (n_dof,) complex
        Displacements, scaled to unit modal mass (shape^H M shape = 1); the largest component is real and
        positive.
    """

    frequency: float
    damped_frequency: float
    damping_ratio: float
    kind: str
    whirl: str
    eigenvalue: complex
    shape: Vector


def modes(body: Body, spin: float = 0.0) -> list[Mode]:
    """Return all modes of a body, by rising natural frequency.

    Parameters
    ----------
    body : Body
        Rotor or stator.
    spin : float
        rad/s, positive about +x.

    Returns
    -------
    list of Mode
        One for each degree of freedom.
    """
    body = body.at(spin)
    found = []
    for rows in _groups(body):
        block = np.ix_(rows, rows)
        mass = body.mass[block]
        damping = (body.damping + spin * body.gyroscopic)[block]
        names = [body.degrees[row][1] for row in rows]
        pairs = _eigenpairs(mass, damping, body.stiffness[block])
        if _turns([body.degrees[row] for row in rows]):
            pairs, whirls = _whirls(pairs, mass, names, spin)
        else:
            whirls = ["none"] * len(pairs)
        for (first, second, shape), whirl in zip(pairs, whirls, strict=True):
            full = np.zeros(body.n_dof, dtype=np.complex128)
            full[rows] = _normalised(shape, mass)
            kind = _kind(shape, mass, names)
            found.append(_mode(first, second, full, kind, whirl if kind == "lateral" else "none"))
    return sorted(found, key=lambda mode: (mode.frequency, mode.damped_frequency))


def _groups(body: Body) -> list[list[int]]:
    """Rows of each eigenproblem: one for each kind of motion, or for kinds that the body couples."""
    kind = np.array([_kind_of(name) for _, name in body.degrees])
    label = np.unique(kind, return_inverse=True)[1] if body.n_dof else np.zeros(0, dtype=int)
    for part in range(int(body.part.max(initial=-1)) + 1):
        met = np.unique(label[body.part == part])
        label[np.isin(label, met)] = met[0]
    return [np.flatnonzero(label == value).tolist() for value in np.unique(label)]


@cache
def _kind_of(name: str) -> str:
    return next((kind for kind, names in KINDS.items() if name in names), OTHER)


def _kind(shape: Vector, mass: NDArray[np.float64], names: list[str]) -> str:
    """Kind of motion that has most of the kinetic energy."""
    kinds = [_kind_of(name) for name in names]
    if kinds.count(kinds[0]) == len(kinds):
        return kinds[0]
    share = np.real(shape.conj() * (mass @ shape))
    return max(dict.fromkeys(kinds), key=lambda kind: sum(share[[k == kind for k in kinds]]))


def _turns(degrees: list[tuple[int, str]]) -> bool:
    """Whether all nodes with a lateral degree have it in both planes, in the same order."""
    places = {name: [node for node, n in degrees if n == name] for name in ("v", "w", "thy", "thz")}
    if any(name == "axial" for _, name in degrees):  # a carrier with stators, which are in no plane
        return False
    return bool(places["v"]) and places["v"] == places["w"] and places["thy"] == places["thz"]


def modal_form(mass: Matrix, damping: Matrix, stiffness: Matrix) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """Return the equations of motion in the undamped modes of the symmetric part of the stiffness.

    Returns
    -------
    basis : (n_dof, n_dof)
        The modes as columns, `basis^T M basis = 1`.
    sigma : (n_dof,)
        Their frequencies, rad/s; 1 of a rigid-body mode.
    stiffness, damping : (n_dof, n_dof)
        `basis^T K basis` and `basis^T C basis`.
    """
    symmetric = (stiffness + stiffness.T) / 2
    square, basis = undamped_modes(mass, symmetric)
    sigma = np.where(square == 0.0, 1.0, np.sqrt(np.abs(square)))
    stiff = np.diag(square) + basis.T @ (stiffness - symmetric) @ basis
    return basis, sigma, stiff, basis.T @ damping @ basis


def first_order(sigma: Matrix, stiffness: Matrix, damping: Matrix) -> Matrix:
    """Return the state matrix (2 n, 2 n) of equations in their modal form, of states `y = sigma q` and `q'`.

    With N, the skew-symmetric part of K, it reads `y' = sigma q'` and `q'' = -(sigma + N / sigma) y - C q'`.
    Without damping and N it is skew-symmetric, and its eigenvalues are as accurate as the undamped ones, over
    four decades of frequency.
    """
    n_mode = len(sigma)
    state = np.block([[np.zeros((n_mode, n_mode)), np.diag(sigma)], [-stiffness / sigma, -damping]])
    if not np.isfinite(state).all():
        raise InputError(f"modes: {FAR_APART}")
    return state


def _eigenpairs(
    mass: NDArray[np.float64], damping: NDArray[np.float64], stiffness: NDArray[np.float64]
) -> list[Pair]:
    """Both eigenvalues (rad/s) of each mode, the slower first, and its shape."""
    basis, sigma, stiff, damp = modal_form(mass, damping, stiffness)
    n_mode = len(mass)
    state = first_order(sigma, stiff, damp)
    values, vectors = eig(state)
    if EPS * np.abs(values).max(initial=0.0) > _EXACT * np.abs(values).min(initial=np.inf):
        values, vectors = _refined(state, stiff, damp, sigma)
    shapes = basis @ (vectors[:n_mode] / sigma[:, np.newaxis])
    # at critical damping rounding splits a double root by the square root of EPS
    oscillates = values.imag > 1e-7 * np.abs(values)
    pairs: list[Pair] = [
        (complex(values[i]), complex(values[i].conj()), shapes[:, i]) for i in np.flatnonzero(oscillates)
    ]
    real = np.abs(values.imag) <= 1e-7 * np.abs(values)
    pairs.extend(_real_pairs(values[real].real, shapes[:, real].real, mass, damping))
    return pairs


def _refined(
    state: NDArray[np.float64],
    stiffness: NDArray[np.float64],
    damping: NDArray[np.float64],
    sigma: NDArray[np.float64],
) -> tuple[Vector, NDArray[np.complex128]]:
    """Eigenvalues (rad/s) of a state matrix, and vectors.

    Lightly damped ones are free of the rounding of the highest: roots of `y^H (s^2 + s C + K) x = 0` with the
    left and right shapes y and x, whose error is that of both shapes multiplied.
    """
    values, left, vectors = eig(state, left=True)
    x, y = vectors[: len(sigma)] / sigma[:, np.newaxis], left[len(sigma) :].conj()
    a, b, c = (np.sum(y * part, axis=0) for part in (x, damping @ x, stiffness @ x))
    with np.errstate(divide="ignore", invalid="ignore"):  # where left and right shapes are of two twins
        middle, reach = -b / (2 * a), np.sqrt((b / (2 * a)) ** 2 - c / a)
        roots = np.stack([middle + reach, middle - reach])
    change = np.abs(roots - values)
    nearest = np.take_along_axis(roots, np.argmin(change, axis=0)[np.newaxis], axis=0)[0]
    is_better = change.min(axis=0) <= 100 * EPS * np.abs(values).max()
    for light in (values, nearest):
        is_better &= np.abs(light.real) < light.imag
    return np.where(is_better, nearest, values), vectors


def _real_pairs(
    values: NDArray[np.float64],
    shapes: NDArray[np.float64],
    mass: NDArray[np.float64],
    damping: NDArray[np.float64],
) -> Iterator[Pair]:
    """Yield the real eigenvalues in pairs: the two of a mode have the most similar shapes.

    Shapes are compared in the norm of the damping matrix: the slow root of a bearing also bends the shaft,
    its fast root does not. A small share of the mass matrix keeps the norm definite without damping.
    """
    resistance = (damping + damping.T) / 2
    trace = 1e-9 * np.abs(resistance).max() / np.abs(mass).max() or 1.0
    weight = resistance + trace * mass
    likeness = shapes.T @ weight @ shapes
    size = np.sqrt(np.maximum(np.abs(np.diag(likeness)), np.finfo(float).tiny))
    likeness = np.abs(likeness / np.outer(size, size))
    np.fill_diagonal(likeness, -1.0)
    for _ in range(len(values) // 2):
        pair = np.unravel_index(np.argmax(likeness), likeness.shape)
        slow, fast = sorted(pair, key=lambda i: -values[i])
        yield complex(values[slow]), complex(values[fast]), shapes[:, slow].astype(np.complex128)
        likeness[list(pair)] = likeness[:, list(pair)] = -1.0


def _whirls(
    pairs: list[Pair], mass: NDArray[np.float64], names: list[str], spin: float
) -> tuple[list[Pair], list[str]]:
    """Return modes and their sense of whirl; two with one eigenvalue are replaced by planar ones."""
    pairs = sorted(pairs, key=lambda pair: pair[0].imag)
    tolerance = 100 * EPS * max(abs(first) for first, _, _ in pairs)
    words = [whirl_word(shape, mass, names, spin) for _, _, shape in pairs]
    for i, ((one, _, shape), (other, _, twin)) in enumerate(pairwise(pairs)):
        if one.imag > 0.0 and abs(one - other) < tolerance + 1e-9 * abs(one):
            vertical, horizontal = planar_twins(shape, twin, names)
            pairs[i] = (*pairs[i][:2], vertical)
            pairs[i + 1] = (*pairs[i + 1][:2], horizontal)
            words[i] = words[i + 1] = "planar"
    return pairs, words


def _normalised(shape: Vector, mass: NDArray[np.float64]) -> Vector:
    scale = np.sqrt(np.real(shape.conj() @ mass @ shape))
    largest = shape[np.argmax(np.abs(shape))]
    normalised: Vector = shape * (abs(largest) / largest / scale)
    return normalised


def _mode(first: complex, second: complex, shape: Vector, kind: str, whirl: str) -> Mode:
    natural = math.sqrt(abs(first) * abs(second))
    if first.imag > 0.0:
        ratio = -first.real / natural + 0.0  # no -0.0
    elif first.real < 0.0:
        ratio = -(first.real + second.real) / (2 * natural)
    elif first.real > 0.0:
        ratio = -1.0
    else:
        ratio = 1.0 if second.real < 0.0 else 0.0
    return Mode(
        frequency=natural / (2 * math.pi),
        damped_frequency=first.imag / (2 * math.pi),
        damping_ratio=ratio,
        kind=kind,
        whirl=whirl,
        eigenvalue=first,
        shape=shape,
    )


# A mode of index 1e-3 moves on ellipses 2000 times as long as wide.
PLANAR = 1e-3
AT_REST = 0.01  # of the largest amplitude of a mode: less is a node of it


def whirl_index(shape: Vector, mass: NDArray[np.float64], names: Sequence[str]) -> float:
    """Forward less backward kinetic energy over their sum: 1 turns from y to z, -1 from z to y, 0 is planar.

    The motion `v + i w` (and `thz - i thy`, the tilt) of `Re(shape exp(i omega t))` is a sum of
    `F exp(i omega t)` and `conj(B) exp(-i omega t)`. Weighting with the mass adds up what different nodes
    do: some may whirl forward while others whirl backward.

    Parameters
    ----------
    shape : (n_dof,) complex
        With exp(i omega t), omega positive.
    mass : (n_dof, n_dof)
        Of the lateral degrees, equal in both planes.
    names : sequence of str
        Which degree each row is: "v", "w", "thy", "thz", all at every node.
    """
    vertical, horizontal, sign = _planes(names)
    plane_mass = mass[np.ix_(vertical, vertical)]
    V, W = shape[vertical], sign * shape[horizontal]
    forward, backward = V + 1j * W, V - 1j * W
    energy = [float(np.real(part.conj() @ plane_mass @ part)) for part in (forward, backward)]
    total = energy[0] + energy[1]
    return (energy[0] - energy[1]) / total if total > 0.0 else 0.0


def planar_twins(first: Vector, second: Vector, names: Sequence[str]) -> tuple[Vector, Vector]:
    """Vertical and horizontal modes that span the same motions as two modes of one eigenvalue."""
    vertical, horizontal, _ = _planes(names)
    span = np.stack([first, second], axis=1)
    # of all their combinations, the one with least horizontal motion, then the one with least vertical
    least_horizontal = np.linalg.svd(span[horizontal])[2][-1].conj()
    least_vertical = np.linalg.svd(span[vertical])[2][-1].conj()
    return span @ least_horizontal, span @ least_vertical


def whirl_word(shape: Vector, mass: NDArray[np.float64], names: Sequence[str], spin: float) -> str:
    """Return "forward" for a whirl in the sense of the spin (at standstill: of positive spin).

    "mixed" where some nodes whirl forward and others backward; nodes that hardly move do not count.
    """
    V, W = (shape[[row for row, n in enumerate(names) if n == name]] for name in ("v", "w"))
    size, area = np.abs(V) ** 2 + np.abs(W) ** 2, 2.0 * np.imag(V * W.conj())
    moves = size > AT_REST**2 * size.max(initial=0.0)
    if (area > PLANAR * size)[moves].any() and (area < -PLANAR * size)[moves].any():
        return "mixed"
    index = whirl_index(shape, mass, names)
    if abs(index) < PLANAR:
        return "planar"
    return "forward" if (index > 0.0) == (spin >= 0.0) else "backward"


def _planes(names: Sequence[str]) -> tuple[list[int], list[int], NDArray[np.float64]]:
    """Rows of either plane in the same order, and the signs of the horizontal ones (-thy bends w up)."""
    vertical = [row for name in ("v", "thz") for row, n in enumerate(names) if n == name]
    horizontal = [row for name in ("w", "thy") for row, n in enumerate(names) if n == name]
    return vertical, horizontal, np.array([-1.0 if names[row] == "thy" else 1.0 for row in horizontal])
