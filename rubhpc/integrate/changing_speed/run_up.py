"""A case whose spin speed changes: pieces of constant speed, each in closed form.

With the angle phi of the shaft, the unbalance force is `Re[p (phi'^2 - i phi'') exp(i phi)]`, where p is its
phasor at unit speed. A disc whose spin momentum follows its tilt needs `phi'' G u` in addition to
`phi' G u'`. The inertia of the shaft twists it by the static response to `-phi'' J`. The angle is exact at
the ends of a piece. Within a piece of duration T, at the time s, it differs from that of the steady spin
between these ends by `phi'' s (T - s) / 2`. The mean, `phi'' T^2 / 12`, is subtracted from the phase, so that
the rest alternates. The error is proportional to the square of the length of pieces.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rubhpc.fem.free_spin import unit_rotation
from rubhpc.integrate.changing_speed.piece_integrator import PieceIntegrator, state_at
from rubhpc.integrate.changing_speed.pieces import Pieces
from rubhpc.integrate.changing_speed.turns import Turns, bring_to_angles
from rubhpc.integrate.changing_speed.twist_ramp import moved, sag_ramp
from rubhpc.integrate.marches.march import ended_in
from rubhpc.integrate.marches.modal import Place
from rubhpc.integrate.measuring.samples import empty_samples, lift_samples, new_accumulator, probe_part
from rubhpc.integrate.record import State
from rubhpc.integrate.start import start_of
from rubhpc.study.initial import CONTACT_FREE, Initial

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.changing_speed.piece_integrator import PieceEnd
    from rubhpc.integrate.changing_speed.pieces import Block
    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.kernels.accumulators import Accumulator
    from rubhpc.study.speed_law import SpeedLaw

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class RunUp:
    """Result of a run-up, revolution by revolution.

    Attributes
    ----------
    reason : str
        Why it ended early; "" where it did not.
    advice : str
        Advice where its pieces are too long for a signal; else "".
    whole : (n_row, n_sample)
        Samples as `Samples.whole`, locked to the shaft.
    speed : (n_revolution,), rad/s
        Mean over each revolution.
    time : (n_revolution,), s
        When each begins.
    contact_fraction, peak_contact_force, friction_work : (n_revolution, n_stator)
        Of each revolution; 1, N and J.
    together : Accumulator
        Contacts of all revolutions.
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
    together: Accumulator
    n_step: int
    final: State
    advice: str = ""


