"""Matrices of ranges of speed and acceleration, for all pieces of a run-up that they serve."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary, ref

import numpy as np

from rubhpc.fem.free_spin import unit_rotation
from rubhpc.fem.probes import probes_at
from rubhpc.fem.statics import at_rest_under, sag_under
from rubhpc.integrate.changing_speed.interpolated_range import NARROWEST, interpolated_reach, rotor_of
from rubhpc.integrate.changing_speed.mode_courses import NODES
from rubhpc.integrate.changing_speed.piece_setup import PieceSetup, RangeMatrices, sagging
from rubhpc.integrate.changing_speed.range_library import speeds_of
from rubhpc.integrate.changing_speed.ripples import Linear
from rubhpc.integrate.packing import whole_system
from rubhpc.integrate.reduced_model.reduction import reduced_sag

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.changing_speed.range_library import TableBuffer
    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.reduced_model.reduction import ReducedModel

    Floats = NDArray[np.float64]

WIDEST = 0.5  # half of the range over the speed
WIDEST_TABULATED = 0.16  # the same where bearings follow a table, not a straight line
LONGEST_FALL = 1.0 / 3.0  # half of the range over the first speed of a coast-down, which stays above 0
DRIVEN_SHARE = 0.25  # of the accuracy, of modes of a driven rotor, whose twist errs most
SOFT_SHARE = 0.1  # the same of a rotor of little stiffness, which is metres away from its sag

_BUFFERS: WeakKeyDictionary[ModalSetup, dict[tuple[object, ...], TableBuffer]] = WeakKeyDictionary()


class SpeedRanges:
    """Matrices of a rotor whose speed changes, from its set-up at the highest speed.

    Where the spin is free (`ModalSetup.free_spin`), the drive's torque twists the shaft, not its
    acceleration, and `phi'' G u / 2` takes the place of `phi'' G u`, as Lagrange's equations have it.
    """

    def __init__(self, fastest: ModalSetup) -> None:
        self._of = ref(fastest)  # `Ripples`, which are kept by set-up, would keep it forever
        self._basis = fastest.reduced.basis
        model = fastest.model
        rotor = model.rotor
        self._inertia = rotor.mass @ unit_rotation(rotor)
        n, n_all = rotor.n_dof, model.body_start[-1]
        momentum = np.zeros((n_all, n_all))
        momentum[:n, :n] = rotor.gyroscopic if fastest.free_spin is None else 0.5 * rotor.gyroscopic
        self._momentum = self._basis.T @ momentum @ self._basis
        self._turning = np.zeros(self._basis.shape[1])  # of the driven end about the mean
        if fastest.free_spin is not None:
            self._turning = fastest.free_spin.share @ self._basis[:n]
        phasor = (model.unbalance_cosine - 1j * model.unbalance_sine) @ self._basis[:n]
        self.phasor = phasor.astype(np.complex128)

    @property
    def _fastest(self) -> ModalSetup:
        """The set-up at the highest speed, which `Pieces` hold."""
        fastest = self._of()
        assert fastest is not None
        return fastest

    def hold(
        self, speed: float, acceleration: float, slope: float, guess: float | None = None
    ) -> RangeMatrices:
        """Matrices of the range that begins at a speed.

        That of a free spin, which may turn back, is in the middle of the range. `guess` (rad/s) is half of
        the range tried first.
        """
        fastest, free = self._fastest, self._fastest.free_spin
        reach, swing = self._reach(speed, acceleration, slope, guess)
        if free is None:
            speed += np.sign(acceleration) * reach
        about = acceleration, slope, speed
        model, reduced = self._reduced(speed, *about)
        others = beside = [self._reduced(speed + place * reach, *about) for place in NODES[1:]]
        if all(np.array_equal(other.stiffness, reduced.stiffness) for _, other in beside) and all(
            np.array_equal(other.damping, reduced.damping) for _, other in beside
        ):
            beside = []  # nothing goes with the speed
        near_end = reach * (1.0 + 1e-9)  # rounding apart
        slowest = replace(fastest, spin=abs(speed) - reach)
        ranges = near_end, swing
        buffers = _BUFFERS.setdefault(fastest, {})
        at = acceleration, slope, ranges
        matrices = RangeMatrices(
            model, reduced, self.phasor, self._momentum, *at, slowest.sample_level, buffers, beside
        )
        matrices.is_balanced = free is not None
        if fastest.model.rotor.tabulated_speeds:
            matrices.sagging_models = [model, *(other for other, _ in others)]
        matrices.template = PieceSetup(
            scheme=fastest.scheme,
            model=model,
            reduced=reduced,
            spin=speed,
            step=fastest.step,
            samples_per_revolution=fastest.samples_per_revolution,
            is_updated=fastest.is_updated,
            law=fastest.law,
            accuracy=fastest.accuracy,
            displacement_limit=fastest.displacement_limit,
            matrices=matrices,
            speeds=speeds_of([speed], [complex(speed**2)], [0.0], [1.0], speed, matrices.sample_level),
            place=0,
            most_energy=fastest.energy_limit,
        )
        for name in ("energy_limit", "sample_level", "clock"):  # for `with_values`, which takes them along
            getattr(matrices.template, name)
        tilted = model.rotor.gyroscopic @ model.sag
        if free is not None:
            matrices.twist = sag_under(model.rotor, -free.share)
        force = -self._inertia - tilted if free is None else -0.5 * tilted
        if matrices.sagging_models:  # dampers act against the rate of the sag
            rotor, (_, below, above) = model.rotor, matrices.sagging_models
            matrices.slope = (above.sag - below.sag) / ((NODES[2] - NODES[1]) * reach)
            force = force - (rotor.damping + speed * rotor.gyroscopic) @ matrices.slope
        matrices.lean = sag_under(model.rotor, force)
        return matrices

    def linear(self, speed: float, *, is_whole: bool = False) -> Linear:
        """The rotor without contact at a speed, rad/s, as the output node and probes see it.

        `is_whole`: in all reduced degrees, not in those alone that unbalance moves.
        """
        model, damping, stiffness = self._matrices(speed, 0.0, 0.0)
        output = self._fastest.reduced.output[:2]
        of_output = np.stack([output, 0.0 * output, 0.0 * output])
        seen = np.concatenate([of_output, model.sensor_rows @ self._basis], axis=1)
        if is_whole:
            return Linear(stiffness, damping, self.phasor, seen)
        return Linear.of_moved(stiffness, damping, self.phasor, seen, speed)

    def _reduced(
        self, speed: float, acceleration: float, slope: float, of_force: float
    ) -> tuple[Model, ReducedModel]:
        """The model at a speed about its sag, and reduced, with spin and unbalance force of another speed."""
        fastest = self._fastest
        model, damping, stiffness = self._matrices(speed, acceleration, slope)
        model = sagging(model, *at_rest_under(model.rotor, model.load, self._tabulated(speed)))
        phasor = self.phasor * of_force**2
        reduced = replace(
            fastest.reduced,
            spin=of_force,
            stiffness=stiffness,
            damping=damping,
            force=np.stack([phasor.real, -phasor.imag]),
            probe=model.probe_rows @ self._basis,
        )
        for name in ("translations", "project"):  # which need not be computed again
            reduced.__dict__[name] = getattr(fastest.reduced, name)
        if model.rotor.softness:
            model = sagging(model, reduced_sag(model, reduced), model.film)
        return model, reduced

    def _reach(
        self, speed: float, acceleration: float, slope: float, guess: float | None
    ) -> tuple[float, float]:
        """Half of the range in which modes follow the speed, rad/s, and of accelerations, rad/s^2."""
        fastest = self._fastest
        model, is_free = fastest.model, fastest.free_spin is not None

        def matrices(at: float) -> tuple[Floats, Floats]:
            rotor = model.rotor.at(self._tabulated(at))  # whose sag is not asked for
            damping, stiffness = self._system(replace(model, rotor=rotor), at, acceleration, slope)
            return stiffness, damping

        seen, soft = self.linear(speed, is_whole=True).seen, model.rotor.softness
        return interpolated_reach(
            rotor_of(fastest, matrices, self.phasor, seen),
            speed,
            acceleration,
            self._momentum,
            self._widest(speed, acceleration),
            sense=0.0 if is_free else float(np.sign(acceleration)),
            accuracy=(SOFT_SHARE if soft else DRIVEN_SHARE if is_free else 1.0) * fastest.accuracy,
            guess=guess,
        )

    def _widest(self, speed: float, acceleration: float) -> float:
        """Half of the widest range from a speed on, rad/s, no farther than a law goes."""
        fastest = self._fastest
        widest = (WIDEST_TABULATED if fastest.model.rotor.tabulated_speeds else WIDEST) * speed
        if acceleration > 0.0 and fastest.free_spin is None:
            return min(widest, max(0.5 * (fastest.spin - speed), NARROWEST * speed))
        return min(widest, LONGEST_FALL * speed)

    def _matrices(self, speed: float, acceleration: float, slope: float) -> tuple[Model, Floats, Floats]:
        """The model at a speed, within the tables of its bearings, its damping and its stiffness.

        Its sag is that of the highest speed.

        A torque that falls with the speed damps how the driven end turns about the mean.
        """
        model = self._fastest.model
        if model.rotor.tabulated_speeds:
            known = self._tabulated(speed)
            model = replace(model, rotor=model.rotor.at(known))
            model = probes_at(model, known, self._fastest.spin)
        return model, *self._system(model, speed, acceleration, slope)

    def _tabulated(self, speed: float) -> float:
        """The speed, rad/s, or that of the tables of bearings which is nearest to it."""
        speeds = self._fastest.model.rotor.tabulated_speeds
        return float(np.clip(speed, speeds[0], speeds[-1])) if speeds else speed

    def _system(self, model: Model, speed: float, acceleration: float, slope: float) -> tuple[Floats, Floats]:
        """Damping and stiffness of a model, as of `_matrices`."""
        _, damping, stiffness, _ = whole_system(model, speed)
        damping = self._basis.T @ damping @ self._basis - slope * np.outer(self._turning, self._turning)
        return damping, self._basis.T @ stiffness @ self._basis + acceleration * self._momentum
