"""Common part of the modal marches: modal coordinates of a reduced model, advanced by kernels."""

from __future__ import annotations

from abc import abstractmethod
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numba import config
from numpy.typing import NDArray

from rubhpc.fem.statics import sag_at_stators
from rubhpc.integrate.marches.march import ALL_SAMPLES, March
from rubhpc.integrate.measuring.divergence import displacement_reason, energy_reason
from rubhpc.integrate.record import State
from rubhpc.integrate.reduced_model.table_stack import aligned
from rubhpc.kernels.case_progress import (
    CONTACT_UNSOLVED,
    DIVERGED,
    FINISHED,
    Coordinates,
    bare,
    begin_in,
    new_progress,
    restart_clock,
)
from rubhpc.kernels.contact_modes import enter_with, is_within
from rubhpc.kernels.sampling import recorder, with_coordinates

if TYPE_CHECKING:
    from collections.abc import Callable

    from rubhpc.fem.model import Model
    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.reduced_model.mode_library import ModeLibrary
    from rubhpc.kernels.accumulators import Accumulator, Samples
    from rubhpc.kernels.case_progress import Progress
    from rubhpc.kernels.contact_modes import ModeTables

Floats = NDArray[np.float64]

# Frequency of a mode over the spin, and times the duration of a piece, above which it continues unchanged
# where the speed changes.
FAST, QUICK = 3.0, 0.5 * np.pi
# Kernels that are not compiled read fields as attributes, which a plain structured array has none of.
_BEGUN = new_progress(1) if config.DISABLE_JIT else bare(new_progress(1))  # type: ignore[attr-defined]


class Place(NamedTuple):
    """Present motion of a case, from which a march at another speed can continue."""

    motion: Floats  # (2 n,), reduced displacements about the sag, then velocities
    sag: Floats  # (n_rotor_dof,), m and rad
    contact_force: Floats  # (q,), N
    contacts: Any = None  # what the march keeps of its contacts besides


def slowest_fast(spin: float, since: float) -> float:
    """Pace, 1/s, above which modes follow the speed from piece to piece: these do not ring for it."""
    return max(FAST * abs(spin), QUICK / since)


