"""Phases of a reduced model, one for each set of closed contacts, made as the exact integrator meets them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.contact_mode import Phase, make_phase
from rubhpc.integrate.mode_tables import Tables, tabulate
from rubhpc.integrate.reduction import ReducedModel, directions
from rubhpc.kernels import contact_modes as kernel
from rubhpc.kernels.contact_pairs import MULTIPLIER

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.kernels.contact_pairs import Law

    Floats = NDArray[np.float64]

LANES = 8  # modes are padded to whole vectors
# Coordinates that a set of several contacts may have beyond any single one. The width is settled before the
# first case: that of the tables decides in which order sums are taken, and so the last bits of every case.
SPARE = 8


class PhaseBook:
    """Phases of one speed and friction, made when first met and shared by all cases.

    Parameters
    ----------
    opened : Phase
        That with every pair open, which friction does not change.
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
        opened: Phase,
        tick: float,
        sample_level: int,
        n_level: int,
    ) -> None:
        """Start with every pair open, and with each closed alone."""
        self.reduced, self.model = reduced, model
        self.push, self.pull, self.slip = directions(reduced, model, friction)
        self.friction = friction
        self._tick, self._sample_level, self._n_level = tick, sample_level, n_level
        self._opened = opened
        phases = [opened, *(self._made(1 << i) for i in range(len(self.push)))]
        widest = max(phase.exponent.size for phase in phases) + (SPARE if len(self.push) > 1 else 0)
        self._width = -(-widest // LANES) * LANES
        self._tables = Tables(len(phases))
        self.masks = [phase.mask for phase in phases]
        for phase in phases:
            self._tabulate(phase)

    @property
    def n_most(self) -> int:
        """Phases that there is room for."""
        return self._tables.n_most

    @property
    def is_full(self) -> bool:
        """Whether there is no room for another phase."""
        return len(self.masks) >= self.n_most

    def add(self, mask: int) -> bool:
        """Make the phase with these pairs closed; returns whether the tables are wide enough for it."""
        phase = self._made(mask)
        if phase.exponent.size > self._width:
            return False
        self.masks.append(mask)
        self._tabulate(phase)
        return True

    def forget(self) -> None:
        """Make room: keep no phase but that with every pair open."""
        self._tables.clear()
        self.masks = [0]
        self._tabulate(self._opened)

    def _made(self, mask: int) -> Phase:
        return make_phase(self.reduced, self.push, self.pull, mask) if mask else self._opened

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

    def kernel_reduced(
        self, clearance: Floats, law: Law = MULTIPLIER, displacement_limit: float = np.inf
    ) -> kernel.Reduced:
        """The reduced bodies as the kernel takes them, with a case's clearances (q,), m, law and limit, m."""
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
            slip=self.slip,
            restitution=law.restitution,
            clearance=clearance,
            is_set_valued=law.is_set_valued,
            translations=self.reduced.translations,
            displacement_limit=displacement_limit,
        )

    def tables(self) -> kernel.Phases:
        """All phases as arrays."""
        return self._tables.view()
