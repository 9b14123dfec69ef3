"""A case by the exact modal integrator."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.fem.statics import sag_at_stators
from rubhpc.integrate.march import March
from rubhpc.integrate.record import State
from rubhpc.kernels import contact_modes as kernel
from rubhpc.kernels.contact_modes import enter, find_phase
from rubhpc.kernels.event_loop import advance
from rubhpc.kernels.measuring import recorder

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.setup import ModalSetup
    from rubhpc.kernels.accumulators import Samples, Tally

    Floats = NDArray[np.float64]

CONTACT_STEPS = 1024  # a revolution, at least, while recording a contact
ALL_SAMPLES = 2**62  # in one kernel call, which pauses by itself
MOST_BOOKS = 8  # of phases that one case may meet; where it meets more, short steps cost less


class NoClosedForm(Exception):  # noqa: N818 - a state of the motion, never seen by users
    """What only short steps can follow.

    Contacts open and close without end, or in too many combinations to tabulate; or set-valued friction
    meets a slip that turns.
    """


class ModalMarch(March):
    """Modal coordinates under way."""

    def __init__(
        self,
        setup: ModalSetup,
        clearance: float,
        friction: float,
        initial: State,
        check: Callable[[], None] | None,
    ) -> None:
        """Start from `initial`, with the contacts closed that its forces press."""
        super().__init__(check, ALL_SAMPLES)
        self._setup, self._book = setup, setup.book(friction)
        offsets = np.array([stator.clearance_offset for stator in setup.model.stators])
        self._clearance = clearance + offsets - sag_at_stators(setup.model)[0]
        self._met = {0, *(1 << i for i in range(self._clearance.size))}  # sets of closed contacts
        turn = setup.interval * setup.samples_per_revolution
        self.clock = kernel.Clock(
            spin=setup.spin,
            tick=setup.tick,
            sample_level=setup.sample_level,
            samples_per_revolution=setup.samples_per_revolution,
            blind_level=setup.level_within(setup.step),
            contact_level=math.floor(math.log2(min(setup.interval, turn / CONTACT_STEPS) / setup.tick)),
            n_sample=0,
        )
        self.bodies = self._book.kernel_reduced(self._clearance, setup.law, setup.displacement_limit)
        self._motion = self._reduce(initial)
        self._recorder = recorder(self._clearance.size)
        self._progress = np.zeros(kernel.N_PROGRESS, dtype=np.int64)
        self._progress[[kernel.WANTED, kernel.SPAN, kernel.ENTERED]] = -1, -1, -(2**61)
        mask = self._first_closed(initial)
        self.find(mask)
        self._progress[kernel.PHASE] = find_phase(self.phases.mask, mask)
        enter(self.phases, self._progress[kernel.PHASE], self._clearance, 1.0, 0.0, self._motion, self._z)

    def _first_closed(self, initial: State) -> int:
        """Set of the contacts that are closed at the start."""
        return sum(1 << i for i, force in enumerate(initial.contact_force) if force > 0.0)

    def touching(self) -> NDArray[np.bool_]:
        """Which pairs are closed, (q,)."""
        mask = self.phases.mask[self._progress[kernel.PHASE]]
        return np.array([bool(mask >> i & 1) for i in range(self._clearance.size)])

    def energy(self) -> float:
        """Mechanical energy, J."""
        n = self.bodies.stiffness.shape[0]
        motion = self._current_motion()
        displacement, velocity = motion[:n], motion[n:]
        return float(0.5 * (velocity @ velocity + displacement @ self.bodies.stiffness @ displacement))

    def final(self) -> State:
        """State at the sample reached, as far as contact and outputs see it."""
        setup = self._setup
        motion = setup.reduced.basis @ self._current_motion().reshape(2, -1).T  # (n_all, 2)
        bodies, first = [], 0
        for body in (setup.model.rotor, *(stator.body for stator in setup.model.stators)):
            bodies.append(motion[first : first + body.n_dof].T.copy())
            first += body.n_dof
        return State(
            rotor_displacement=bodies[0][0] + setup.model.sag,
            rotor_velocity=bodies[0][1],
            stator_displacement=tuple(displacement for displacement, _ in bodies[1:]),
            stator_velocity=tuple(velocity for _, velocity in bodies[1:]),
            contact_force=self._contact_force(),
        )

    def _contact_force(self) -> Floats:
        """Forces at the sample reached, (q,), N."""
        p = self._progress[kernel.PHASE]
        force = self.phases.switch_re[p] @ self._z[0] - self.phases.switch_im[p] @ self._z[1]
        return np.where(self.touching(), force, 0.0)

    def _call(self, stop: int, samples: Samples, tally: Tally, *, is_recorded: bool) -> str | None:
        per_sample = 1 << self.clock.sample_level
        first = self._set_clock(samples, is_recorded=is_recorded)
        while True:
            outcome = self._kernel(first, stop * per_sample, samples, tally, is_recorded=is_recorded)
            self.n_step = int(self._progress[kernel.N_STEP])
            first = int(self._progress[kernel.TIME])
            self.sample = first >> self.clock.sample_level
            if outcome == kernel.PHASE_WANTED:
                self.find(int(self._progress[kernel.WANTED]))
            elif outcome in (kernel.CONTACT_UNSOLVED, kernel.SLIP_TURNED):
                raise NoClosedForm
            elif outcome == kernel.DIVERGED or self._has_diverged(tally):
                return f"a displacement passed {self._setup.displacement_limit:.3g} m"
            elif outcome == kernel.FINISHED:
                return None
            elif self.check is not None:
                self.check()

    def _set_clock(self, samples: Samples, *, is_recorded: bool) -> int:
        """Count time from the sample reached; returns its tick."""
        first = self.sample << self.clock.sample_level
        self._progress[kernel.ENTERED] += first - self._progress[kernel.TIME]
        self._progress[kernel.NEXT_SAMPLE], self._progress[kernel.N_EVENT] = self.sample, 0
        if not is_recorded:
            self._progress[kernel.SPAN] = -1
        self.clock = self.clock._replace(n_sample=samples.rotor.shape[1])
        return first

    def _kernel(
        self, first_tick: int, last_tick: int, samples: Samples, tally: Tally, *, is_recorded: bool
    ) -> int:
        return advance(
            self.phases,
            self.bodies,
            self.clock,
            first_tick,
            last_tick,
            is_recorded,
            self._progress,
            self._z,
            self._z_next,
            self._motion,
            self._recorder,
            samples,
            tally,
        )

    def _has_diverged(self, tally: Tally) -> bool:
        """Whether the output node or a contact degree is, or at a sample was, beyond the limit."""
        reached = np.concatenate([tally.highest[:2], -tally.lowest[:2], tally.peak_lateral])
        limit = self._setup.displacement_limit
        return not np.all(reached <= limit) or self.is_beyond(self._current_motion())

    def is_beyond(self, motion: Floats) -> bool:
        """Whether a motion (2 n,) takes the output node or a contact degree beyond the limit."""
        seen = self._setup.reduced.translations @ motion[: self.bodies.stiffness.shape[0]]
        return not np.all(np.abs(seen) <= self._setup.displacement_limit)

    def place(self) -> tuple[int, Floats]:
        """Phase, and modal coordinates (2, m)."""
        return int(self._progress[kernel.PHASE]), self._z

    def find(self, mask: int) -> None:
        """See that the tables hold a set of contacts.

        The kernel is shown no set but those that this case has met: what it does must not depend on what
        other cases have left in the book.
        """
        self._met.add(mask)
        if len(self._met) > MOST_BOOKS * self._book.n_most:
            raise NoClosedForm
        if mask not in self._book.masks:
            if self._book.is_full:
                self._book.forget()
            if not self._book.add(mask):
                raise NoClosedForm
        self.phases = self._book.tables()
        unmet = [p for p, known in enumerate(self._book.masks) if known not in self._met]
        if unmet:
            shown = self.phases.mask.copy()
            shown[unmet] = -1
            self.phases = self.phases._replace(mask=shown)
        self._z = np.zeros((2, self.phases.switch_re.shape[2]))
        self._z_next = np.zeros_like(self._z)

    def _current_motion(self) -> Floats:
        """Reduced displacements, then velocities (2 n,)."""
        p = self._progress[kernel.PHASE]
        motion: Floats = self.phases.motion_re[p] @ self._z[0] - self.phases.motion_im[p] @ self._z[1]
        return motion

    def _reduce(self, state: State) -> Floats:
        """Reduced coordinates and velocities of a state."""
        project = self._setup.reduced.project
        displacement = state.displacement
        displacement[: self._setup.model.sag.size] -= self._setup.model.sag
        return np.concatenate([project @ displacement, project @ state.velocity])
