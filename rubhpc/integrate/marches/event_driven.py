"""A case from event to event, in closed form between them: the exact modal integrator."""

from __future__ import annotations

from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.marches.case_modes import CaseModes, NoClosedForm
from rubhpc.integrate.marches.march import ALL_SAMPLES
from rubhpc.integrate.marches.modal import ModalMarch, slowest_fast
from rubhpc.integrate.measuring.samples import no_record
from rubhpc.kernels.case_progress import MODE_WANTED, NO_SECTIONS, Sections, restart_clock
from rubhpc.kernels.closed_form.event_loop import advance
from rubhpc.kernels.closed_form.mode_change import EventWork, change_contacts, event_work
from rubhpc.kernels.contact_modes import DYING, FORCED_LEVEL
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

    Floats = NDArray[np.float64]

LOST, LEAST = 100.0, 1e-10  # of the overlap that is allowed; m
MOST_STEPS = 20.0  # of a piece, over those of the event search: with more, its events have no end


class EventDrivenMarch(ModalMarch):
    """A case that goes from one contact mode to another; `NoClosedForm` leaves it to collocation."""

    def __init__(
        self,
        setup: ModalSetup,
        clearance: float,
        friction: float,
        initial: State,
        check: Callable[[], None] | None,
    ) -> None:
        """Start from `initial`, with the contacts closed that its forces press."""
        super().__init__(setup, clearance, friction, initial, check)
        self._event_work = event_work(self._clearance.size)
        self._enter_first(initial.contact_force)

    def begin(self, setup: ModalSetup, place: Place) -> None:
        """Begin anew at another speed in the same reduced coordinates, from where a march has come."""
        self.n_step, self.sample, self._stride = 0, 0, ALL_SAMPLES
        self._take(setup)
        self._motion[:] = self.moved(setup, place)
        self._enter_first(place.contact_force)

    def reached_in(self) -> tuple[int, Floats]:
        """Set of contacts in which the case stands, and a copy of its modal coordinates (2, m)."""
        return self.mask, self._z.copy()

    def has_lost_events(self, lasts: float) -> bool:
        """Whether a piece of a duration (s) took far more steps than short ones, or missed an event.

        Then an open pair overlaps at its end by far more than an event leaves.
        """
        bodies, motion = self.bodies, self.motion()
        gap = bodies.clearance + bodies.gap_jacobian @ motion[: motion.size // 2]
        deepest = float(gap[~self.touching()].min(initial=0.0))
        is_endless = self.n_step > MOST_STEPS * lasts / self._setup.step
        return is_endless or deepest < -LOST * max(bodies.overlap, LEAST)

    def keep_fast(self, before: tuple[int, Floats], spin: float, since: float) -> None:
        """Let fast modes go on as they were before a piece (`ModalMarch.keep_fast`)."""
        mask, z = before
        if self.mask == mask:
            self._keep(z, slowest_fast(spin, since))

    def _keep(self, z: Floats, slowest: float) -> None:
        """Let modes with a pace above `slowest`, 1/s, have the coordinates (2, m)."""
        mode = int(self._bare_progress["mode"])
        pace = self.tables.pace[mode]
        fast = (pace > slowest) | (pace == DYING)
        fast[int(self.tables.n_eigenmode[mode]) :] = False
        self._z[:, fast] = z[:, fast]

    def start_again(self, state: State) -> bool:
        """Start the same case anew at another state, with the contact modes that it has met."""
        self._start_at(state)
        return True

    def _start_at(self, state: State) -> None:
        self._stride = ALL_SAMPLES
        self._begin_time()
        self._motion[:] = self.reduced(state)
        self._enter(self._first_mask(state.contact_force))

    def _enter_first(self, contact_force: Floats) -> None:
        """Enter the contact mode with which the case begins; forces (q,), N."""
        self._modes = CaseModes(self._setup.library(self._coefficient))
        self._enter(self._first_mask(contact_force))

    def _enter(self, mask: int) -> None:
        """Enter a contact mode from the motion."""
        self.find(mask)
        self._start(self.library.masks.index(mask))

    def pass_sections(
        self, n_revolution: int, samples: Samples, accumulator: Accumulator
    ) -> tuple[Floats, str | None]:
        """Go on by some revolutions without a record (`ModalMarch.pass_sections`)."""
        sections = np.empty((n_revolution, self._motion.size))
        level, first = self.clock.sample_level, -n_revolution * self.clock.samples_per_revolution
        restart_clock(self._bare_progress, first << level, first, is_recorded=False)
        self.sample, self._ended = first, None
        while self.sample < 0:
            outcome = self._advance_sections(samples, accumulator, sections)
            if outcome == MODE_WANTED:
                self.find_wanted()
                continue
            self.n_step = int(self._bare_progress["n_step"])
            self.sample = int(self._bare_progress["tick"]) >> level
            reason = self._why_ended(outcome, accumulator)
            if reason is not None:
                return sections, reason
            if self.check is not None:
                self.check()
        return sections, None

    def _first_mask(self, contact_force: Floats) -> int:
        """Set of the contacts with which the case begins."""
        return sum(1 << i for i, force in enumerate(contact_force) if force > 0.0)

    def place(self) -> tuple[Progress, Floats]:
        """Where the case stands, and its modal coordinates (2, m)."""
        return self.progress, self._z

    def find(self, mask: int) -> None:
        """See that the tables hold a set of contacts."""
        self._use(self._modes.tables_with(mask))

    def find_wanted(self) -> None:
        """See that the tables hold the set of contacts that the kernel asks for."""
        self.find(int(self._bare_progress["wanted"]))

    def _kernel(self, last_tick: int, samples: Samples, accumulator: Accumulator, is_recorded: bool) -> int:
        while (outcome := self._advance(last_tick, samples, accumulator, is_recorded)) == MODE_WANTED:
            self.find_wanted()
        return outcome

    def _advance(self, last_tick: int, samples: Samples, accumulator: Accumulator, is_recorded: bool) -> int:
        """Advance as `_kernel` does, up to a contact mode that the tables lack."""
        return self._by_kernel(samples, accumulator, (last_tick, is_recorded))

    def _by_kernel(
        self,
        samples: Samples,
        accumulator: Accumulator,
        to: tuple[int, bool],
        sections: Sections = NO_SECTIONS,
    ) -> int:
        """Advance by the kernel `to` a tick, recorded or not, or by sections from it."""
        return advance(
            self.tables,
            self.bodies,
            self.clock,
            *to,
            self._bare_progress,
            self._coordinates,
            self._event_work,
            Measured(self._recorder, samples, accumulator),
            sections,
        )

    def _advance_sections(self, samples: Samples, accumulator: Accumulator, sections: Floats) -> int:
        """Advance as `_advance` does, revolution by revolution, up to sample 0."""
        kept = Sections(sections, self._setup.energy_limit)
        return self._by_kernel(samples, accumulator, (self._end_of_revolution(), False), sections=kept)

    @property
    def _per_revolution(self) -> int:
        """Ticks of a revolution."""
        return self.clock.samples_per_revolution << self.clock.sample_level

    def _end_of_revolution(self) -> int:
        """Tick at which the present revolution ends."""
        return (int(self._bare_progress["tick"]) // self._per_revolution + 1) * self._per_revolution

    def _unsolved(self) -> str:
        raise NoClosedForm

    def _contact_force(self) -> Floats:
        return self.forces(self._bare_progress["mode"], self._z)

    @property
    def library(self) -> ModeLibrary:
        """Contact modes of the case."""
        return self._modes.library

    @property
    def mask(self) -> int:
        """Present set of closed pairs."""
        return int(self.tables.mask[self._bare_progress["mode"]])

    @property
    def pair_states(self) -> int:
        """States of all pairs as one number: the set of closed ones."""
        return self.mask

    def touching(self) -> NDArray[np.bool_]:
        """Whether each pair is closed, (q,)."""
        return self.closed(self.mask)

    def closed(self, mask: int) -> NDArray[np.bool_]:
        """Whether each pair is closed in a contact mode, (q,)."""
        return _are_set(mask, self._clearance.size)

    @property
    def given(self) -> Floats:
        """Impulses (q,), N s, of the last event by `change`."""
        return self.change_work[0].given

    def forces(self, mode: int, z: Floats) -> Floats:
        """Forces (q,), N, at coordinates (2, m) of a contact mode, given by its index in the tables."""
        is_closed = self.closed(int(self.tables.mask[mode]))
        if not is_closed.any():
            return np.zeros(is_closed.size)
        force = self.tables.switch_re[mode] @ z[0] - self.tables.switch_im[mode] @ z[1]
        return np.where(is_closed, force, 0.0)

    def exponents(self, mask: int) -> Floats:
        """Exponents of the coordinates of a contact mode (`ModeLibrary.exponents`)."""
        return self.library.exponents(mask)

    @property
    def derived(self) -> dict[int, Any]:
        """Derived data of the contact modes, kept with their tables (`ModeLibrary.derived`)."""
        return self.library.derived

    @property
    def moment(self) -> float:
        """Time, s: a pair that would part for less than that at an event stays closed."""
        return float(self.clock.tick * 2**FORCED_LEVEL)

    def change(
        self, mask: int, crossing: int, angle: float, motion: Floats, moment: float | None = None
    ) -> int:
        """Compute an event: `motion` (2 n,) after it, in place; returns the contact mode afterwards, or -1.

        `crossing` are the switch functions that vanish, `angle` (rad) is that of the shaft; `moment` (s) is
        by default `self.moment`.
        """
        return int(
            change_contacts(
                self.bodies,
                mask,
                crossing,
                self.clock.spin,
                self.moment if moment is None else moment,
                np.cos(angle),
                np.sin(angle),
                motion,
                False,
                *self.change_work,
            )
        )

    @cached_property
    def change_work(self) -> tuple[EventWork, Accumulator]:
        """Work space of `change` (`change_contacts`)."""
        return event_work(self._clearance.size), self._unrecorded

    @property
    def _unrecorded(self) -> Accumulator:
        """Accumulator for events that are not recorded."""
        return no_record(self.n_place, self._clearance.size)[1]


@lru_cache
def _are_set(mask: int, q: int) -> NDArray[np.bool_]:
    """Whether each of the lowest bits is set, (q,)."""
    found = np.array([bool(mask >> i & 1) for i in range(q)])
    found.flags.writeable = False
    return found
