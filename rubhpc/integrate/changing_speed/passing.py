"""Integration of a case piece after piece, each at its own speed, by one march."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.case import march_of
from rubhpc.integrate.changing_speed.carried_modes import Ended, carried
from rubhpc.integrate.changing_speed.piece_setup import with_values
from rubhpc.integrate.changing_speed.range_library import RangeLibrary
from rubhpc.integrate.changing_speed.stretch import Stretch, begin_stretch, take_stretch
from rubhpc.integrate.marches.contact_stepping import ContactSteppingMarch
from rubhpc.integrate.marches.event_driven import EventDrivenMarch
from rubhpc.integrate.marches.met_modes import NoClosedForm
from rubhpc.integrate.marches.modal import ModalMarch, Place
from rubhpc.integrate.measuring.samples import empty_samples, following_accumulator
from rubhpc.integrate.record import State
from rubhpc.kernels.accumulators import Accumulator, Samples  # noqa: TC001 - of a NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable

    from rubhpc.fem.model import Model
    from rubhpc.integrate.changing_speed.block import Block
    from rubhpc.integrate.changing_speed.piece_setup import PieceSetup

Floats = NDArray[np.float64]


class Passed(NamedTuple):
    """Result of a piece."""

    whole: Floats  # (n_row, n_sample), about the sag, until the next piece
    accumulators: list[Accumulator]  # of each revolution in it, or of its part of a revolution
    n_step: int
    end: Place
    gained: float  # mechanical energy, J; NaN if not requested
    reason: str  # why it could not continue, or ""


class Passing:
    """Integrates the pieces of a case by one march, which begins again at each of their speeds."""

    def __init__(
        self,
        clearance: float,
        friction: float,
        check: Callable[[], None] | None,
        say: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._case = clearance, friction
        self._check, self._say = check, say
        self._march: EventDrivenMarch | None = None
        self.left: tuple[int, Floats] | None = None  # end of the last piece, in modal coordinates
        self._lasted = 0.0  # s, duration of that piece
        self._room: dict[int, Samples] = {}  # by number of samples of a piece
        self._at: PieceSetup | None = None  # the piece at whose beginning the march is

    def take(
        self,
        setup: PieceSetup,
        n_sample: int,
        begun: State | Place,
        earlier: tuple[Accumulator, float],
        *,
        is_balanced: bool = False,
        goes_on: bool = False,
    ) -> Passed:
        """Integrate one piece; `earlier` has the contact forces before it, and how long ago they began, s.

        `is_balanced`: its energies are requested. `goes_on`: the piece before was integrated too, with the
        same acceleration and matrices of the same range; or it is the first one, without ringing fast modes.
        """
        self._look(setup)
        try:
            march = self._begin(setup, n_sample, begun, goes_on=goes_on)
            passed = self._pass(march, setup, n_sample, earlier, is_balanced)
            if isinstance(march, EventDrivenMarch):
                lasts, closed = setup.interval * n_sample, march.closed(march.mask)
                if march.has_lost_events(passed.n_step, lasts, march.motion(), closed):
                    raise NoClosedForm
            return passed
        except NoClosedForm:  # chattering contacts: short steps need no events
            self._march = None
            even = evenly_forced(setup, n_sample)
            steps = ContactSteppingMarch(even, *self._case, state_at(begun, setup), self._check)
            return self._pass(steps, setup, n_sample, earlier, is_balanced)

    def _look(self, setup: PieceSetup) -> None:
        """Let the caller end the case, and report the speed."""
        if self._check is not None:
            self._check()
            self._say(f"a case at {setup.spin * 30.0 / math.pi:.0f} rpm")

    def goes_over(
        self, setup: PieceSetup, begun: State | Place, before: Ended | None, jump: float = 0.0
    ) -> bool:
        """Whether fast modes go on from a piece before, of another range or acceleration, into the next one.

        `jump` (rad/s^2) is a sudden change of the acceleration. The height of a curved gap depends on the
        motion, which must not change while the gap is closed.
        """
        march = self._march
        if march is None or before is None or not isinstance(begun, Place):
            return False
        if not march.has_closed_form and (begun.contact_force > 0.0).any():
            return False
        if not (before.setup.held.is_followed and setup.held.is_followed):
            return False
        try:
            march.begin(setup, begun)
        except NoClosedForm:
            return False
        z = carried(before, jump, march, setup)
        if z is not None:
            self.left = before.left[0], z
        return z is not None

    def ended(self, setup: PieceSetup, n_sample: int, acceleration: float) -> Ended | None:
        """End of the last piece in its own modes, if it has any; its acceleration is in rad/s^2."""
        library = None if self._march is None else self._march.library
        if self.left is None or not isinstance(library, RangeLibrary):
            return None
        mask, z = self.left
        return Ended(setup, library, (mask, z.copy()), setup.interval * n_sample, acceleration)

    def is_open(self, begun: State | Place, setup: PieceSetup) -> bool:
        """Whether nothing touches as a piece begins, about the sag of its middle too."""
        if begun.contact_force.any():
            return False
        if isinstance(begun, State):
            return True
        if self._march is None:
            return False
        return bool((self._march.gaps(setup, begun) >= 0.0).all())

    def take_several(
        self,
        block: Block,
        first: int,
        n_sample: int,
        begun: State | Place,
        earlier: tuple[Accumulator, float],
        *,
        goes_on: bool = False,
    ) -> Stretch | None:
        """Integrate pieces with the same matrices from `first` on, as many as possible; None for none."""
        if self._march is None or not isinstance(begun, Place):
            return None
        if self._check is not None:
            self._check()
        room = self._room_for(block.model, n_sample)
        left = self.left if goes_on else None
        march, setup = self._march, block[first]
        try:
            library = begin_stretch(march, setup, begun, self._longer(setup, n_sample), left)
        except NoClosedForm:
            return None
        if library is None:
            self._at = setup if march.has_piece_loop else None
            return None

        def look(piece: int) -> None:
            self._look(block[min(piece, len(block) - 1)])

        found = take_stretch(march, library, block, first, room, begun, earlier, look)
        if found is not None:
            self.left, self._lasted = found.left, float(block.interval[first + found.n_piece - 1]) * n_sample
        return found

    def _longer(self, setup: PieceSetup, n_sample: int) -> float:
        """Duration, s, of the last piece or of the next one, whichever is longer."""
        return max(self._lasted, setup.interval * n_sample)

    def _begin(self, setup: PieceSetup, n_sample: int, begun: State | Place, *, goes_on: bool) -> ModalMarch:
        """The march at the beginning of a piece."""
        march, at, self._at = self._march, self._at, None
        if march is not None and isinstance(begun, Place):
            if at is setup:
                return march
            march.begin(setup, begun)
            if goes_on:
                self._keep_fast(march, setup, n_sample)
            return march
        kind = march_of(setup.scheme, setup)
        is_stepped = kind is ContactSteppingMarch
        taken = evenly_forced(setup, n_sample) if is_stepped else setup
        made = kind(taken, *self._case, state_at(begun, setup), self._check)
        assert isinstance(made, ModalMarch)
        if isinstance(made, EventDrivenMarch):
            self._march = made
            if goes_on:
                mask, z = made.reached_in()
                self.left = mask, np.zeros_like(z)
                self._keep_fast(made, setup, n_sample)
        return made

    def _keep_fast(self, march: EventDrivenMarch, setup: PieceSetup, n_sample: int) -> None:
        """Let fast modes that follow the speed continue unchanged."""
        library = march.library
        if self.left is not None and isinstance(library, RangeLibrary) and library.follows(march.mask):
            march.keep_fast(self.left, setup.spin, self._longer(setup, n_sample))

    def _pass(
        self,
        march: ModalMarch,
        setup: PieceSetup,
        n_sample: int,
        earlier: tuple[Accumulator, float],
        is_balanced: bool,
    ) -> Passed:
        model = setup.model
        samples = self._room_for(model, n_sample)
        samples.whole[:] = 0.0
        before = march.energy() if is_balanced else math.nan
        accumulators: list[Accumulator] = []
        stride, reason = min(n_sample, setup.samples_per_revolution), None
        for first in range(0, n_sample, stride):
            follows = (accumulators[-1], 0.0) if accumulators else earlier
            accumulator = following_accumulator(*follows)
            accumulator.is_touching[:] = march.touching()
            accumulators.append(accumulator)
            reason = march.advance(first, first + stride, samples, accumulator, is_recorded=True)
            if reason is not None:
                break
        gained = march.energy() - before if is_balanced else math.nan
        self.left = march.reached_in() if isinstance(march, EventDrivenMarch) else None
        self._lasted = setup.interval * n_sample
        return Passed(samples.whole, accumulators, march.n_step, march.reached(), gained, reason or "")

    def _room_for(self, model: Model, n_sample: int) -> Samples:
        if n_sample not in self._room:
            self._room[n_sample] = empty_samples(model.n_place, n_sample, model.n_probe)
        return self._room[n_sample]


def evenly_forced(setup: PieceSetup, n_sample: int) -> PieceSetup:
    """The set-up of a piece with a constant unbalance force, that of its middle, for short steps."""
    growth = setup.clock.growth
    grown = math.exp(0.5 * growth * setup.interval * n_sample)
    return with_values(
        setup,
        clock=setup.clock._replace(growth=0.0),
        reduced=with_values(setup.reduced, force=grown * setup.reduced.force),
        _open_tables={},
    )


def state_at(begun: State | Place, setup: PieceSetup) -> State:
    """The motion at the beginning of a piece, in the degrees of its bodies."""
    if isinstance(begun, State):
        return begun
    displacement, velocity = (setup.reduced.basis @ begun.motion.reshape(2, -1).T).T.copy()
    displacement[: begun.sag.size] += begun.sag
    return State.of_bodies(setup.model, displacement, velocity, begun.contact_force)
