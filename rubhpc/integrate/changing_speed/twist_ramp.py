"""A sag that changes linearly: the twist under a drive's torque in a piece, that by bearings in a block."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.marches.modal import Place
from rubhpc.integrate.measuring.samples import probe_part
from rubhpc.integrate.record import State

if TYPE_CHECKING:
    from rubhpc.integrate.changing_speed.piece_setup import PieceSetup, RangeMatrices

Floats = NDArray[np.float64]


class TwistRamp(NamedTuple):
    """Change of the rotor's sag within a piece; the sag of its set-up is that in its middle.

    The motion of a piece is about this sag. A linear ramp has no inertia force, so that the motion about it
    follows the same equations, except for the damping force of its rate, which is omitted.
    """

    half: Floats  # (n_rotor_dof,), from the middle of the piece to its end, m and rad
    rate: Floats  # (n_rotor_dof,), m/s and rad/s
    constant: Floats | None = None  # (n_probe,), the half as probes see it; None: by rows that do not change

    def with_sag(self, other: TwistRamp, setup: PieceSetup) -> TwistRamp:
        """The sum of it and of a change by bearings."""
        constant = None
        if other.constant is not None:
            constant = other.constant + setup.model.probe_rows[0][:, : self.half.size] @ self.half
        return TwistRamp(self.half + other.half, self.rate + other.rate, constant)

    @property
    def moves(self) -> bool:
        """Whether the sag moves at all."""
        return bool(self.half.any() or self.rate.any())

    def about_middle(self, begun: State | Place, setup: PieceSetup) -> State | Place:
        """The motion with which a piece begins, about the sag of its middle, from that of the rotor."""
        return moved(begun, setup, self.half, -self.rate) if self.moves else begun

    def of_rotor(self, begun: State | Place, setup: PieceSetup) -> State | Place:
        """The motion of the rotor, from one about the sag at the beginning of the piece."""
        return moved(begun, setup, -self.half, self.rate)

    def after(self, end: Place, setup: PieceSetup) -> Place:
        """The motion of the rotor where a piece ends, from that about the sag of its middle."""
        reached = moved(end, setup, self.half, self.rate) if self.moves else end
        assert isinstance(reached, Place)
        return reached

    def lift(self, whole: Floats, setup: PieceSetup) -> None:
        """Count the samples of a piece (`Samples.whole`) from the shaft without loads."""
        if not self.moves:
            return
        model, n_sample = setup.model, whole.shape[1]
        share = 2.0 * np.arange(n_sample) / n_sample - 1.0  # of the half, at each sample
        n = self.half.size
        whole[:3] += np.outer(replace(model, sag=self.half).output_sag, share)
        positions, rates, _ = model.probe_rows[:, :, :n]
        seen = positions @ self.half if self.constant is None else self.constant
        whole[probe_part(model)] += np.outer(seen, share) + (rates @ self.rate)[:, np.newaxis]


def sag_ramp(
    matrices: RangeMatrices, acceleration: float, first: float, last: float, duration: float
) -> TwistRamp:
    """How bearings that follow the speed move the sag from the first speed to the last one, rad/s."""
    begin, end = (matrices.sagging(0.0, acceleration, speed) for speed in (first, last))
    half = 0.5 * (end.sag - begin.sag)
    constant = 0.5 * (end.probe.constant - begin.probe.constant) if begin.probe and end.probe else None
    return TwistRamp(half, 2.0 / duration * half, constant)


def moved(motion: State | Place, setup: PieceSetup, displacement: Floats, velocity: Floats) -> State | Place:
    """The same with other displacements and velocities of the rotor, (n_rotor_dof,) more."""
    if isinstance(motion, State):
        return replace(
            motion,
            rotor_displacement=motion.rotor_displacement + displacement,
            rotor_velocity=motion.rotor_velocity + velocity,
        )
    reduced = motion.motion.copy()
    n = reduced.size // 2
    reduced[n:] += setup.reduced.project[:, : velocity.size] @ velocity
    return motion._replace(motion=reduced, sag=motion.sag + displacement)
