"""Sense of whirl of a lateral mode: how much of its motion turns with the spin, how much against."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Vector = NDArray[np.complex128]

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
