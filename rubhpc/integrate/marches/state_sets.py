"""Sets of states of a case under set-valued friction and their change at an event, as of `contact_sets`."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.marches.event_driven import EventDrivenMarch
from rubhpc.integrate.marches.met_modes import NoClosedForm
from rubhpc.integrate.marches.workspace import empty_workspace
from rubhpc.integrate.reduced_model.friction_mode import mask_of, states_of
from rubhpc.kernels.event_forces import friction_work
from rubhpc.kernels.friction_change import change_states
from rubhpc.kernels.friction_pieces import AT_REST, LEAST_FORCE
from rubhpc.kernels.friction_states import BACKWARD, FORWARD, MOST_PAIRS, OPEN, STUCK, FrictionBodies

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.kernels.contact_pairs import Workspace
    from rubhpc.kernels.event_forces import FrictionWork

    Floats = NDArray[np.float64]


class StateSets(EventDrivenMarch):
    """A case that passes through sets of the states of its pairs: open, sliding in either sense, sticking."""

    most_pairs = MOST_PAIRS
    take_change = staticmethod(change_states)

    _friction: FrictionBodies  # at the speed that the bodies turn at
    _pulled: tuple[Floats, Floats, Floats] | None = None  # stiffness, and what follows from it

    def moved_by(self, mask: int) -> int:
        """What of a set of states decides how the bodies move: all of it, but whether pairs are lifted."""
        return mask & ((1 << 2 * self._clearance.size) - 1)

    def closed(self, mask: int) -> NDArray[np.bool_]:
        """Which pairs are closed in a contact mode, (q,)."""
        return np.array([state != OPEN for state in states_of(mask, self._clearance.size)])

    @property
    def given(self) -> Floats:
        """Normal impulses and tractions (2, q), N s, of the last event that was taken by itself."""
        return self._work.given

    @cached_property
    def _coefficients(self) -> tuple[Floats, Floats]:
        """Of sliding and of static friction, (q,)."""
        sliding = np.full(self._clearance.size, self._coefficient)
        return sliding, sliding * self._setup.law.static_friction_ratio

    @cached_property
    def _work(self) -> FrictionWork:
        """Room for events, and how the forces of pairs act on each other, which is so at any speed."""
        pairs, q = self._setup.friction_pairs(self._coefficient), self._clearance.size
        gap_jacobian, along = pairs.gap_jacobian, pairs.friction_direction
        solver = empty_workspace(q)
        solver.matrix[:], solver.coupling[:] = gap_jacobian @ gap_jacobian.T, gap_jacobian @ along.T
        solver.tangential[:] = -along @ gap_jacobian.T, -along @ along.T
        self._soften(solver)
        return friction_work(solver, q)

    def _friction_bodies(self) -> FrictionBodies:
        """What friction asks of the bodies at the speed that they turn at."""
        bodies = self.bodies
        if self._pulled is None or self._pulled[0] is not bodies.stiffness:  # pieces of a run-up share it
            rows = np.vstack([bodies.gap_jacobian, bodies.slip])
            pull = np.hstack([rows @ bodies.stiffness, rows @ bodies.damping])
            self._pulled = bodies.stiffness, rows, pull
        _, rows, pull = self._pulled
        turned = np.empty((len(rows), 2))
        turned[:, 0], turned[:, 1] = rows @ bodies.force_cosine, rows @ bodies.force_sine
        return FrictionBodies(*self._coefficients, rim_speed=bodies.rim_speed, pull=pull, turned=turned)

    def _soften(self, solver: Workspace) -> None:
        """Change how normal forces follow from gaps: here they hold them, and nothing changes."""

    def _first_mask(self, contact_force: Floats) -> int:
        return self._states_after(contact_force > 0.0, 0.0)

    def _states_after(self, is_pressed: NDArray[np.bool_], angle: float, further: int = 0) -> int:
        """States that go on from the motion, with the shaft at an angle, rad, and some gaps closed.

        `further` are bits of the set of states beyond two a pair.
        """
        n, rim_speed = self.bodies.stiffness.shape[0], self._friction.rim_speed
        slips = rim_speed + self.bodies.slip @ self._motion[n:]
        states = []  # arrays would take longer for a few pairs, which a run-up asks of every piece
        for slip, speed, presses in zip(slips.tolist(), rim_speed.tolist(), is_pressed.tolist(), strict=True):
            sliding = FORWARD if slip >= 0.0 else BACKWARD
            states.append((STUCK if abs(slip) <= AT_REST * speed else sliding) if presses else OPEN)
        found = self.change(mask_of(states) | further, 0, angle, self._motion)
        if found < 0:
            raise NoClosedForm
        return found

    def change(
        self, mask: int, crossing: int, angle: float, motion: Floats, moment: float | None = None
    ) -> int:
        """Take an event: `motion` (2 n,) after it, in place, and the states that go on, or -1."""
        return int(
            self.take_change(
                self.bodies,
                self._friction,
                mask,
                crossing,
                self.moment if moment is None else moment,
                np.cos(angle),
                np.sin(angle),
                motion,
                False,
                self._work,
                self._unrecorded,
            )
        )

    def forces(self, mode: int, z: Floats) -> Floats:
        """Normal forces (q,), N, at coordinates (2, m) of a contact mode, by its index in the tables."""
        q, tables = self._clearance.size, self.tables
        value = (tables.switch_re[mode] @ z[0] - tables.switch_im[mode] @ z[1]).reshape(q, 2)
        force = np.zeros(q)
        for i, state in enumerate(states_of(int(tables.mask[mode]), q)):
            if state == OPEN:
                continue
            pressed, turned = value[i].tolist()
            if state == STUCK:
                pressed = 0.5 * (pressed + turned) / (float(self._friction.static[i]) or 1.0)
            force[i] = max(pressed, LEAST_FORCE)
        return force
