"""Set-up of the modal schemes: reduced model, clock and contact modes of one rig and speed."""

from __future__ import annotations

import math
import weakref
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.integrate.measuring.divergence import energy_limit
from rubhpc.integrate.reduced_model.contact_mode import ContactMode, solve_contact_mode
from rubhpc.integrate.reduced_model.flight_modes import FlightModes, motion_rows
from rubhpc.integrate.reduced_model.mode_library import ModeLibrary
from rubhpc.integrate.reduced_model.reduction import ReducedModel, directions, kernel_bodies
from rubhpc.integrate.reduced_model.touching import OpenBodies, open_bodies
from rubhpc.integrate.reduced_model.truncation import (
    MOST_MODES,
    kept_modes,
    modal_error,
    sufficient_accuracy,
    touch_of,
)
from rubhpc.integrate.scheme import Scheme
from rubhpc.kernels.case_progress import Clock
from rubhpc.kernels.contact_modes import SAMPLES_AT_ONCE
from rubhpc.kernels.laws import MULTIPLIER
from rubhpc.rig.supports import is_time

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.free_spin import FreeSpin
    from rubhpc.fem.model import Model
    from rubhpc.kernels.contact_modes import Reduced
    from rubhpc.kernels.laws import Law

    Floats = NDArray[np.float64]

FINEST_TICK = 1.9e-10  # s
CONTACT_STEPS = 1024  # per revolution, at least, while recording a contact
SAME_TURN = 1e-12  # share of a time, within which it is a whole number of revolutions
LONGEST_TURN = FINEST_TICK * 2**46  # s, 3.7 hours: 64 bits count the ticks of a hundred thousand revolutions
FEWEST_STEPS = 16  # per revolution, at least


class Release(NamedTuple):
    """When bearings let go of the shaft, and what goes on."""

    until: float  # revolutions of the record, or its time, s
    setup: ModalSetup

    def is_due(self, turn: int, time: float) -> bool:
        """Whether they have let go after so many whole revolutions, which have taken a time, s."""
        return (time if is_time(self.until) else turn) >= self.until * (1.0 - SAME_TURN)

    def turn(self, begins: Floats) -> int:
        """Whole revolutions after which they let go, at most n; begins (n + 1,), s, the last one an end."""
        return next((i for i, time in enumerate(begins.tolist()) if self.is_due(i, time)), begins.size - 1)


