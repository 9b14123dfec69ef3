"""Phases of a reduced model, one for each set of closed contacts, made as the exact integrator meets them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.phase import Phase, make_phase
from rubhpc.integrate.reduction import ReducedModel, directions
from rubhpc.integrate.tables import Tables, tabulate
from rubhpc.kernels import phases as kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model

    Floats = NDArray[np.float64]

LANES = 8  # modes are padded to whole vectors


class PhaseBook:
    """Phases of one speed and friction, made when first met and shared by all cases.

    Parameters
    ----------
    tick : float, s
    sample_level, n_level : int
        2^sample_level ticks are the interval of samples; exponentials are tabulated over 1, 2, ...,
        2^(n_level - 1) ticks.
    """

    def __init__(
        self,
        reduced: ReducedModel,
        model: Model,
        friction: float,
        *,
        tick: float,
        sample_level: int,
        n_level: int,
    ) -> None:
        """Start with every pair open, and with each closed alone."""
        self.reduced, self.model = reduced, model
        self.push, self.pull, self.slip = directions(reduced, model, friction)
        self.friction = friction
        self._tick, self._sample_level, self._n_level = tick, sample_level, n_level
        self.masks: list[int] = []
        self._width = 0  # of the tables
        self._tables = Tables(1 + len(self.push))
        for mask in (0, *(1 << i for i in range(self.push.shape[0]))):
            self.add(mask)

    @property
    def is_full(self) -> bool:
        """Whether there is no room for another phase."""
        return len(self.masks) >= self._tables.n_most

    def add(self, mask: int) -> None:
        """Make the phase with these pairs closed."""
        self.masks.append(mask)
        phase = self._made(mask)
        if phase.exponent.size <= self._width:
            self._tabulate(phase)
            return
        self._width = -(-phase.exponent.size // LANES) * LANES
        self._tables = Tables(1 + len(self.push))
        for known in self.masks:
            self._tabulate(self._made(known))

    def forget(self) -> None:
        """Make room: keep no phase but that with every pair open."""
        self.masks.clear()
        self._tables.clear()
        self.add(0)

    def _made(self, mask: int) -> Phase:
        return make_phase(self.reduced, self.push, self.pull, mask)

    def _tabulate(self, phase: Phase) -> None:
        self._tables.add(
            tabulate(
                phase,
                self.reduced,
                self.slip,
                width=self._width,
                tick=self._tick,
                sample_level=self._sample_level,
                n_level=self._n_level,
            )
        )

    def kernel_reduced(self, clearance: Floats, restitution: float = 0.0) -> kernel.Reduced:
        """The reduced bodies as the kernel takes them, with a case's clearances (q,), m, and restitution."""
        return kernel.Reduced(
            stiffness=self.reduced.stiffness,
            damping=self.reduced.damping,
            force_cosine=self.reduced.force[0].copy(),
            force_sine=self.reduced.force[1].copy(),
            push=self.push,
            pull=self.pull,
            answer=self.push @ self.pull.T,
            friction=np.full(self.push.shape[0], self.friction),
            radius=np.array([stator.radius for stator in self.model.stators]),
            restitution=restitution,
            clearance=clearance,
        )

    def tables(self) -> kernel.Phases:
        """All phases as arrays."""
        return self._tables.view()
