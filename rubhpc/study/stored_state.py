"""Where a case of a store has ended, as a start of other cases, and whether it fits a model."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model


@dataclass(frozen=True, kw_only=True)
class StoredState:
    """A final state, and the bodies that it is of.

    Attributes
    ----------
    values : bytes
        Displacements, velocities, contact forces, overlaps, SI, as little-endian doubles (`State.packed`).
    bodies : tuple of int
        Degrees of freedom of the rotor and of each other body.
    n_stator : int
        Number of stators.
    """

    values: bytes
    bodies: tuple[int, ...]
    n_stator: int

    @classmethod
    def of(cls, values: NDArray[np.float64], model: Model) -> StoredState:
        """The state of a model, packed."""
        packed = np.ascontiguousarray(values, "<f8").tobytes()
        return cls(values=packed, bodies=_bodies_of(model), n_stator=len(model.stators))

    @property
    def packed(self) -> NDArray[np.float64]:
        """The numbers, (n_degree,)."""
        return np.frombuffer(self.values, "<f8").astype(np.float64)

    @property
    def digest(self) -> str:
        """SHA-256 of all of it."""
        head = f"{self.bodies} {self.n_stator} ".encode()
        return hashlib.sha256(head + self.values).hexdigest()

    def check_fit(self, model: Model) -> None:
        """Refuse a model whose bodies have other degrees of freedom."""
        bodies, n_stator = _bodies_of(model), len(model.stators)
        if (bodies, n_stator) != (self.bodies, self.n_stator):
            mine, its = _in_words(self.bodies, self.n_stator), _in_words(bodies, n_stator)
            problem = f"a state of {mine} does not fit this rig, {its}"
            raise InputError(
                f"[initial] from: {problem}; use a store of a rig with these elements and stators"
            )


def _bodies_of(model: Model) -> tuple[int, ...]:
    return tuple(int(end - first) for first, end in pairwise(model.body_start))


def _in_words(bodies: tuple[int, ...], n_stator: int) -> str:
    rest = " + ".join(map(str, bodies[1:])) or "0"
    return (
        f"{bodies[0]} degrees of freedom in the rotor and {rest} in {n_stator} stator{'s' * (n_stator != 1)}"
    )
