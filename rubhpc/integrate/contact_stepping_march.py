"""A case by the modal integrator in short contact steps: laws without closed form, or endless events."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.fem.statics import sag_at_stators
from rubhpc.integrate.event_driven_march import ModalMarch
from rubhpc.integrate.march import NO_FORCES
from rubhpc.integrate.workspace import workspace
from rubhpc.kernels.contact_kicks import Kicks, advance_stepped
from rubhpc.kernels.contact_modes import CONTACT_UNSOLVED, FINISHED, N_STEP, TIME
from rubhpc.kernels.contact_pairs import N_DEGREE, Pairs

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.record import State
    from rubhpc.integrate.setup import ModalSetup
    from rubhpc.kernels.accumulators import Samples, Tally

    Floats = NDArray[np.float64]


class SteppedMarch(ModalMarch):
    """Modal coordinates of the open system under way, kicked by the contact forces."""

    def __init__(
        self,
        setup: ModalSetup,
        clearance: float,
        friction: float,
        initial: State,
        check: Callable[[], None] | None,
    ) -> None:
        """Start from `initial`."""
        super().__init__(setup, clearance, friction, initial, check)
        self._kicks = self._make_kicks()
        angle = np.array([stator.angle for stator in setup.model.stators])
        q = angle.size
        step = self.clock.tick * 2**self._kicks.level
        phases = self.phases
        place = phases.motion_re.shape[1] // 2
        degree = setup.reduced.degree.reshape(q * N_DEGREE, place)
        # Displacement a contact step after a unit force has acted over it: an impulse, then drift.
        drifted = step * (
            self._kicks.degree_re @ self._kicks.drifted_re.T
            - self._kicks.degree_im @ self._kicks.drifted_im.T
        )
        held = ~np.any(degree != 0.0, axis=1)
        row = np.where(held, -1, np.arange(q * N_DEGREE)).reshape(q, N_DEGREE)
        self._pairs = Pairs(
            row=row,
            block=row,
            axis_y=np.cos(angle),
            axis_z=np.sin(angle),
            radius=np.array([stator.radius for stator in setup.model.stators]),
            clearance=self._clearance,
            aside=sag_at_stators(setup.model)[1],
            friction=np.full(q, math.copysign(friction, setup.spin)),
            compliance=np.ascontiguousarray(drifted.reshape(q, N_DEGREE, q, N_DEGREE)),
            is_updated=setup.is_updated,
            law=setup.law,
        )
        self._work = workspace(self._pairs, step)
        self._ends = np.full((2, q * N_DEGREE), np.nan)
        self._work.force[:] = initial.contact_force  # a contact under way does not begin anew

    def touching(self) -> NDArray[np.bool_]:
        """Which pairs pressed in the last step, (q,)."""
        return self._work.force > 0.0

    def _first_closed(self, initial: State) -> int:
        """None: a contact under way is found by the first step."""
        return 0

    def _contact_force(self) -> Floats:
        return self._work.force.copy()

    def _make_kicks(self) -> Kicks:
        """Displacements and kicks of every pair's degrees in the modes of the open system."""
        setup, phases = self._setup, self.phases
        n = phases.motion_re.shape[1] // 2
        degree = setup.reduced.degree.reshape(-1, n)
        motion = phases.motion_re[0] + 1j * phases.motion_im[0]
        enter = phases.enter_re[0] + 1j * phases.enter_im[0]
        level = setup.level_within(setup.kick_step)
        power = phases.power_re[0, level] + 1j * phases.power_im[0, level]
        drifted, shifted = degree @ enter[n:] * power, degree @ enter[:n]
        positions, rates = degree @ motion[:n], degree @ motion[n:]
        return Kicks(
            level=level,
            degree_re=np.ascontiguousarray(positions.real),
            degree_im=np.ascontiguousarray(positions.imag),
            rate_re=np.ascontiguousarray(rates.real),
            rate_im=np.ascontiguousarray(rates.imag),
            drifted_re=np.ascontiguousarray(drifted.real),
            drifted_im=np.ascontiguousarray(drifted.imag),
            shifted_re=np.ascontiguousarray(shifted.real),
            shifted_im=np.ascontiguousarray(shifted.imag),
            twist_answer=degree @ setup.reduced.output[2],
        )

    def _call(self, stop: int, samples: Samples, tally: Tally, *, is_recorded: bool) -> str | None:
        per_sample = 1 << self.clock.sample_level
        first = self._set_clock(samples, is_recorded=is_recorded)
        while True:
            outcome = advance_stepped(
                self.phases,
                self.bodies,
                self.clock,
                self._kicks,
                self._pairs,
                self._work,
                first,
                stop * per_sample,
                is_recorded,
                self._progress,
                self._z,
                self._z_next,
                self._ends,
                self._recorder,
                samples,
                tally,
            )
            self.n_step = int(self._progress[N_STEP])
            first = int(self._progress[TIME])
            self.sample = first >> self.clock.sample_level
            if outcome == CONTACT_UNSOLVED:
                return NO_FORCES
            if self._has_diverged(tally):
                return f"a displacement passed {self._setup.displacement_limit:.3g} m"
            if outcome == FINISHED:
                return None
            if self.check is not None:
                self.check()
