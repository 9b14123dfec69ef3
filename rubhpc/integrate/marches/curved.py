"""A case whose gaps are curved: flights in closed form, closed contacts in steps of order 8."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError
from rubhpc.integrate.marches.event_driven import EventDrivenMarch
from rubhpc.integrate.marches.march import NO_FORCES
from rubhpc.integrate.marches.met_modes import NoClosedForm
from rubhpc.integrate.reduced_model.curved_library import CurvedLibrary, curved_pairs, followed_pairs
from rubhpc.kernels.case_progress import ask_for, begin_in
from rubhpc.kernels.curved_contact import KEPT, curved_work
from rubhpc.kernels.curved_loop import advance_curved
from rubhpc.kernels.sampling import Measured

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.marches.modal import Place
    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.record import State
    from rubhpc.integrate.reduced_model.mode_library import ModeLibrary
    from rubhpc.kernels.accumulators import Accumulator, Samples
    from rubhpc.kernels.case_progress import Progress
    from rubhpc.kernels.contact_modes import ModeTables

    Floats = NDArray[np.float64]

LOAD_TOLERANCE = 1.0  # of the loads of closed contacts, over the accuracy of the integrator


class CurvedMarch(EventDrivenMarch):
    """A case that passes through contact modes, of which only flights have a closed form."""

    has_closed_form = False
    has_piece_loop = False

    def __init__(
        self,
        setup: ModalSetup,
        clearance: float,
        friction: float,
        initial: State,
        check: Callable[[], None] | None,
    ) -> None:
        """Start from `initial`; contacts with a force are closed."""
        self._force = initial.contact_force.copy()
        self._is_bent = any(stator.squared_slope is not None for stator in setup.model.stators)
        super().__init__(setup, clearance, friction, initial, check)
        self._pairs = curved_pairs(
            setup.reduced, setup.model, self._coefficient, self._clearance, is_round=setup.is_updated
        )
        self._make_work()

    def begin(self, setup: ModalSetup, place: Place) -> None:
        """Begin again at another speed in the same reduced coordinates, from the end of a march."""
        before, self._force = self._setup, place.contact_force.copy()
        super().begin(setup, place)
        if setup.reduced.stiffness is not before.reduced.stiffness or setup.model is not before.model:
            self._pairs = followed_pairs(self._pairs, setup.reduced, setup.model, self._clearance)
        if self._sizes() != self._sized:
            self._make_work()

    def start_again(self, state: State) -> bool:
        """Restart the same case at another state, with its known matrices and contact modes."""
        self._force = state.contact_force.copy()
        self._start_at(state)
        return True

    def _sizes(self) -> tuple[int, ...]:
        """Coordinates, losses and tabulated steps."""
        return self._z.shape[1], self._curved.sign.shape[1], self._curved.is_filled.shape[1]

    def _make_work(self) -> None:
        self._sized = self._sizes()
        self._work = curved_work(self._clearance.size, *self._pairs.row.shape[1:], *self._sized)

    def motion(self) -> Floats:
        """Reduced displacements, then velocities (2 n,), at the sample reached."""
        return self.motion_of(self.progress, self._z)

    def motion_of(self, progress: Progress, z: Floats) -> Floats:
        """Reduced displacements, then velocities (2 n,), of modal coordinates (2, m)."""
        if progress.wanted >= 0:  # the mode has not been entered yet
            return self._motion
        motion = super().motion_of(progress, z)
        shift, n = self._curved.shift[progress.mode], self.bodies.stiffness.shape[0]
        motion[:n] -= self._work.h[0] @ shift
        motion[n:] -= self._work.rate[0] @ shift
        return motion

    def find(self, mask: int) -> None:
        """Ensure that the tables contain a set of contacts.

        Raises
        ------
        InputError
            Too many sets for bent stators, which short steps do not support.
        """
        try:
            super().find(mask)
        except NoClosedForm:
            if not self._is_bent:
                raise
            problem = "too many sets of contacts for second_order"
            raise InputError(f'[stator] geometry: {problem}; set geometry = "linear"') from None

    def _use(self, tables: ModeTables) -> None:
        super()._use(tables)
        assert isinstance(self.library, CurvedLibrary)
        self._curved = self.library.curved_tables()

    def _find_library(self, setup: ModalSetup, friction: float) -> ModeLibrary:
        return setup.curved_library(friction)

    def _keep(self, z: Floats, slowest: float) -> None:
        self._z[:], self._work.span[KEPT] = z, slowest  # until the mode is entered

    def _start(self, mode: int) -> None:
        begin_in(self._bare_progress, mode)
        ask_for(self.progress, int(self.tables.mask[mode]))

    def _advance(self, last_tick: int, samples: Samples, accumulator: Accumulator, is_recorded: bool) -> int:
        return advance_curved(
            self.tables,
            self._curved,
            self._pairs,
            self.bodies,
            self.clock,
            LOAD_TOLERANCE * self._setup.accuracy,
            last_tick,
            is_recorded,
            self._bare_progress,
            self._coordinates,
            self._work,
            self._event_work,
            Measured(self._recorder, samples, accumulator),
        )

    def _unsolved(self) -> str:
        if self._is_bent:  # short steps do not support bent stators
            return NO_FORCES
        raise NoClosedForm

    def _contact_force(self) -> Floats:
        if self._bare_progress["wanted"] >= 0:
            return self._force
        return np.where(self.touching(), np.maximum(self._work.force[0], np.finfo(float).tiny), 0.0)
