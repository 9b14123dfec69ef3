"""A model in the same reduced coordinates at all speeds of a range."""

from __future__ import annotations

from copy import copy
from functools import reduce
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.packing import whole_system
from rubhpc.integrate.reduced_model.reduction import reduce_to
from rubhpc.integrate.reduced_model.standstill import at_standstill, completed
from rubhpc.integrate.reduced_model.truncation import SMOOTH, kept_modes

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.reduced_model.reduction import ReducedModel
    from rubhpc.integrate.reduced_model.truncation import Touch

    Floats = NDArray[np.float64]


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
