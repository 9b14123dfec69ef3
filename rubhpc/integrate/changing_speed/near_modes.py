"""A contact mode of matrices near those of one that is known, in its order, lengths and phases.

In the coordinates of the known modes, matrices that differ read `L + D`, with a diagonal L. A mode of them is
`x`, `x_j = 1`, with the exponent `l = L_j + (D x)_j`; what it has of the others follows from `x_k = (D x)_k /
(l - L_k)`, taken again and again (perturbation theory after Brillouin and Wigner). Each step has one more
order of what D mixes, and costs a product where a solution costs dozens.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.reduced_model.contact_mode import left_free
from rubhpc.integrate.reduced_model.products import real_times

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.integrate.reduced_model.reduction import ReducedModel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Complexes = NDArray[np.complex128]

STEPS, SETTLED = 24, 1e-8  # at most, and change of a share by the last of them
MOST = 0.5  # share of a known mode in another one, from which it may be that mode


class Linear(NamedTuple):
    """What a set of states makes of the motion: n reduced degrees, r switch functions."""

    seen: Complexes  # (n,), what the constraints leave of the unbalance at unit speed
    switch: Floats  # (r, 2 n), switch functions of the motion
    reaction: Complexes  # (r,), what they lose by the unbalance at unit speed
    across: Floats  # (n, r), friction forces by switch functions
    damping: Floats  # (n, n)
    passed: Floats  # (n, n), what the constraints leave of a force

    @classmethod
    def of_closed(
        cls,
        pairs: Sequence[int],
        reduced: ReducedModel,
        directions: tuple[Floats, Floats],
        phasor: Complexes,
    ) -> Linear:
        """Of closed pairs that slide; `directions` are gap Jacobian and forces, (q, n), of all pairs."""
        gap_jacobian, force_direction = directions
        (q, n), closed = gap_jacobian.shape, np.array(pairs, dtype=int)
        rate, force = gap_jacobian[closed], force_direction[closed].T
        tangent, project = left_free(rate, force)
        switch, reaction = np.hstack([gap_jacobian, np.zeros((q, n))]), np.zeros(q, dtype=complex)
        if closed.size:
            solved = np.linalg.solve(rate @ force, rate)
            switch[closed] = solved @ np.hstack([reduced.stiffness, reduced.damping])
            reaction[closed] = solved @ phasor
        across = np.zeros((n, q))
        across[:, closed] = (force_direction - gap_jacobian)[closed].T
        passed = tangent @ project
        return cls(passed @ phasor, switch, reaction, across, reduced.damping, passed)


def near_mode(
    mode: ContactMode, linear: tuple[Linear, Linear], reduced: ReducedModel, other: ReducedModel
) -> ContactMode | None:
    """The contact mode of other matrices; None where it has to be solved.

    What enters it, its response to unbalance, and what constants take off it, are left as in `mode`.

    Parameters
    ----------
    mode : ContactMode
        That of `reduced`.
    linear : two of Linear
        What its set of states makes of the motion with either matrices.
    """
    if mode.drift.any():
        return None  # what grows with time has a velocity
    m, n, weight = mode.n_eigenmode, reduced.stiffness.shape[0], weights(mode)
    own, next_ = linear
    change = own.passed @ np.hstack([other.stiffness - reduced.stiffness, other.damping - reduced.damping])
    enter, shape, exponent = mode.enter[:m], mode.motion[:, :m] / weight, mode.exponent[:m]
    paired = np.flatnonzero(weight > 1.5)
    # Conjugates come behind the modes that stand for a pair.
    swap = np.arange(m + paired.size)
    swap[paired], swap[m:] = m + np.arange(paired.size), paired
    every_enter = np.vstack([enter, enter[paired].conj()])
    pushed = -every_enter[:, n:] @ real_times(change, shape)
    whole = np.hstack([pushed, pushed[swap][:, paired].conj()])
    moved = np.flatnonzero((whole != 0.0).any(axis=0) | (whole != 0.0).any(axis=1))
    columns = moved[moved < m]
    every_exponent = np.append(exponent, exponent[paired].conj())
    found = _settled(whole[np.ix_(moved, moved)], every_exponent[moved], columns.size)
    if found is None:
        return None
    share, exponents = found
    motion, switch = mode.motion.copy(), mode.switch.copy()
    every_shape = np.hstack([shape, shape[:, paired].conj()])[:, moved]
    motion[:, columns] = every_shape @ share * weight[columns]
    new_exponent = mode.exponent.copy()
    # Decays stay real to the last bit: kernels know by that what does not vibrate.
    new_exponent[columns] = np.where(mode.exponent[columns].imag == 0.0, exponents.real, exponents)
    still = mode.motion[:, m + 1 :].real
    if (load := change @ still).any():
        mirrored = share[np.searchsorted(moved, swap[moved])][:, weight[columns] > 1.5].conj()
        driven = every_enter[moved, n:] @ load
        given = np.linalg.solve(np.hstack([share, mirrored]), driven)[: columns.size]
        motion[:, m + 1 :] += (motion[:, columns] @ (given / exponents[:, np.newaxis])).real
    moved_switch = real_times(next_.switch, motion)
    switch[:, :m] = moved_switch[:, :m]
    switch[:, m + 1 :] += moved_switch[:, m + 1 :] - next_.switch @ still
    switch[:, m + 1 :] += (next_.switch - own.switch) @ still
    return replace(mode, exponent=new_exponent, motion=motion, switch=switch)


def weights(mode: ContactMode) -> Floats:
    """2 for modes that stand for a conjugate pair, 1 for others."""
    m = mode.n_eigenmode
    own = np.einsum("ka,ak->k", mode.enter[:m], mode.motion[:, :m]).real
    return np.where(own > 1.5, 2.0, 1.0)


def _settled(whole: Complexes, exponent: Complexes, own: int) -> tuple[Complexes, Complexes] | None:
    """The first modes (p, own), exponents (own,), of `diag(exponent) + whole`; None if they do not settle.

    Each mode is iterated until it has settled itself: those whose exponents are close take longest.
    """
    every = np.arange(exponent.size)
    exponent = exponent + whole[every, every]  # so that only what mixes modes is left to be followed
    whole[every, every] = 0.0
    share, now = np.eye(exponent.size, own, dtype=np.complex128), exponent[:own].copy()
    left = every[:own]  # modes that have not settled
    for _ in range(STEPS):
        before, itself = share[:, left], (left, every[: left.size])
        given = whole @ before
        now[left] = exponent[left] + given[itself]
        apart = now[left] - exponent[:, np.newaxis]
        given[itself], apart[itself] = 0.0, 1.0
        if not apart.all():  # equal exponents: of modes that may not mix
            is_equal = apart == 0.0
            if given[is_equal].any():
                return None
            apart[is_equal] = 1.0
        found = given / apart
        if not most_of(found) < MOST:
            return None
        found[itself] = 1.0
        share[:, left] = found
        changes = np.abs((found - before).view(np.float64)).max(axis=0).reshape(-1, 2).max(axis=1)
        left = left[changes >= SETTLED]
        if not left.size:
            return share, now
    return None


def most_of(values: Floats | Complexes) -> float:
    """The largest real or imaginary part, without a root for each value."""
    parts = values.view(np.float64)
    return float(max(parts.max(initial=0.0), -parts.min(initial=0.0)))
