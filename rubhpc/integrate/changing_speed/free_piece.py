"""Pieces of a driven rotor: the acceleration of each, from the energy exchanged with drive and friction."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.changing_speed.piece_integrator import PieceIntegrator, PieceResult, state_at
from rubhpc.integrate.changing_speed.pieces import Pieces
from rubhpc.integrate.changing_speed.twist_ramp import TwistRamp, sag_ramp
from rubhpc.integrate.measuring.samples import lift_samples, new_accumulator
from rubhpc.integrate.start import start_of
from rubhpc.kernels.accumulators import (
    DAMPING_LOSS,
    DRIVE_WORK,
    FRICTION_LOSS,
    IMPACT_LOSS,
    UNBALANCE_WORK,
)
from rubhpc.study.initial import Initial
from rubhpc.study.speed_law import LAG

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.changing_speed.piece_integrator import PieceEnd
    from rubhpc.integrate.changing_speed.piece_setup import PieceSetup
    from rubhpc.integrate.marches.modal import Place
    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.record import State
    from rubhpc.study.drive_law import DriveLaw

    Floats = NDArray[np.float64]


DRIVEN_LAG = 0.25 * LAG  # rad, deviation of the shaft's angle; the twist depends on its speed too
# Rub acts in touches, between which the speed deviates from its mean line. Its share of the torques counts so
# many times, down to this part of a revolution.
UNEVEN, SHORTEST = 25.0, 4
GUESSED = 0.005 * LAG  # rad, deviation of the shaft's angle from that with the guessed acceleration
# Change of speed without the damping by a torque that falls with the speed, over that with it: from which the
# first guess counts it, and up to which a piece need not be halved.
STEEP, STEEPEST = 1.1, 2.5
MOST_TRIES = 4  # tries of a piece before it is halved


class DrivenPiece(NamedTuple):
    """A finished piece."""

    passed: PieceResult
    lag: float  # rad, as of `speed_law.LAG`
    swing: float  # change of the speed, over the sum of the first and the last one
    times: list[float]  # s, at its beginning and at the ends of the revolutions, or of the part, in it
    drive_work: list[float]  # J, in each of them
    braking: list[float]  # N m s, in each of them
    energies: Floats  # (6,), J: spin, motion, drive, friction, damping, impacts


class Spin:
    """The spin of a running case, and its motion."""

    def __init__(
        self,
        fastest: ModalSetup,
        drive: DriveLaw,
        clearance: float,
        friction: float,
        initial: State | Initial,
        check: Callable[[], None] | None,
        say: Callable[[str], None],
    ) -> None:
        assert fastest.free_spin is not None
        model = fastest.model
        self._drive, self._initial, self._clearance = drive, initial, clearance
        self._pieces, self._integrator = Pieces(fastest), PieceIntegrator(clearance, friction, check, say)
        self._free = fastest.free_spin
        self._gyroscopic = model.rotor.gyroscopic
        self._phasor = model.unbalance_cosine - 1j * model.unbalance_sine
        self.speed, self.time = drive.start, 0.0
        self._last_turn = LastTurn(fastest.samples_per_revolution)
        # N m, by which the drive twists the shaft: at the speed that was guessed, so that it does not jump.
        self._twisting = drive.at(drive.start)
        self._begun: State | Place | None = None
        self._setup: PieceSetup | None = None  # of the last piece
        self._ended: PieceEnd | None = None  # where it has ended
        # The contact forces of the piece before, and how long it took, s.
        self._earlier = new_accumulator(len(model.stators), model.n_place), 0.0

    def go_on(self, fastest: ModalSetup) -> None:
        """Go on from the motion reached in another set-up at the highest speed."""
        if self._begun is None:
            torque, inertia = self._twisting, self._free.inertia
            at = self.speed, torque / inertia, 0.0, 2.0 * math.pi / self.speed, torque
            self._setup = self._pieces.setup(*at, self._drive.slope(self.speed))
            self._begun = self._start(self._setup)
        self._begun = self.state
        self._pieces, self._integrator, self._ended = Pieces(fastest), self._integrator.anew(), None

    @property
    def state(self) -> State:
        """The motion reached."""
        assert self._begun is not None
        assert self._setup is not None
        return state_at(self._begun, self._setup)

    def take(self, at: int, length: int, per_revolution: int, *, is_fixed: bool) -> DrivenPiece | None:
        """Integrate a piece from sample `at`; None where it is too long, or the spin does not reach its end.

        `is_fixed`: it is not shortened for accuracy. A piece with an odd number of samples is not either,
        because it cannot be halved.
        """
        drive, inertia = self._drive, self._free.inertia
        turned = 2.0 * math.pi * length / per_revolution
        first, last = (2.0 * math.pi * i / per_revolution for i in (at, at + length))
        last_turn, may_be_halved = self._last_turn, not is_fixed and length % 2 == 0
        brake = last_turn.torque(at, length)
        steep = 1.0 + max(-drive.slope(self.speed), 0.0) * turned / (2.0 * inertia * self.speed)
        acceleration = (drive.at(self.speed) - brake) / (inertia * steep)
        if steep < STEEP:
            acceleration = (drive.at(self._after(acceleration, 0.5 * turned)) - brake) / inertia
        if may_be_halved and steep > STEEPEST:
            return None
        if may_be_halved:
            foreseen = UNEVEN * last_turn.rubbed(at, length) / (turned * inertia)
            if _is_uneven(foreseen, turned / self.speed, length, per_revolution):
                return None
        for tried in range(MOST_TRIES):
            end_speed = self._after(acceleration, turned)
            if not end_speed > 0.0:
                return None
            mean = 0.5 * (self.speed + end_speed)
            duration = turned / mean
            if may_be_halved and abs(acceleration) * duration**2 > 12.0 * DRIVEN_LAG:
                return None
            torque = self._mean_torque(end_speed)
            low, high = self._twisting, drive.at(end_speed)
            middle = 0.5 * (low + high)
            slope = drive.slope(mean)
            setup = self._setup = self._pieces.setup(mean, acceleration, first, duration, middle, slope)
            of_range = setup.matrices
            ramp = TwistRamp(*(share * (high - low) * of_range.twist for share in (0.5, 1.0 / duration)))
            if of_range.sagging_models and self._is_open(setup):
                sag = sag_ramp(of_range, acceleration, self.speed, end_speed, duration)
                ramp = ramp.with_sag(sag, setup)
            if self._begun is None:
                start = self._start(setup)
                self._begun = start if start is self._initial else ramp.of_rotor(start, setup)
            reached = ramp.about_middle(self._begun, setup)
            before = self._ended
            self._integrator.left = before.left if before else None
            is_same = before is not None and before.setup.matrices is of_range
            goes_on = is_same and of_range.is_interpolated
            goes_on = goes_on or self._integrator.goes_over(setup, reached, before)
            passed = self._integrator.take(
                setup, length, reached, self._earlier, is_balanced=True, goes_on=goes_on
            )
            lift_samples(passed.whole, setup.model)
            ramp.lift(passed.whole, setup)
            if passed.reason:
                guessed = end_speed - self.speed
                return self._taken(
                    passed, acceleration, guessed, length, per_revolution, torque, np.zeros(6), 0.0
                )
            flows = np.sum([accumulator.energy for accumulator in passed.accumulators], axis=0)
            rubbed = UNEVEN * abs(flows[FRICTION_LOSS]) / (turned * inertia)  # rad/s^2
            last_turn.note_rub(at, length, abs(flows[FRICTION_LOSS]))
            if may_be_halved and _is_uneven(rubbed, duration, length, per_revolution):
                return None
            at_first = self._momentum(state_at(reached, setup), first)
            at_last = self._momentum(state_at(passed.end, setup), last)
            turning = acceleration * 0.5 * duration * (at_first[1] + at_last[1])
            given = torque * turned + turning - flows[UNBALANCE_WORK] - flows[DRIVE_WORK]
            change = self._change(given, sum(at_first), sum(at_last))
            if not math.isfinite(change):
                return None
            error = abs(change / duration - acceleration) * duration**2 / 12.0
            if error <= GUESSED or (is_fixed and tried == MOST_TRIES - 1):
                break
            # A torque that falls with the speed by more than a fraction of it would let the guesses diverge.
            acceleration += (change / duration - acceleration) / (
                1.0 + max(-slope, 0.0) * duration / (2.0 * inertia)
            )
        else:
            if length % 2 == 0:
                return None
        held = [
            inertia * 0.5 * speed**2 + speed * sum(carried_by)
            for speed, carried_by in ((self.speed, at_first), (self.speed + change, at_last))
        ]
        energies = np.array(
            [
                held[1] - held[0],
                passed.gained,
                torque * turned + turning,
                flows[FRICTION_LOSS],
                flows[DAMPING_LOSS],
                flows[IMPACT_LOSS],
            ]
        )
        found = self._taken(passed, acceleration, change, length, per_revolution, torque, energies, rubbed)
        self.speed += change
        if not self.speed > 0.0:
            return None
        self._ended = self._integrator.ended(setup, length, acceleration)
        self.time += duration
        last_turn.note_torque(at, length, torque - inertia * change / duration)
        self._twisting = high
        self._begun = ramp.after(passed.end, setup)
        self._earlier = passed.accumulators[-1], duration
        return found

    def _start(self, setup: PieceSetup) -> State:
        """The state in which the case starts."""
        start = self._initial
        if isinstance(start, Initial):
            return start_of(start, setup, self._clearance, self.speed)
        return start

    def _is_open(self, setup: PieceSetup) -> bool:
        """Whether nothing touches as a piece begins, about the sag of its middle too."""
        return self._begun is not None and self._integrator.is_open(self._begun, setup)

    def _taken(
        self,
        passed: PieceResult,
        acceleration: float,
        change: float,
        length: int,
        per_revolution: int,
        torque: float,
        energies: Floats,
        rubbed: float,
    ) -> DrivenPiece:
        """Result of a piece, revolution by revolution.

        Its times follow from the guessed acceleration (rad/s^2), braking from the change of the speed (rad/s)
        by its energy.
        """
        n = max(length // per_revolution, 1)
        turned = 2.0 * math.pi * length / (n * per_revolution)
        speeds = [self._after(acceleration, i * turned) for i in range(n + 1)]
        lasts = [2.0 * turned / (a + b) for a, b in itertools.pairwise(speeds)]
        times = (self.time + np.cumsum([0.0, *lasts])).tolist()
        missed = change - (speeds[-1] - speeds[0])
        work, braking = [], []
        for low, high, duration in zip(speeds[:-1], speeds[1:], lasts, strict=True):
            mean = torque if n == 1 else self._drive.at(0.5 * (low + high))
            work.append(mean * turned)
            braking.append(mean * duration - self._free.inertia * (high - low + missed / n))
        duration = sum(lasts)
        lag = max(abs(acceleration), rubbed) * duration**2 / 12.0
        swing = (speeds[-1] - speeds[0]) / (speeds[-1] + speeds[0])
        return DrivenPiece(passed, lag, swing, times, work, braking, energies)

    def _change(self, given: float, before: float, after: float) -> float:
        """Change of the speed, rad/s, by the energy given to the spin, J; NaN where it would reverse.

        `before` and `after` are momenta of the spin by the motion, kg m^2/s: `J W^2 / 2 + W P` grows by that
        energy.
        """
        slope = self._free.inertia * self.speed + after
        lacking = self.speed * (after - before) - given
        square = slope**2 - 2.0 * self._free.inertia * lacking
        return -2.0 * lacking / (slope + math.sqrt(square)) if square > 0.0 and slope > 0.0 else math.nan

    def _after(self, acceleration: float, angle: float) -> float:
        """Speed after an angle (rad) at an acceleration, rad/s; 0 where the spin does not reach it."""
        return math.sqrt(max(self.speed**2 + 2.0 * acceleration * angle, 0.0))

    def _mean_torque(self, end_speed: float) -> float:
        """Mean of the drive's torque over a piece whose speed changes evenly, N m, by Simpson's rule."""
        drive, middle = self._drive, 0.5 * (self.speed + end_speed)
        return (drive.at(self.speed) + 4.0 * drive.at(middle) + drive.at(end_speed)) / 6.0

    def _momentum(self, state: State, angle: float) -> tuple[float, float]:
        """Momentum of the spin by unbalance and by tilt, kg m^2/s, at an angle of the shaft (rad)."""
        turning = (1j * self._phasor * complex(np.exp(1j * angle))).real
        tilted = state.rotor_displacement @ (self._gyroscopic @ state.rotor_velocity)
        return float(turning @ state.rotor_velocity), -0.5 * float(tilted)


def _is_uneven(rubbed: float, duration: float, length: int, per_revolution: int) -> bool:
    """Whether a piece is too long for the deceleration by its touches, times `UNEVEN`, rad/s^2."""
    return rubbed * duration**2 > 12.0 * DRIVEN_LAG and SHORTEST * length > per_revolution


class LastTurn:
    """Braking over the last revolution, by the samples in it: rub recurs at the same angle."""

    def __init__(self, per_revolution: int) -> None:
        """Start without braking."""
        self._torque, self._rubbed = np.zeros((2, per_revolution))

    def torque(self, at: int, length: int) -> float:
        """Mean braking torque over so many samples from `at` on, N m."""
        return _mean(self._torque[self._part(at, length)])

    def rubbed(self, at: int, length: int) -> float:
        """Friction loss over so many samples from `at` on, J."""
        return _mean(self._rubbed[self._part(at, length)]) * length

    def note_torque(self, at: int, length: int, torque: float) -> None:
        """Store the mean braking torque of a piece, N m, also for samples not reached yet."""
        part = self._part(at, length)
        self._torque[part.start : None if at < self._torque.size else part.stop] = torque

    def note_rub(self, at: int, length: int, rubbed: float) -> None:
        """Store the friction loss of a piece, J."""
        self._rubbed[self._part(at, length)] = rubbed / length

    def _part(self, at: int, length: int) -> slice:
        first = at % self._torque.size
        return slice(first, min(first + length, self._torque.size))


def _mean(part: NDArray[np.float64]) -> float:
    return float(part.sum()) / part.size  # `mean` takes three times as long for a few