def integrate_run_up(
    fastest: ModalSetup,
    law: SpeedLaw,
    *,
    clearance: float,
    friction: float,
    initial: State | Initial,
    pieces_per_revolution: int | None = None,
    check: Callable[[], None] | None = None,
    say: Callable[[str], None] = lambda _: None,
    note: Callable[[float], None] = lambda _: None,
) -> RunUp:
    """Integrate a case with a changing speed and record every revolution.

    Parameters
    ----------
    fastest : ModalSetup
        The case at the highest speed of the law.
    clearance : float, m
    friction : float
    pieces_per_revolution : int, optional
        Number of pieces of constant speed per revolution, a divisor of its samples; by default as the change
        of speed requires (`speed_law.cut`).
    check : callable, optional
        Called between kernel calls; what it raises ends the run-up.
    say : callable
        Called with the speed reached as often as `check`, if that is given.
    note : callable
        Called with the share of the revolutions that is done.
    """
    model, per_revolution = fastest.model, fastest.samples_per_revolution
    n_stator, n = len(model.stators), law.n_revolution
    begins, _, _ = law.at_angle(2.0 * np.pi * np.arange(n + 1))
    stages = _stages(fastest, law, begins, pieces_per_revolution)
    cuts = np.unique(np.concatenate([stage.cuts for stage in stages]))
    angles = 2.0 * np.pi / per_revolution * cuts.astype(np.float64)
    times, at_cuts, _ = law.at_angle(angles)
    _, _, accelerations = law.at_angle(0.5 * (angles[1:] + angles[:-1]))
    whole = empty_samples(model.n_place, n * per_revolution, model.n_probe, model.n_push).whole
    gathered = Turns(n, model)
    reached: State | Place | None = initial if isinstance(initial, State) else None
    n_step, reason, n_done = 0, "", n
    earlier = new_accumulator(n_stator, model.n_place)
    sagging, begun = model, 0  # reference sag of the samples from there on
    durations, sizes = np.diff(times), np.diff(cuts)
    before = np.concatenate([[0.0], durations[:-1]])
    speeds: Floats = np.diff(angles) / durations
    # A piece in which the law bends has a mean acceleration, with which the shaft lags by `late`, rad.
    within = np.floor(bends := law.bends(per_revolution))
    bent = np.searchsorted(cuts[:-1], within[(within < bends) & (within < cuts[-1])])
    accelerations[bent] = np.diff(at_cuts)[bent] / durations[bent]
    late, sudden = np.zeros((2, speeds.size))
    sudden[bent] = accelerations[bent] - law.at_angle(angles[bent])[2]  # past its first sample
    late[bent] = ((speeds - 0.5 * (at_cuts[1:] + at_cuts[:-1])) * durations)[bent]
    is_even = sizes > 1  # pieces of one sample are around a bend
    lags, lengths, names = accelerations * durations**2 / 12.0, sizes / per_revolution, signal_names(model)
    judged = [(stage.pieces.ripples, np.arange(*stage.at)[is_even[slice(*stage.at)]]) for stage in stages]
    advice = [ripples.advice(speeds[at], lengths[at], lags[at], names) for ripples, at in judged]
    unit, none = unit_rotation(model.rotor), np.zeros(model.rotor.n_dof)
    piece = 0
    ended: PieceEnd | None = None  # the last piece
    integrator = PieceIntegrator(clearance, friction, check, say)
    if stages[0].at == (0, 0) and isinstance(initial, Initial):  # bearings let go before the first piece
        at_first = (float(column[0]) for column in (speeds, accelerations, angles, durations))
        setup = stages[0].pieces.setup(*at_first)
        reached = start_of(initial, setup, clearance, law.speed[0])
    of_pieces = speeds, accelerations, angles[:-1], durations, sizes
    for block, is_released in _blocks(stages, of_pieces):
        if is_released and reached is not None:
            reached, ended, integrator = state_at(reached, setup), None, integrator.anew()
        setup, size, begins_at = block[0], int(sizes[piece]), piece
        if setup.model is not sagging:
            lift_samples(whole[:, begun : cuts[piece]], sagging)
            sagging, begun = setup.model, cuts[piece]
        goes_on = ended is not None and ended.setup.goes_on_in(
            setup, float(accelerations[piece - 1]), float(accelerations[piece])
        )
        is_first = reached is None
        if reached is None:
            assert isinstance(initial, Initial)
            reached = start_of(initial, setup, clearance, law.speed[0])
            goes_on = is_contact_free(initial, reached)
        ramp = None
        if setup.matrices.sagging_models and integrator.is_open(reached, setup):
            end, acceleration = piece + len(block), float(accelerations[piece])
            lasts = float(times[end] - times[piece])
            ramp = sag_ramp(setup.matrices, acceleration, float(at_cuts[piece]), float(at_cuts[end]), lasts)
            if not is_first:
                reached = ramp.about_middle(reached, setup)
            elif not goes_on:  # at rest, while the sag moves
                reached = moved(reached, setup, none, -ramp.rate)
        if ended is not None and not goes_on:
            jump = float(accelerations[piece]) - ended.acceleration
            goes_on = integrator.goes_over(setup, reached, ended, jump)
        while not reason and (place := piece - begins_at) < len(block):
            first = int(cuts[piece])
            note(first / cuts[-1])
            before_it, follows = (earlier, before[piece]), goes_on or place > 0
            passed = integrator.take(block[place], size, reached, before_it, goes_on=follows)
            reached, earlier = passed.end, passed.accumulators[-1]
            if late[piece]:  # the inertia of the twist does not follow immediately
                seen = model.probe_rows[2, :, : unit.size] @ unit
                passed.whole[probe_part(model), 0] += sudden[piece] * seen
                reached = moved(reached, block[place], -late[piece] * unit, none)
            n_step += passed.n_step
            whole[:, first : first + size] = passed.whole
            for i, accumulator in enumerate(passed.accumulators):
                gathered.add(first // per_revolution + i, accumulator)
            if passed.reason:
                n_done = first // per_revolution + len(passed.accumulators) - 1
                reason = ended_in(passed.reason, n_done + 1)
            piece += 1
        if ramp is not None:
            ramp.lift(whole[:, cuts[begins_at] : cuts[piece]], setup)
            if isinstance(reached, Place) and not reached.contact_force.any():
                reached = ramp.after(reached, setup)
        if reason:
            break
        ended = integrator.ended(block.last, size, float(accelerations[piece - 1]))
    lift_samples(whole[:, begun : n_done * per_revolution], sagging)
    n_sample = n_done * per_revolution
    taken = np.unique(np.minimum(cuts, n_sample))
    _, at_cuts, _ = law.at_angle(2.0 * np.pi / per_revolution * taken)
    swing = np.diff(at_cuts) / (at_cuts[1:] + at_cuts[:-1])
    bring_to_angles(whole[:, :n_sample], swing, taken, model.n_place)
    gathered.sum_up()
    assert reached is not None  # a law has at least one revolution
    turns = np.diff(begins)[:n_done]
    return RunUp(
        reason=reason,
        whole=whole[:, :n_sample],
        speed=2.0 * np.pi / turns,
        time=begins[:n_done],
        contact_fraction=gathered.contact_time[:n_done] / turns[:, np.newaxis],
        peak_contact_force=gathered.peak_force[:n_done],
        friction_work=gathered.friction_work[:n_done],
        together=gathered.together,
        n_step=n_step,
        final=state_at(reached, setup),
        advice=next(filter(None, advice), ""),
    )


class _Stage(NamedTuple):
    """Part of a run-up up to where bearings let go of the shaft."""

    pieces: Pieces
    cuts: Ints  # samples between which its pieces lie
    at: tuple[int, int]  # its first piece, and the first of the next stage


def _stages(
    fastest: ModalSetup, law: SpeedLaw, begins: Floats, pieces_per_revolution: int | None
) -> list[_Stage]:
    """Return the stages of a run-up whose revolutions begin at times, s; the first one may have no piece."""
    stages: list[_Stage] = []
    setup, done, n_piece, per_revolution = fastest, 0, 0, fastest.samples_per_revolution
    while True:
        release = setup.release
        end = begins.size - 1 if release is None else release.turn(begins)
        if end > done or not stages:
            pieces, ends = Pieces(setup), np.array([done, end]) * per_revolution
            cuts = pieces.ripples.cut(law, per_revolution, pieces_per_revolution)
            cuts = np.union1d(cuts[(cuts > ends[0]) & (cuts < ends[1])], ends)
            first, n_piece = n_piece, n_piece + cuts.size - 1
            stages.append(_Stage(pieces, cuts, (first, n_piece)))
        if release is None or end == begins.size - 1:
            return stages
        setup, done = release.setup, end


def _blocks(stages: list[_Stage], of_pieces: tuple[Any, ...]) -> Iterator[tuple[Block, bool]]:
    """Blocks of all stages, and whether bearings let go before each; columns as of `Pieces.blocks`."""
    for stage in stages:
        is_released = stage is not stages[0]
        for block in stage.pieces.blocks(*(column[slice(*stage.at)] for column in of_pieces)):
            yield block, is_released
            is_released = False


def is_contact_free(initial: Initial, begun: State) -> bool:
    """Whether a case begins in the contact-free motion itself, without disturbance or removed overlap."""
    moved = (*begun.stator_displacement, begun.contact_force)
    return initial.from_ == CONTACT_FREE and not initial.is_disturbed and not any(m.any() for m in moved)


def signal_names(model: Model) -> list[str]:
    """Names of the signals of `Pieces.ripples`: the disc's displacements and the probes."""
    probes = () if model.probe is None else model.probe.probes
    return ["vertical", "horizontal", *(f"probe {probe.name}" for probe in probes)]
