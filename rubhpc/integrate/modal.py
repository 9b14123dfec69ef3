"""A case by the exact modal integrator."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.march import March
from rubhpc.integrate.nodes import NodeReader
from rubhpc.integrate.record import State
from rubhpc.kernels import phases as kernel
from rubhpc.kernels.contact import AXIAL, LATERAL, V, W
from rubhpc.kernels.modal import advance
from rubhpc.kernels.phases import enter, find_phase

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.prepare import ModalSetup
    from rubhpc.kernels.observe import Samples, Tally

    Floats = NDArray[np.float64]

FINEST_TICK = 1.5e-9  # s, the resolution of events
LEVELS_PAST_SAMPLE = 3  # longest step: eight samples
CONTACT_STEPS = 1024  # a revolution, at least, while recording a contact
FIRST_REVOLUTIONS = 8  # of the first kernel call
MOST_PHASES = 256  # sets of closed contacts of one speed and friction


class EndlessEvents(Exception):  # noqa: N818 - a state of the motion, never seen by users
    """Contacts open and close without end, or in too many combinations to tabulate."""


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
        super().__init__(check, FIRST_REVOLUTIONS * setup.samples_per_revolution)
        self._setup, self._book = setup, setup.book(friction)
        self._clearance = np.array([clearance + stator.clearance_offset for stator in setup.model.stators])
        turn = 2.0 * math.pi / abs(setup.spin)
        interval = turn / setup.samples_per_revolution
        sample_level = max(2, math.ceil(math.log2(interval / FINEST_TICK)))
        tick = interval / 2**sample_level
        self._sample_level = sample_level
        self._n_level = sample_level + LEVELS_PAST_SAMPLE + 1
        self._clock = kernel.Clock(
            spin=setup.spin,
            tick=tick,
            ticks_per_sample=2**sample_level,
            samples_per_revolution=setup.samples_per_revolution,
            blind_level=max(0, min(sample_level, math.floor(math.log2(setup.step / tick)))),
            contact_level=math.floor(math.log2(min(interval / 4, turn / CONTACT_STEPS) / tick)),
            end_tick=0,
        )
        self._bodies = self._book.kernel_reduced()
        self._motion = self._reduce(initial)
        mask = self._first_closed(initial)
        self._progress = np.array([0, 0, mask, 0, 0, 0, -(2**62)])
        self._tabulate()
        self._reader = NodeReader(self._phases, self._bodies, self._clock)
        if find_phase(self._phases.mask, mask) < 0:
            self._add(mask)
        self._progress[[kernel.PHASE, kernel.WANTED]] = find_phase(self._phases.mask, mask), -1
        enter(self._phases, self._progress[kernel.PHASE], 1.0, 0.0, self._motion, self._z)

    def _first_closed(self, initial: State) -> int:
        """Set of the contacts that are closed at the start."""
        return sum(1 << i for i, force in enumerate(initial.contact_force) if force > 0.0)

    def touching(self) -> NDArray[np.bool_]:
        """Which pairs are closed, (q,)."""
        mask = self._phases.mask[self._progress[kernel.PHASE]]
        return np.array([bool(mask >> i & 1) for i in range(self._clearance.size)])

    def energy(self) -> float:
        """Mechanical energy, J."""
        n = self._bodies.stiffness.shape[0]
        motion = self._current_motion()
        displacement, velocity = motion[:n], motion[n:]
        return float(0.5 * (velocity @ velocity + displacement @ self._bodies.stiffness @ displacement))

    def final(self) -> State:
        """State at the sample reached, as far as contact and outputs see it."""
        setup, n = self._setup, self._bodies.stiffness.shape[0]
        motion = self._current_motion()
        bodies = [setup.model.rotor, *(stator.body for stator in setup.model.stators)]
        ends = np.cumsum([body.n_dof for body in bodies])[:-1]
        displacement = np.split(setup.reduced.basis @ motion[:n], ends)
        velocity = np.split(setup.reduced.basis @ motion[n:], ends)
        return State(
            rotor_displacement=displacement[0],
            rotor_velocity=velocity[0],
            stator_displacement=tuple(displacement[1:]),
            stator_velocity=tuple(velocity[1:]),
            contact_force=self._contact_force(),
        )

    def _contact_force(self) -> Floats:
        """Forces at the sample reached, (q,), N."""
        p = self._progress[kernel.PHASE]
        force = self._phases.switch_re[p] @ self._z[0] - self._phases.switch_im[p] @ self._z[1]
        return np.where(self.touching(), force, 0.0)

    def _call(self, stop: int, samples: Samples, tally: Tally, *, is_recorded: bool) -> str | None:
        per_sample = self._clock.ticks_per_sample
        first = self.sample * per_sample
        self._clock = self._clock._replace(end_tick=samples.rotor.shape[1] * per_sample)
        while True:
            outcome = self._kernel(first, stop * per_sample, tally, is_recorded=is_recorded)
            self.n_step = int(self._progress[kernel.N_STEP])
            first = int(self._progress[kernel.TIME])
            if is_recorded:
                n_node = int(self._progress[kernel.N_NODE])
                self._progress[kernel.N_NODE] = self._reader.read(n_node, samples, tally)
            if outcome == kernel.PHASE_WANTED:
                if len(self._book.phases) >= MOST_PHASES:
                    raise EndlessEvents
                self._add(int(self._progress[kernel.WANTED]))
            elif outcome == kernel.CONTACT_UNSOLVED:
                raise EndlessEvents
            elif outcome == kernel.DIVERGED or self._has_diverged():
                return f"a displacement passed {self._setup.displacement_limit:.3g} m"
            elif outcome == kernel.FINISHED:
                return None

    def _kernel(self, first_tick: int, last_tick: int, tally: Tally, *, is_recorded: bool) -> int:
        return advance(
            self._phases,
            self._bodies,
            self._clock,
            first_tick,
            last_tick,
            is_recorded,
            self._progress,
            self._z,
            self._z_next,
            self._motion,
            self._reader.nodes,
            tally,
        )

    def _has_diverged(self) -> bool:
        """Whether the output node or a contact degree is, or at a sample was, beyond the limit."""
        n, limit = self._bodies.stiffness.shape[0], self._setup.displacement_limit
        displacement = self._current_motion()[:n]
        reduced = self._setup.reduced
        reached = max(
            np.abs(reduced.output[:2] @ displacement).max(),
            np.abs(reduced.degree[:, [V, W, AXIAL, LATERAL]] @ displacement).max(),
        )
        return not (reached <= limit and self._reader.greatest <= limit)

    def _add(self, mask: int) -> None:
        if all(phase.mask != mask for phase in self._book.phases):
            self._book.add(mask)
        self._tabulate()
        self._reader.widen(self._phases)

    def _tabulate(self) -> None:
        """Tables of all phases known; modal coordinates are widened where the new ones have more modes."""
        self._phases = self._book.tables(self._clearance, self._clock.tick, self._n_level)
        self._z = np.zeros((2, self._phases.switch_re.shape[2]))
        self._z_next = np.zeros_like(self._z)

    def _current_motion(self) -> Floats:
        """Reduced displacements, then velocities (2 n,)."""
        p = self._progress[kernel.PHASE]
        motion: Floats = self._phases.motion_re[p] @ self._z[0] - self._phases.motion_im[p] @ self._z[1]
        return motion

    def _reduce(self, state: State) -> Floats:
        """Reduced coordinates and velocities of a state."""
        project = self._setup.reduced.basis.T @ self._setup.reduced.mass
        displacement = np.concatenate([state.rotor_displacement, *state.stator_displacement])
        velocity = np.concatenate([state.rotor_velocity, *state.stator_velocity])
        return np.concatenate([project @ displacement, project @ velocity])
