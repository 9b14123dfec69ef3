"""Integration of a case piece after piece, each at its own speed, by one march."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.case import MARCHES
from rubhpc.integrate.changing_speed.range_library import RangeLibrary
from rubhpc.integrate.marches.case_modes import NoClosedForm
from rubhpc.integrate.marches.collocation import CollocationMarch
from rubhpc.integrate.marches.modal import FAST, ModalMarch, Place
from rubhpc.integrate.measuring.samples import empty_samples, following_accumulator
from rubhpc.integrate.record import State

if TYPE_CHECKING:
    from collections.abc import Callable

    from rubhpc.fem.model import Model
    from rubhpc.integrate.changing_speed.mode_courses import Eigenmodes
    from rubhpc.integrate.changing_speed.piece_setup import PieceSetup
    from rubhpc.kernels.accumulators import Accumulator, Samples


Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

NEARLY_FAST = 0.8 * FAST  # frequency of a mode over the spin, above which its motion is taken over


class PieceEnd(NamedTuple):
    """End of a piece."""

    setup: PieceSetup
    library: RangeLibrary
    left: tuple[int, Floats]  # as of `ModalMarch.reached_in`
    time: float  # s, since the piece began
    acceleration: float  # rad/s^2


def carried(before: PieceEnd, jump: float, march: ModalMarch, setup: PieceSetup) -> Floats | None:
    """Coordinates (2, m) of the end of a piece in the modes of the next one; None where they have none.

    Parameters
    ----------
    jump : float, rad/s^2
        Sudden change of the acceleration.
    march : ModalMarch
        At the beginning of the next piece.
    """
    (mask, z), old, next_ = before.left, before.setup, march.library
    if mask != march.mask or not isinstance(next_, RangeLibrary):
        return None
    place = _inside(setup.matrices.within(old.spin))
    common = setup.matrices.reduced.spin + place * setup.matrices.reach
    modes = next_.eigenmodes(march.mask, place)
    known = before.library.eigenmodes(march.mask, _inside(old.matrices.within(common)))
    if modes is None or known is None:
        return None
    fast = np.flatnonzero(np.abs(known.exponent) > NEARLY_FAST * abs(setup.spin))
    entered = modes.enter @ (known.motion[:, fast] @ (z[0, fast] + 1j * z[1, fast])).real
    if jump:
        entered = entered + _rung(modes, before, jump, setup)
    found = np.zeros((2, next_.width))
    found[:, : entered.size] = entered.real, entered.imag
    return found


def _rung(modes: Eigenmodes, before: PieceEnd, jump: float, setup: PieceSetup) -> Complexes:
    """What a sudden change of the acceleration adds to coordinates (m,) by sag, force and stiffness."""
    old, n = before.setup, modes.motion.shape[0] // 2
    turning = complex(old.clock.growth, old.spin)
    factor, force = complex(old.speeds.factor[old.place]), old.spin**2 - 1j * before.acceleration
    project = setup.reduced.project[:, : setup.matrices.lean.size]
    moved = -jump * np.concatenate([project @ setup.matrices.lean, project @ setup.matrices.slope])
    none = np.zeros(len(modes.constant))
    found = modes.entered(moved, none, turning, -1j * jump / force * factor, before.time)
    whirl = modes.response(turning, factor)[:n] * np.exp(turning * before.time)
    pushed = 0.5 * modes.enter[:, n:] @ (jump * setup.matrices.momentum)
    by_whirl = pushed @ whirl / (turning - modes.exponent)
    found += by_whirl + pushed @ whirl.conj() / (turning.conjugate() - modes.exponent)
    return found


def _inside(place: float) -> float:
    """The place in a range that is nearest."""
    return min(max(place, -1.0), 1.0)


class PieceResult(NamedTuple):
    """Result of a piece."""

    whole: Floats  # (n_row, n_sample), about the sag, until the next piece
    accumulators: list[Accumulator]  # of each revolution in it, or of its part of a revolution
    n_step: int
    end: Place
    gained: float  # mechanical energy, J; NaN if not requested
    reason: str  # why it could not continue, or ""


class PieceIntegrator:
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
        self._march: ModalMarch | None = None
        self.left: tuple[int, Floats] | None = None  # end of the last piece, in modal coordinates
        self._lasted = 0.0  # s, duration of that piece
        self._room: dict[int, Samples] = {}  # by number of samples of a piece

    def anew(self) -> PieceIntegrator:
        """Another one of the same case, which has not begun."""
        return PieceIntegrator(*self._case, self._check, self._say)

    def take(
        self,
        setup: PieceSetup,
        n_sample: int,
        begun: State | Place,
        earlier: tuple[Accumulator, float],
        *,
        is_balanced: bool = False,
        goes_on: bool = False,
    ) -> PieceResult:
        """Integrate one piece; `earlier` has the contact forces before it, and how long ago they began, s.

        `is_balanced`: its energies are requested. `goes_on`: the piece before was integrated too, with the
        same acceleration and matrices of the same range; or it is the first one, without ringing fast modes.
        """
        self._look(setup)
        try:
            march = self._begin(setup, n_sample, begun, goes_on=goes_on)
            passed = self._pass(march, setup, n_sample, earlier, is_balanced)
            if march.has_lost_events(setup.interval * n_sample):
                raise NoClosedForm
            return passed
        except NoClosedForm:  # contacts that chatter, or too many sets of them
            self._march = None
            steps = CollocationMarch(setup, *self._case, state_at(begun, setup), self._check)
            return self._pass(steps, setup, n_sample, earlier, is_balanced)

    def _look(self, setup: PieceSetup) -> None:
        """Let the caller end the case, and report the speed."""
        if self._check is not None:
            self._check()
            self._say(f"a case at {setup.spin * 30.0 / math.pi:.0f} rpm")

    def goes_over(
        self, setup: PieceSetup, begun: State | Place, before: PieceEnd | None, jump: float = 0.0
    ) -> bool:
        """Whether fast modes go on from a piece before, of another range or acceleration, into the next one.

        `jump` (rad/s^2) is a sudden change of the acceleration.
        """
        march = self._march
        if march is None or before is None or not isinstance(begun, Place):
            return False
        if not (before.setup.matrices.is_interpolated and setup.matrices.is_interpolated):
            return False
        try:
            march.begin(setup, begun)
        except NoClosedForm:
            return False
        z = carried(before, jump, march, setup)
        if z is not None:
            self.left = before.left[0], z
        return z is not None

    def ended(self, setup: PieceSetup, n_sample: int, acceleration: float) -> PieceEnd | None:
        """End of the last piece in its own modes, if it has any; its acceleration is in rad/s^2."""
        library = self._march.library if self._march is not None else None
        if self.left is None or not isinstance(library, RangeLibrary):
            return None
        mask, z = self.left
        return PieceEnd(setup, library, (mask, z.copy()), setup.interval * n_sample, acceleration)

    def is_open(self, begun: State | Place, setup: PieceSetup) -> bool:
        """Whether nothing touches as a piece begins, about the sag of its middle too."""
        if begun.contact_force.any():
            return False
        if isinstance(begun, State):
            return True
        if self._march is None:
            return False
        return bool((self._march.gaps(setup, begun) >= 0.0).all())

    def _longer(self, setup: PieceSetup, n_sample: int) -> float:
        """Duration, s, of the last piece or of the next one, whichever is longer."""
        return max(self._lasted, setup.interval * n_sample)

    def _begin(self, setup: PieceSetup, n_sample: int, begun: State | Place, *, goes_on: bool) -> ModalMarch:
        """The march at the beginning of a piece."""
        march = self._march
        if march is not None and isinstance(begun, Place):
            march.begin(setup, begun)
        else:
            made = MARCHES[setup.scheme](setup, *self._case, state_at(begun, setup), self._check)
            self._march = march = cast("ModalMarch", made)
            if goes_on:
                mask, z = march.reached_in()
                self.left = mask, np.zeros_like(z)
        if goes_on:
            self._keep_fast(march, setup, n_sample)
        return march

    def _keep_fast(self, march: ModalMarch, setup: PieceSetup, n_sample: int) -> None:
        """Let fast modes that follow the speed continue unchanged."""
        library = march.library
        if self.left is not None and isinstance(library, RangeLibrary) and library.interpolates(march.mask):
            march.keep_fast(self.left, setup.spin, self._longer(setup, n_sample))

    def _pass(
        self,
        march: ModalMarch,
        setup: PieceSetup,
        n_sample: int,
        earlier: tuple[Accumulator, float],
        is_balanced: bool,
    ) -> PieceResult:
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
        self.left = march.reached_in()
        self._lasted = setup.interval * n_sample
        return PieceResult(samples.whole, accumulators, march.n_step, march.reached(), gained, reason or "")

    def _room_for(self, model: Model, n_sample: int) -> Samples:
        if n_sample not in self._room:
            self._room[n_sample] = empty_samples(model.n_place, n_sample, model.n_probe, model.n_push)
        return self._room[n_sample]


def state_at(begun: State | Place, setup: PieceSetup) -> State:
    """The motion at the beginning of a piece, in the degrees of its bodies."""
    if isinstance(begun, State):
        return begun
    displacement, velocity = (setup.reduced.basis @ begun.motion.reshape(2, -1).T).T.copy()
    displacement[: begun.sag.size] += begun.sag
    return State.of_bodies(setup.model, displacement, velocity, begun.contact_force)