@dataclass(frozen=True, kw_only=True, eq=False)
class ModalSetup:
    """Set-up that the cases of one rig and speed share; contact modes are solved when first met."""

    scheme: Scheme = Scheme.EVENT_DRIVEN  # initial scheme of a case
    model: Model
    reduced: ReducedModel
    spin: float  # rad/s
    step: float  # s, up to which steps need no bound
    samples_per_revolution: int
    is_updated: bool  # normal
    displacement_limit: float  # m
    law: Law = MULTIPLIER
    accuracy: float = 1e-3  # relative, of the modes kept, and of loads where gaps are curved
    free_spin: FreeSpin | None = None  # of a driven rotor
    release: Release | None = None
    is_measured: bool = True  # False: tables have no outputs and energies
    _libraries: dict[float, ModeLibrary] = field(default_factory=dict)

    @property
    def has_energies(self) -> bool:
        """Whether records have the losses by damping and the works of turning forces."""
        return self.is_measured

    @cached_property
    def local_motions(self) -> Floats:
        """Local motions of each pair (`flight_modes.motion_rows`)."""
        return motion_rows(self.reduced, self.model, self.accuracy)

    @cached_property
    def energy_limit(self) -> float:
        """Mechanical energy, J, beyond which a motion has diverged."""
        return energy_limit(self.model, self.spin, self.displacement_limit)

    @cached_property
    def modal_error(self) -> float:
        """Estimated error by the omitted modes, relative to each signal and force."""
        touch = touch_of(self.model, self.law, is_updated=self.is_updated)
        are_kept = kept_modes(self.model, self.spin, self.accuracy, touch)
        return modal_error(self.model, self.spin, are_kept, touch)

    @cached_property
    def modes_missing(self) -> str:
        """Advice where that error exceeds the requested accuracy; else ""."""
        if self.modal_error <= self.accuracy:
            return ""
        fix = sufficient_accuracy(self.model, self.spin)
        return (
            f"it needs more than {MOST_MODES} modes: those left out may change signals by "
            f"{100 * self.modal_error:.2g} %, chaotic motions by more; accuracy = {fix:.0e} keeps all"
        )

    def bodies(self, friction: float, clearance: Floats) -> Reduced:
        """The reduced bodies of a case for kernels; clearance (q,), m. Cases of a friction share the rest."""
        if friction not in self._bodies:
            given = self.law, self.displacement_limit
            self._bodies[friction] = kernel_bodies(self.reduced, self.model, friction, clearance, *given)
        return self._bodies[friction]._replace(clearance=clearance)

    @cached_property
    def _bodies(self) -> dict[float, Reduced]:
        """Bodies by friction."""
        return {}

    @cached_property
    def interval(self) -> float:
        """Time between samples, s."""
        return 2.0 * math.pi / (abs(self.spin) * self.samples_per_revolution)

    @cached_property
    def sample_level(self) -> int:
        """Samples are 2^sample_level ticks apart; no step of contact is shorter than a tick."""
        return max(2, self._contact_levels, math.ceil(math.log2(self.interval / FINEST_TICK)))

    @property
    def _contact_levels(self) -> int:
        """Levels between the interval of samples and the longest step of a recorded contact."""
        return max(0, math.ceil(math.log2(CONTACT_STEPS / self.samples_per_revolution)))

    @cached_property
    def tick(self) -> float:
        """Resolution of events, s."""
        return self.interval / (1 << self.sample_level)

    @cached_property
    def clock(self) -> Clock:
        """Clock from the shaft's angle 0 on, without a record."""
        return Clock(
            spin=self.spin,
            tick=self.tick,
            sample_level=self.sample_level,
            samples_per_revolution=self.samples_per_revolution,
            search_level=self.level_within(self.step),
            contact_level=self.sample_level - self._contact_levels,
            n_sample=0,
            growth=0.0,
        )

    def level_within(self, step: float) -> int:
        """Largest level at which 2^level ticks are no longer than a step, s, and than a sample's interval."""
        return max(0, min(self.sample_level, math.floor(math.log2(step / self.tick))))

    @cached_property
    def _opened(self) -> ContactMode:
        """Contact mode with every pair open, which does not depend on friction."""
        gap_jacobian, force_direction, _ = directions(self.reduced, self.model, 0.0)
        return solve_contact_mode(self.reduced, gap_jacobian, force_direction, 0)

    @cached_property
    def flight_modes(self) -> FlightModes:
        """What the collocation integrator takes of the set-up."""
        mode = self._opened
        m = mode.n_eigenmode
        exponent, motion, enter = mode.exponent[:m], mode.motion[:, :m].copy(), mode.enter.copy()
        for k in np.flatnonzero(exponent.imag == 0.0):  # real but for a factor
            factor = motion[np.abs(motion[:, k]).argmax(), k]
            motion[:, k], enter[k] = (motion[:, k] / factor).real, (enter[k] * factor).real
        orders, forced = [1], [mode.motion[:, m]]
        reduced, basis = self.reduced, self.reduced.basis[: self.model.rotor.n_dof]
        for order, force in self.model.harmonics:
            rate = 1j * order * self.spin
            dynamic = reduced.stiffness + rate * reduced.damping + rate**2 * np.eye(len(reduced.stiffness))
            moved = np.linalg.solve(dynamic, force @ basis)
            orders.append(order)
            forced.append(np.concatenate([moved, rate * moved]))
        is_complex, turning = exponent.imag != 0.0, 1j * self.spin
        # A reference back would keep both, megabytes of tables, until a rare collection of cycles.
        own = weakref.proxy(self)
        return FlightModes(
            own, exponent, motion, enter, is_complex, turning, np.array(orders), np.column_stack(forced)
        )

    @cached_property
    def n_level(self) -> int:
        """Levels for which exponentials are tabulated."""
        past_sample = max(SAMPLES_AT_ONCE, self.samples_per_revolution // FEWEST_STEPS)
        return self.sample_level + past_sample.bit_length()

    def library(self, friction: float) -> ModeLibrary:
        """Contact modes of a friction, shared by its cases."""
        if friction not in self._libraries:
            self._libraries[friction] = ModeLibrary(
                self.reduced,
                self.model,
                friction,
                opened=self._opened,
                tick=self.tick,
                sample_level=self.sample_level,
                n_level=self.n_level,
                is_measured=self.is_measured,
                among=self._among,
            )
        return self._libraries[friction]

    @cached_property
    def _among(self) -> OpenBodies | None:
        """Several stators while open."""
        return open_bodies(self.reduced, self.model, self._opened)

    @property
    def n_byte(self) -> dict[float, int]:
        """Memory of the tables of contact modes, bytes, by friction."""
        return {friction: library.n_byte for friction, library in self._libraries.items()}

    def n_solved(self, friction: float) -> int:
        """Number of contact modes of a friction that were solved, including repeated ones."""
        return self._libraries[friction].n_solved if friction in self._libraries else 0

    def forget_but(self, most: int) -> None:
        """Free the contact modes of all but so many frictions, the last ones."""
        for friction in list(self._bodies | self._libraries)[:-most]:
            self.forget(friction)
        if self.release is not None:
            self.release.setup.forget_but(most)

    def forget(self, friction: float) -> None:
        """Free the contact modes of a friction."""
        self._bodies.pop(friction, None)
        self._libraries.pop(friction, None)
