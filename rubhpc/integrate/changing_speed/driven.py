"""A case whose spin is a degree of freedom: a drive turns it, friction and whirl brake it.

With the angle phi of the mean of rotor and drive, the inertia J of both and the phasor p of the unbalance,
the spin has the momentum `P = J phi' + m(u)` with `m = Re[i p exp(i phi)] u' - u G u' / 2`, and

    P' = T(phi') - friction torque - phi' Re[p exp(i phi)] u'.

Pieces are those of run-ups (`run_up`), each at the mean of its first and last speed. The work W of the
unbalance force on the motion of a piece is the integral of `phi'^2 Re[p exp(i phi)] u' - phi'' m`, with m as
the mean of its ends. The speed at the end follows from the torques within the piece, and the spin loses
exactly the energy that the motion gains. The acceleration of a piece is a guess: the piece is repeated where
the result differs from it, and halved where it differs strongly. Errors are proportional to the square of the
length of pieces.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError
from rubhpc.integrate.changing_speed.free_piece import DRIVEN_LAG, Spin
from rubhpc.integrate.changing_speed.run_up import RunUp
from rubhpc.integrate.changing_speed.turns import Turns, bring_to_angles
from rubhpc.integrate.marches.march import ended_in
from rubhpc.integrate.measuring.measures import LEAST_EXCHANGE
from rubhpc.integrate.measuring.samples import empty_samples
from rubhpc.study.speed_law import LONGEST_PIECE, piece_length

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.record import State
    from rubhpc.study.drive_law import DriveLaw
    from rubhpc.study.initial import Initial

    Floats = NDArray[np.float64]

ALL_TURNED, TOO_SLOW, TOO_FAST = range(3)  # why a record ends


@dataclass(frozen=True, kw_only=True, eq=False)
class DrivenRun(RunUp):
    """Result of a driven rotor, revolution by revolution.

    Attributes
    ----------
    drive_work : (n_revolution,), J
        Work of the drive.
    braking_torque : (n_revolution,), N m
        Mean torque by which friction and whirl brake the spin.
    energy_residual : float
        Of the energy balance of the motion, including the spin.
    end : int
        ALL_TURNED, TOO_SLOW or TOO_FAST.
    last_speed : float, rad/s
    """

    drive_work: Floats
    braking_torque: Floats
    energy_residual: float
    end: int
    last_speed: float


def integrate_driven(
    fastest: ModalSetup,
    drive: DriveLaw,
    *,
    clearance: float,
    friction: float,
    initial: State | Initial,
    pieces_per_revolution: int | None = None,
    check: Callable[[], None] | None = None,
    say: Callable[[str], None] = lambda _: None,
    note: Callable[[float], None] = lambda _: None,
) -> DrivenRun:
    """Integrate a case whose speed is free and record every revolution.

    Parameters
    ----------
    fastest : ModalSetup
        The case at a speed that it does not exceed, with a free spin.
    clearance : float, m
    friction : float
    pieces_per_revolution : int, optional
        Number of pieces per revolution, a divisor of its samples; by default as the change of speed requires.
    check : callable, optional
        Called between kernel calls; what it raises ends the case.
    say : callable
        Called with the speed reached as often as `check`, if that is given.
    note : callable
        Called with the share of the revolutions that is done.

    Raises
    ------
    InputError
        The spin leaves its range within the first revolution.
    """
    model, per_revolution = fastest.model, fastest.samples_per_revolution
    n = drive.n_revolution
    length = per_revolution
    if pieces_per_revolution is not None:
        length = piece_length(per_revolution, pieces_per_revolution)
    swings, cuts = [], [0]  # as of `bring_to_angles`
    whole = empty_samples(model.n_place, n * per_revolution, model.n_probe, model.n_push).whole
    gathered = Turns(n, model)
    driven_by, braked = np.zeros((2, n))
    begins = np.zeros(n + 1)
    spin = Spin(fastest, drive, clearance, friction, initial, check, say)
    n_step, reason, n_done, end, at = 0, "", 0, ALL_TURNED, 0
    energies, release = np.zeros(6), fastest.release
    while at < n * per_revolution:
        note(at / (n * per_revolution))
        done, past = divmod(at, per_revolution)
        while release is not None and not past and release.is_due(done, spin.time):
            spin.go_on(release.setup)
            release = release.setup.release
        if pieces_per_revolution is None:
            end_turn = n if release is None else done + 1
            length = _fitting(length, at, end_turn * per_revolution, per_revolution)
        taken = spin.take(at, length, per_revolution, is_fixed=pieces_per_revolution is not None)
        if taken is None:
            if pieces_per_revolution is None and length % 2 == 0 and length > 1:
                length //= 2
                continue
            end = TOO_SLOW
            break
        passed = taken.passed
        n_step += passed.n_step
        whole[:, at : at + length] = passed.whole
        swings.append(taken.swing)
        cuts.append(at + length)
        turns = max(length // per_revolution, 1)
        for i, accumulator in enumerate(passed.accumulators):
            turn = at // per_revolution + i
            gathered.add(turn, accumulator)
            driven_by[turn] += taken.drive_work[i]
            braked[turn] += taken.braking[i]
            if (at + (i + 1) * length // turns) % per_revolution == 0:
                begins[turn + 1] = taken.times[i + 1]
        if passed.reason:
            n_done = at // per_revolution + len(passed.accumulators) - 1
            reason = ended_in(passed.reason, n_done + 1)
            break
        energies += taken.energies
        at += length
        n_done = at // per_revolution
        if not drive.lowest < spin.speed < fastest.spin:
            end = TOO_SLOW if spin.speed <= drive.lowest else TOO_FAST
            break
        if pieces_per_revolution is None and 4.0 * taken.lag <= DRIVEN_LAG:
            length *= 2
    gathered.sum_up()
    if n_done == 0 and not reason:
        problem = "falls" if end == TOO_SLOW else "rises"
        limit = (drive.lowest if end == TOO_SLOW else fastest.spin) * 30.0 / math.pi
        raise InputError(
            f"[drive] start: the spin {problem} to {limit:.4g} rpm within the first revolution; "
            "give it more inertia, or less torque"
        )
    lasts = np.diff(begins[: n_done + 1])
    n_sample = n_done * per_revolution
    ends = np.unique(np.minimum(cuts, n_sample))
    bring_to_angles(whole[:, :n_sample], np.array(swings[: ends.size - 1]), ends, model.n_place)
    return DrivenRun(
        reason=reason,
        whole=whole[:, :n_sample],
        speed=2.0 * np.pi / lasts,
        time=begins[:n_done],
        contact_fraction=gathered.contact_time[:n_done] / lasts[:, np.newaxis],
        peak_contact_force=gathered.peak_force[:n_done],
        friction_work=gathered.friction_work[:n_done],
        together=gathered.together,
        n_step=n_step,
        final=spin.state,
        drive_work=driven_by[:n_done],
        braking_torque=braked[:n_done] / lasts,
        energy_residual=_residual(energies),
        end=end,
        last_speed=spin.speed,
    )


def _fitting(length: int, at: int, end: int, per_revolution: int) -> int:
    """The longest piece up to `length` samples that begins at a sample and ends where such pieces do."""
    length = min(length, LONGEST_PIECE * per_revolution)
    while length > per_revolution and (at % per_revolution or at + length > end):
        length //= 2
    while length <= per_revolution and at % length:
        length //= 2
    return length


def _residual(energies: Floats) -> float:
    """Residual of the balance of energies (6,), J, over the exchanged energy."""
    spin, motion, drive, friction, damping, impacts = energies.tolist()
    flows = abs(drive) + abs(friction) + abs(damping) + abs(impacts)
    exchanged = max(0.5 * (flows + abs(spin) + abs(motion)), LEAST_EXCHANGE * abs(spin), np.finfo(float).tiny)
    return float(abs(spin + motion - drive + friction + damping + impacts) / exchanged)
