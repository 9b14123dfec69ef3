"""What a set of states makes of the motion of a contact mode."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.reduced_model.contact_mode import left_free

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.integrate.reduced_model.reduction import ReducedModel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Complexes = NDArray[np.complex128]


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


def weights(mode: ContactMode) -> Floats:
    """2 for modes that stand for a conjugate pair, 1 for others."""
    m = mode.n_eigenmode
    own = np.einsum("ka,ak->k", mode.enter[:m], mode.motion[:, :m]).real
    return np.where(own > 1.5, 2.0, 1.0)


def most_of(values: Floats | Complexes) -> float:
    """The largest real or imaginary part, without a root for each value."""
    parts = values.view(np.float64)
    return float(max(parts.max(initial=0.0), -parts.min(initial=0.0)))
