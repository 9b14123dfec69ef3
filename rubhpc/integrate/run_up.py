"""A case whose spin speed changes: pieces of constant speed, each in closed form.

With the angle phi of the shaft, the unbalance acts as `Re[p (phi'^2 - i phi'') exp(i phi)]`, p being its
phasor at unit speed; a disc whose spin momentum follows its tilt needs `phi'' G u` besides `phi' G u'`; and
the inertia of the shaft twists it by the static response to `-phi'' J`. The angle is exact at the ends of a
piece. Within it, of the duration T, it lags at the time s behind that of the steady spin between these ends
by `phi'' s (T - s) / 2`: the mean, `phi'' T^2 / 12`, is taken off the phase, so that what is left
alternates. The error falls with the square of the piece.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError
from rubhpc.fem.assemble import model_at
from rubhpc.fem.statics import sag_under
from rubhpc.integrate.case import march_of
from rubhpc.integrate.contact_mode import KeptParts
from rubhpc.integrate.contact_stepping_march import ContactSteppingMarch
from rubhpc.integrate.event_driven_march import NoClosedForm
from rubhpc.integrate.measures import add_sag, empty_samples, new_accumulator
from rubhpc.integrate.packing import whole_system
from rubhpc.integrate.record import State
from rubhpc.integrate.setup import ModalSetup
from rubhpc.integrate.start import start_of
from rubhpc.kernels.accumulators import IMPACT_STEPS
from rubhpc.study.initial import Initial

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.contact_mode import Solved
    from rubhpc.integrate.speed_law import SpeedLaw
    from rubhpc.kernels.accumulators import Accumulator, Samples

    Floats = NDArray[np.float64]

MATRIX_SPEEDS = 0.005  # relative: gyroscopic terms and bearings keep their values over such a range of speeds


@dataclass(frozen=True, kw_only=True, eq=False)
class PieceSetup(ModalSetup):
    """A set-up at the speed of a piece; parts of the system that were solved before are not solved again."""

    kept: KeptParts
    most_energy: float  # J, beyond which the motion has diverged, at the highest speed

    @cached_property
    def energy_limit(self) -> float:
        """Mechanical energy, J, beyond which a motion has diverged."""
        return self.most_energy

    @property
    def _known_of_ring(self) -> Solved:
        return self.kept

    @cached_property
    def _known(self) -> Solved:
        return self.kept


@dataclass(frozen=True, kw_only=True, eq=False)
class RunUp:
    """What a run-up has yielded, revolution by revolution.

    Attributes
    ----------
    reason : str
        Why it ended early; "" where it did not.
    whole : (n_row, n_sample)
        Samples as `Samples.whole`, locked to the shaft.
    speed : (n_revolution,), rad/s
        Mean over each revolution.
    time : (n_revolution,), s
        When each begins.
    contact_fraction, peak_contact_force, friction_work : (n_revolution, n_stator)
        Of each revolution; 1, N and J.
    n_step : int
    final : State
    """

    reason: str
    whole: Floats
    speed: Floats
    time: Floats
    contact_fraction: Floats
    peak_contact_force: Floats
    friction_work: Floats
    n_step: int
    final: State


class Pieces:
    """The set-ups of the pieces of a run-up, from that at its highest speed, which keeps the most modes."""

    def __init__(self, fastest: ModalSetup) -> None:
        self._fastest = fastest
        self._basis = fastest.reduced.basis
        self._at = 0.0  # speed of the matrices, rad/s
        self._kept = KeptParts()
        model = fastest.model
        rotor = model.rotor
        self._inertia = rotor.mass @ np.array([float(name == "thx") for _, name in rotor.degrees])
        n, n_all = rotor.n_dof, model.body_start[-1]
        momentum = np.zeros((n_all, n_all))
        momentum[:n, :n] = rotor.gyroscopic
        self._momentum = self._basis.T @ momentum @ self._basis
        self._phasor = (model.unbalance_cosine - 1j * model.unbalance_sine) @ self._basis[:n]

    def setup(self, speed: float, acceleration: float, angle: float, duration: float) -> PieceSetup:
        """The set-up of a piece: mean speed (rad/s), acceleration (rad/s^2), first angle, duration (s)."""
        if not abs(speed - self._at) <= 0.5 * MATRIX_SPEEDS * self._at:
            self._set_matrices(speed)
        model = self._model
        sag = sag_under(model.rotor, model.load - acceleration * self._inertia)
        constant = None if model.probe is None else model.probe_rows[0][:, : sag.size] @ sag
        if model.probe is not None and constant is not None:
            model = replace(model, probe=replace(model.probe, constant=constant))
        lag = acceleration * duration**2 / 12.0
        phasor = self._phasor * (speed**2 - 1j * acceleration) * np.exp(1j * (angle - lag))
        return PieceSetup(
            scheme=self._fastest.scheme,
            model=replace(model, sag=sag),
            reduced=replace(
                self._fastest.reduced,
                spin=speed,
                stiffness=self._stiffness + acceleration * self._momentum,
                damping=self._damping,
                force=np.stack([phasor.real, -phasor.imag]),
            ),
            spin=speed,
            step=self._fastest.step,
            contact_step=self._fastest.contact_step,
            samples_per_revolution=self._fastest.samples_per_revolution,
            is_updated=self._fastest.is_updated,
            law=self._fastest.law,
            displacement_limit=self._fastest.displacement_limit,
            kept=self._kept,
            most_energy=self._fastest.energy_limit,
        )

    def _set_matrices(self, speed: float) -> None:
        """Take gyroscopic terms and bearings at a speed a half range further on."""
        direction = 1.0 if speed > self._at else -1.0
        self._at = speed * (1.0 + direction * 0.5 * MATRIX_SPEEDS) if self._at else speed
        self._model: Model = self._tabulated(self._at)
        _, damping, stiffness, _ = whole_system(self._model, self._at)
        self._damping = self._basis.T @ damping @ self._basis
        self._stiffness = self._basis.T @ stiffness @ self._basis
        self._kept.clear()

    def _tabulated(self, speed: float) -> Model:
        """The model at a speed within the tables of its bearings."""
        speeds = self._fastest.model.rotor.tabulated_speeds
        return model_at(
            self._fastest.model, float(np.clip(speed, speeds[0], speeds[-1])) if speeds else speed
        )


def integrate_run_up(
    fastest: ModalSetup,
    law: SpeedLaw,
    *,
    clearance: float,
    friction: float,
    initial: State | Initial,
    pieces_per_revolution: int = 1,
    check: Callable[[], None] | None = None,
) -> RunUp:
    """Integrate a case with a changing speed and record every revolution.

    Parameters
    ----------
    fastest : ModalSetup
        The case at the highest speed of the law.
    clearance : float, m
    friction : float
    pieces_per_revolution : int
        Into how many pieces of constant speed a revolution is cut; a divisor of the samples in it.
    check : callable, optional
        Called between kernel calls; what it raises ends the run-up.
    """
    model, per_revolution = fastest.model, fastest.samples_per_revolution
    if per_revolution % pieces_per_revolution:
        problem = f"{pieces_per_revolution} is no divisor of the {per_revolution} samples in a revolution"
        raise InputError(f"pieces_per_revolution: {problem}; choose another number")
    n_taken, n_stator, n = per_revolution // pieces_per_revolution, len(model.stators), law.n_revolution
    angles = 2.0 * np.pi * np.arange(n * pieces_per_revolution + 1) / pieces_per_revolution
    times, _, _ = law.at_angle(angles)
    _, _, accelerations = law.at_angle(0.5 * (angles[1:] + angles[:-1]))
    whole = empty_samples(model.n_place, n * per_revolution, model.n_probe).whole
    contact_time, peak, work = np.zeros((3, n, n_stator))
    pieces = Pieces(fastest)
    state = initial if isinstance(initial, State) else None
    n_step, reason, n_done = 0, "", len(angles) - 1
    for i in range(len(angles) - 1):
        duration = times[i + 1] - times[i]
        setup = pieces.setup((angles[i + 1] - angles[i]) / duration, accelerations[i], angles[i], duration)
        if state is None:
            state = start_of(initial, setup, clearance) if isinstance(initial, Initial) else initial
        samples, accumulator, march_steps, state, why = _pass(
            setup, n_taken, clearance, friction, state, check
        )
        n_step += march_steps
        turn = i // pieces_per_revolution
        whole[:, i * n_taken : (i + 1) * n_taken] = samples.whole
        contact_time[turn] += accumulator.contact_time
        work[turn] += accumulator.friction_work
        peak[turn] = np.maximum(peak[turn], accumulator.peak_force)
        if why:
            reason, n_done = f"{why} in revolution {turn + 1}", i
            break
    assert state is not None  # a law has a whole revolution at least
    n_whole = n_done // pieces_per_revolution
    begins = times[::pieces_per_revolution]
    turns = np.diff(begins)[:n_whole]
    return RunUp(
        reason=reason,
        whole=whole[:, : n_whole * per_revolution],
        speed=2.0 * np.pi / turns,
        time=begins[:n_whole],
        contact_fraction=contact_time[:n_whole] / turns[:, np.newaxis],
        peak_contact_force=peak[:n_whole],
        friction_work=work[:n_whole],
        n_step=n_step,
        final=state,
    )


def _pass(
    setup: PieceSetup,
    n_sample: int,
    clearance: float,
    friction: float,
    state: State,
    check: Callable[[], None] | None,
) -> tuple[Samples, Accumulator, int, State, str]:
    """One piece: samples, sums, steps, the state at its end, and why it could not go on, or ""."""
    model = setup.model
    for kind in (march_of(setup.scheme, setup), ContactSteppingMarch):
        samples = empty_samples(model.n_place, n_sample, model.n_probe)
        accumulator = new_accumulator(len(model.stators), model.n_place)
        try:
            march = kind(setup, clearance, friction, state, check)
            accumulator.is_touching[:] = march.touching()
            accumulator.age[accumulator.is_touching] = IMPACT_STEPS
            reason = march.advance(0, n_sample, samples, accumulator, is_recorded=True)
        except NoClosedForm:  # contacts that chatter: short steps need no events
            continue
        add_sag(samples, accumulator, model)
        return samples, accumulator, march.n_step, march.final(), reason or ""
    raise AssertionError  # short steps always go on
