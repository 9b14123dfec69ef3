"""A case by the modal integrator in short contact steps: laws without closed form, or endless events."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.marches.march import NO_FORCES
from rubhpc.integrate.marches.modal import ModalMarch
from rubhpc.integrate.marches.workspace import workspace
from rubhpc.integrate.packing import pairs_of
from rubhpc.kernels.case_progress import FINISHED, NONE, shaft_turn
from rubhpc.kernels.contact_pairs import N_DEGREE
from rubhpc.kernels.measuring import end_span
from rubhpc.kernels.sampling import Measured, with_coordinates
from rubhpc.kernels.stepping_loop import ContactImpulses, advance_by_steps

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.record import State
    from rubhpc.kernels.accumulators import Accumulator, Samples
    from rubhpc.kernels.case_progress import Clock
    from rubhpc.kernels.sampling import Recorder

    Floats = NDArray[np.float64]


class ContactSteppingMarch(ModalMarch):
    """A case in the modes of the open system, on which the contact forces act as impulses."""

    def __init__(
        self,
        setup: ModalSetup,
        clearance: float,
        friction: float,
        initial: State,
        check: Callable[[], None] | None,
    ) -> None:
        """Start from `initial`; the first step finds a contact under way."""
        super().__init__(setup, clearance, friction, initial, check)
        self._use(setup.open_tables(friction))
        self._start(0)
        self._impulses = self._make_impulses()
        q = self._clearance.size
        step = self.clock.tick * 2**self._impulses.level
        degree = setup.reduced.degree.reshape(q * N_DEGREE, -1)
        # Displacement one contact step after a unit force over that step: an impulse, then free motion.
        drifted = step * (
            self._impulses.degree_re @ self._impulses.drifted_re.T
            - self._impulses.degree_im @ self._impulses.drifted_im.T
        )
        is_constrained = ~np.any(degree != 0.0, axis=1)
        row = np.where(is_constrained, -1, np.arange(q * N_DEGREE)).reshape(q, N_DEGREE)
        self._pairs = pairs_of(
            setup.model,
            row=row,
            block=row,
            compliance=np.ascontiguousarray(drifted.reshape(q, N_DEGREE, q, N_DEGREE)),
            clearance=clearance,
            friction=friction,
            spin=setup.spin,
            is_updated=setup.is_updated,
            law=setup.law,
        )
        self._work = workspace(self._pairs, step)
        self._ends = np.full((4, q * N_DEGREE), np.nan)
        self._placed = np.zeros((2, self.bodies.stiffness.shape[0]))
        self._work.force[:] = initial.contact_force  # a present contact does not begin again

    def touching(self) -> NDArray[np.bool_]:
        """Whether each pair was pressed in the last step, (q,)."""
        return self._work.force > 0.0

    @property
    def coordinates(self) -> Floats:
        """Modal coordinates (2, m)."""
        return self._z

    def take_over(self, clock: Clock, recorder: Recorder, motion: Floats) -> None:
        """Begin at the tick of `progress` with a motion (2 n,) of another march, and continue its record.

        Up to the next whole step the motion is that of open contacts.
        """
        self.clock, self._recorder = clock, with_coordinates(recorder, self._z.shape[1])
        cosine, sine = shaft_turn(clock, self.progress.tick)
        self._enter_at(0, self._clearance, cosine, sine, motion)
        level = 0
        while self.progress.tick % (1 << self._impulses.level):
            if self.progress.tick & 1 << level:
                power = self.tables.power_re[0, level] + 1j * self.tables.power_im[0, level]
                z = power * (self._z[0] + 1j * self._z[1])
                self._z[0], self._z[1] = z.real, z.imag
                self.progress.tick += 1 << level
            level += 1
        self._ends[:] = np.nan
        for values in (self._work.force, self._work.traction, self._work.is_sticking):
            values[:] = 0

    def step_to(
        self, last_tick: int, clock: Clock, samples: Samples, accumulator: Accumulator, is_recorded: bool
    ) -> int:
        """Advance to a tick for another march; returns an outcome of `kernels.case_progress`."""
        self.clock = clock
        outcome = self._kernel(last_tick, samples, accumulator, is_recorded)
        if outcome == FINISHED:
            if is_recorded:
                measured = Measured(self._recorder, samples, accumulator)
                end_span(self.tables, clock, self._z, self._bare_progress, measured)
            self.progress.energy_from = NONE
        return outcome

    def _contact_force(self) -> Floats:
        return self._work.force.copy()

    def _unsolved(self) -> str:
        return NO_FORCES

    def _make_impulses(self) -> ContactImpulses:
        """Displacements of every pair's degrees, and impulses on them, in the modes of the open system."""
        setup, tables = self._setup, self.tables
        n = tables.motion_re.shape[1] // 2
        degree = setup.reduced.degree.reshape(-1, n)
        motion = tables.motion_re[0] + 1j * tables.motion_im[0]
        enter = tables.enter_re[0] + 1j * tables.enter_im[0]
        level = setup.level_within(setup.contact_step)
        power = tables.power_re[0, level] + 1j * tables.power_im[0, level]
        drifted, shifted = degree @ enter[n:] * power, degree @ enter[:n]
        positions, rates = degree @ motion[:n], degree @ motion[n:]
        skew = 0.5 * (self.bodies.stiffness - self.bodies.stiffness.T)
        return ContactImpulses(
            level=level,
            degree_re=np.ascontiguousarray(positions.real),
            degree_im=np.ascontiguousarray(positions.imag),
            rate_re=np.ascontiguousarray(rates.real),
            rate_im=np.ascontiguousarray(rates.imag),
            drifted_re=np.ascontiguousarray(drifted.real),
            drifted_im=np.ascontiguousarray(drifted.imag),
            shifted_re=np.ascontiguousarray(shifted.real),
            shifted_im=np.ascontiguousarray(shifted.imag),
            twist_response=degree @ setup.reduced.output[2],
            probe_response=setup.reduced.probe[2] @ degree.T,
            skew=skew if np.any(skew) else skew[:0],
        )

    def _kernel(self, last_tick: int, samples: Samples, accumulator: Accumulator, is_recorded: bool) -> int:
        return advance_by_steps(
            self.tables,
            self.bodies,
            self.clock,
            self._impulses,
            self._pairs,
            self._work,
            last_tick,
            is_recorded,
            self._bare_progress,
            self._coordinates,
            self._ends,
            self._placed,
            Measured(self._recorder, samples, accumulator),
        )
