"""What enters a contact mode that follows the speed: inverses of its shapes at seven places of a range."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.changing_speed.mode_courses import (
    EXACT,
    JUDGED,
    LEAST,
    Entries,
    between,
    most_of,
    shares_of,
    weights,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.integrate.changing_speed.mode_courses import Node

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]


def entries(nodes: Sequence[Node]) -> Entries:
    """What enters a mode between `NODES`: inverses of its shapes, in the coordinates of those in the middle.

    A mode that stands for a pair has two coordinates here, real and imaginary part, so that all is real but
    where two real exponents come as a pair.
    """
    mode, n_node = nodes[0].mode, len(nodes)
    m, is_pair = mode.n_eigenmode, weights(mode) > 1.5
    paired = np.flatnonzero(is_pair)
    change = np.array([node.mode.motion for node in nodes[1:]]) - mode.motion
    shares = np.array([shares_of(place, n_node) for place in EXACT])
    is_moved = (change[..., :m] != 0.0).any(axis=(0, 1))
    columns = np.flatnonzero(np.append(is_moved, is_moved[paired]))
    every = _in_parts(mode.enter[:m].T, is_pair, 1.0).T
    seen = every @ _in_parts(change[..., :m], is_pair, -1.0)[..., columns]
    # Modes that change, or that others change into: their coordinates, imaginary parts last.
    is_pushed = np.abs(seen).max(axis=(0, 2), initial=0.0) > LEAST
    is_moved |= is_pushed[:m]
    is_moved[paired] |= is_pushed[m:]
    rows, both = np.flatnonzero(is_moved), np.flatnonzero(np.append(is_moved, is_moved[paired]))
    mixed = np.zeros((len(change), both.size, both.size), dtype=seen.dtype)
    mixed[..., np.searchsorted(both, columns)] = seen[:, both]
    unit = np.eye(both.size)

    def turned(shares: Floats) -> Floats:
        return np.tensordot(shares, mixed, axes=1) + unit

    back = np.linalg.inv(turned(shares[1:]))
    through = [unit, *back]
    judged = np.array([shares_of(place, n_node) for place in JUDGED])
    lost = max(
        most_of(between(through, place) @ kept - unit)
        for place, kept in zip(JUDGED, turned(judged), strict=True)
    )
    entered = back @ every[both]
    found = np.tile(mode.enter[:m], (len(shares), 1, 1))
    found[1:, rows] = entered[:, : rows.size]
    found[1:, rows[is_pair[rows]]] += 1j * entered[:, rows.size :]
    beyond = mode.motion[:, m:] + np.tensordot(shares, change[..., m:], axes=1)
    for k in range(m, len(mode.enter)):  # coordinates beside the eigenmodes that motion enters
        if mode.enter[k].any():
            found[1:] -= (found[1:] @ beyond[1:, :, k - m, np.newaxis]) * mode.enter[k]
    constants = beyond[..., 1 : 1 + len(mode.take_off) - 2]
    return Entries(found, (found @ constants).transpose(0, 2, 1), lost)


def _in_parts(values: Complexes, is_pair: NDArray[np.bool_], sign: float) -> Floats:
    """Real parts of values (..., m), and behind them imaginary parts of those of pairs, by a sign.

    Others stay as they are; all is complex where one of them is.
    """
    parts = np.concatenate([values.real, sign * values[..., is_pair].imag], axis=-1)
    single = np.flatnonzero(~is_pair)
    if values[..., single].imag.any():
        parts = parts.astype(np.complex128)
        parts[..., single] = values[..., single]
    return parts