class ModalMarch(March):
    """A case in modal coordinates z (2, m), real and imaginary, of its present contact mode."""

    tables: ModeTables
    _z: Floats = np.zeros((2, 0))

    def __init__(
        self,
        setup: ModalSetup,
        clearance: float,
        friction: float,
        initial: State,
        check: Callable[[], None] | None,
    ) -> None:
        """Take the case and its reduced initial motion; it is put into a contact mode by `_start`."""
        super().__init__(check, ALL_SAMPLES, setup.model)
        offsets = np.array([stator.clearance_offset for stator in setup.model.stators])
        self._at_rest, self._coefficient = clearance + offsets, friction
        self._model: Model | None = None  # of the clearances
        self._bodies_of: ModalSetup | None = None  # of the bodies
        self._ended: Floats | None = None  # motion at the end of the last call
        self._bare_records = _BEGUN.copy()
        self._bare_progress = self._bare_records[0]
        self._take(setup)
        self._motion = self.reduced(initial)
        self._recorder = recorder(setup.model.n_place, setup.model.n_probe)

    @cached_property
    def progress(self) -> Progress:
        """Progress of the case, with items as attributes."""
        found: Progress = self._bare_records.view(np.recarray)[0]
        return found

    @property
    def setup(self) -> ModalSetup:
        """Set-up at the present speed."""
        return self._setup

    def reached(self) -> Place:
        """Present motion, for another speed to continue from."""
        return Place(self.stands_at(), self._setup.model.sag, self._contact_force())

    def moved(self, setup: ModalSetup, place: Place) -> Floats:
        """Motion (2 n,) of a place about the sag of another set-up."""
        motion = place.motion.copy()
        if place.sag is not setup.model.sag and (moved := place.sag - setup.model.sag).any():
            motion[: motion.size // 2] += setup.reduced.project[:, : moved.size] @ moved
        return motion

    def stands_at(self) -> Floats:
        """The same as `motion`, found once at the end of a call."""
        return self.motion() if self._ended is None else self._ended

    def _take(self, setup: ModalSetup) -> None:
        """Count time from 0, at the speed of a set-up."""
        if self._model is not setup.model:
            self._model, self._clearance = setup.model, self._at_rest - sag_at_stators(setup.model)[0]
        if self._bodies_of is not setup:
            self._bodies_of, self.bodies = setup, setup.bodies(self._coefficient, self._clearance)
        self._setup, self.clock = setup, setup.clock
        self._begin_time()
        self._entered_with = self._clearance  # values of the constant coordinates

    def _begin_time(self) -> None:
        """Restart the time at 0."""
        self._ended = None
        self._bare_records[:] = _BEGUN

    @abstractmethod
    def _kernel(self, last_tick: int, samples: Samples, accumulator: Accumulator, is_recorded: bool) -> int:
        """Advance from the tick reached to `last_tick`; returns an outcome of `kernels.case_progress`."""

    @property
    @abstractmethod
    def pair_states(self) -> int:
        """States of all pairs as one number."""

    @property
    @abstractmethod
    def mask(self) -> int:
        """Set of closed pairs in whose modes the motion is."""

    @property
    @abstractmethod
    def library(self) -> ModeLibrary:
        """Contact modes of the case."""

    @abstractmethod
    def reached_in(self) -> tuple[int, Floats]:
        """The set of closed pairs `mask`, and a copy of the modal coordinates (2, m)."""

    @abstractmethod
    def keep_fast(self, before: tuple[int, Floats], spin: float, since: float) -> None:
        """Let fast modes go on as they were before a piece began at another speed, in the same contacts.

        `spin` (rad/s) is that of the piece, `since` the time from the middle of the one before to its own, s.
        Modes follow the speed, which changes evenly, and do not ring for it.
        """

    def has_lost_events(self, lasts: float) -> bool:
        """Whether a piece of a duration (s) had events without end, or missed one."""
        return False

    @abstractmethod
    def begin(self, setup: ModalSetup, place: Place) -> None:
        """Begin anew at another speed in the same reduced coordinates, from where a march has come."""

    @abstractmethod
    def pass_sections(
        self, n_revolution: int, samples: Samples, accumulator: Accumulator
    ) -> tuple[Floats, str | None]:
        """Go on by some revolutions without a record, in few kernel calls where nothing new is met.

        Returns
        -------
        (n_revolution, 2 n)
            The motion at the end of each.
        str or None
            Why the case cannot go on.
        """

    @abstractmethod
    def _unsolved(self) -> str:
        """Reason of an end where the kernel finds no forces, unless another march continues."""

    @abstractmethod
    def _contact_force(self) -> Floats:
        """Forces at the sample reached, (q,), N."""

    def energy(self) -> float:
        """Mechanical energy, J."""
        return self._energy_of(self.stands_at())

    def _energy_of(self, motion: Floats) -> float:
        """Mechanical energy, J, of a reduced motion (2 n,)."""
        n = self.bodies.stiffness.shape[0]
        displacement, velocity = motion[:n], motion[n:]
        return float(0.5 * (velocity @ velocity + displacement @ self.bodies.stiffness @ displacement))

    def final(self) -> State:
        """State at the sample reached, in the reduced coordinates."""
        return self.state_of(self.stands_at(), self._contact_force())

    def state_of(self, motion: Floats, contact_force: Floats) -> State:
        """State of a reduced motion (2 n,) and of the forces (q,), N, at a whole revolution."""
        setup = self._setup
        displacement, velocity = (setup.reduced.basis @ motion.reshape(2, -1).T).T.copy()
        displacement[: setup.model.rotor.n_dof] += setup.model.sag
        return State.of_bodies(setup.model, displacement, velocity, contact_force)

    def motion(self) -> Floats:
        """Reduced displacements, then velocities (2 n,), at the sample reached."""
        return self._motion_in(self._bare_progress["mode"], self._z)

    def _motion_in(self, mode: int, z: Floats) -> Floats:
        motion: Floats = self.tables.motion_re[mode] @ z[0] - self.tables.motion_im[mode] @ z[1]
        return motion

    def gaps(self, setup: ModalSetup, place: Place) -> Floats:
        """Linear gaps (q,), m, of a motion about the sag of a set-up in place of its own."""
        displacement = place.motion[: self.bodies.stiffness.shape[0]]
        open_: Floats = self._at_rest - sag_at_stators(setup.model)[0]
        return open_ + self.bodies.gap_jacobian @ displacement

    def is_beyond(self, motion: Floats) -> bool:
        """Whether a motion (2 n,) takes the rotor beyond the limit."""
        seen = self._setup.reduced.translations @ motion[: self.bodies.stiffness.shape[0]]
        return not np.all(np.abs(seen) <= self._setup.displacement_limit)

    def _use(self, tables: ModeTables) -> None:
        """Take tables, and coordinates of their width."""
        self.tables = tables
        m = tables.switch_re.shape[2]
        if self._z.shape[1] != m:
            self._z = aligned((2, m))
            self._coordinates = Coordinates(self._z, aligned((2, m)), self._motion)
            self._recorder = with_coordinates(self._recorder, m)

    def _start(self, mode: int) -> None:
        """Begin in a contact mode of the tables, at the shaft's angle 0."""
        begin_in(self._bare_progress, mode)
        self._enter_at(mode, self._entered_with, 1.0, 0.0, self._motion)

    def _enter_at(self, mode: int, clearance: Floats, cosine: float, sine: float, motion: Floats) -> None:
        """Set the coordinates, in a contact mode of the tables, of a motion (2 n,) at the shaft's angle."""
        tables = self.tables
        enter_with(
            int(tables.n_eigenmode[mode]),
            self._z.shape[1],
            tables.enter_re[mode],
            tables.enter_im[mode],
            tables.enter_cosine[mode],
            tables.enter_sine[mode],
            tables.enter_constant[mode],
            clearance,
            cosine,
            sine,
            motion,
            self._z,
        )

    def _call(
        self, stop: int, samples: Samples, accumulator: Accumulator, *, is_recorded: bool
    ) -> str | None:
        assert self._setup.is_measured
        sample_level = self.clock.sample_level
        restart_clock(self._bare_progress, self.sample << sample_level, self.sample, is_recorded=is_recorded)
        self._ended = None
        if self.clock.n_sample != samples.rotor.shape[1]:
            self.clock = self.clock._replace(n_sample=samples.rotor.shape[1])
        while True:
            outcome = self._kernel(stop << sample_level, samples, accumulator, is_recorded)
            self.n_step = int(self._bare_progress["n_step"])
            self.sample = int(self._bare_progress["tick"]) >> sample_level
            reason = self._why_ended(outcome, accumulator)
            if reason is not None:
                return reason
            if outcome == FINISHED:
                return None
            if self.check is not None:
                self.check()

    def _why_ended(self, outcome: int, accumulator: Accumulator) -> str | None:
        """Reason why a case cannot continue after a kernel call, if any."""
        if outcome == CONTACT_UNSOLVED:
            return self._unsolved()
        return self._why_diverged(outcome == DIVERGED, accumulator)

    def _why_diverged(self, is_at_event: bool, accumulator: Accumulator) -> str | None:
        """Reason of divergence of a motion, or of the output node at a sample."""
        setup = self._setup
        limit, motion = setup.displacement_limit, self._motion
        if not is_at_event:
            motion = self._ended = self.motion().copy()
            if is_within(
                motion,
                self.bodies.translations,
                self.bodies.stiffness,
                accumulator.highest,
                accumulator.lowest,
                limit,
                setup.energy_limit,
            ):
                return None
        seen = np.abs(setup.reduced.translations @ motion[: self.bodies.stiffness.shape[0]])
        (highest, aside, _), (lowest, other, _) = accumulator.highest.tolist(), accumulator.lowest.tolist()
        if highest >= lowest:  # a sample was taken
            seen[:2] = np.maximum(seen[:2], [max(highest, -lowest), max(aside, -other)])
        if not seen.max() <= limit:
            return displacement_reason(setup.model, seen, limit)
        if not is_at_event and not self._energy_of(motion) <= setup.energy_limit:
            return energy_reason(setup.energy_limit)
        return None

    def reduced(self, state: State) -> Floats:
        """Reduced displacements, then velocities (2 n,), of a state."""
        project = self._setup.reduced.project
        displacement = state.displacement
        displacement[: self._setup.model.sag.size] -= self._setup.model.sag
        return np.concatenate([project @ displacement, project @ state.velocity])
