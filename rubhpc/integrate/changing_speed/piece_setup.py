"""The set-ups of the pieces of a run-up: matrices held over a range of speeds, tables tuned to each piece."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from rubhpc.fem.assemble import model_at
from rubhpc.fem.free_spin import unit_rotation
from rubhpc.fem.statics import sag_under
from rubhpc.integrate.changing_speed.held_matrices import WIDEST, WIDEST_TABULATED, held_range
from rubhpc.integrate.changing_speed.retuned_laws import RetunedFrictionLibrary, RetunedPenaltyLibrary
from rubhpc.integrate.changing_speed.retuned_modes import RetunedLibrary
from rubhpc.integrate.changing_speed.retuned_soft_friction import RetunedSoftFrictionLibrary
from rubhpc.integrate.packing import whole_system
from rubhpc.integrate.reduced_model.contact_mode import KeptParts
from rubhpc.integrate.reduced_model.penalty_mode import Penalty
from rubhpc.integrate.reduced_model.reduction import directions
from rubhpc.integrate.setup import ModalSetup

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.reduced_model.contact_mode import Solved
    from rubhpc.integrate.reduced_model.friction_mode import FrictionPairs
    from rubhpc.integrate.reduced_model.mode_library import ModeLibrary
    from rubhpc.integrate.reduced_model.reduction import ReducedModel
    from rubhpc.kernels.contact_modes import Reduced

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]

R = TypeVar("R", bound=RetunedLibrary)
D = TypeVar("D")
SPEED_STEP = 1e-3  # relative, over which the change of the matrices with the speed is taken
LONGEST_FALL = 1.0 / 3.0  # half of the range over the first speed of a coast-down, which stays above 0
MOST_HELD = 4  # matrices kept, of a spin that swings between them


class HeldMatrices:
    """Matrices at a speed, rad/s, and an acceleration, rad/s^2, and what has been solved of them."""

    template: PieceSetup  # of which a piece has another speed

    def __init__(
        self,
        model: Model,
        reduced: ReducedModel,
        phasor: Complexes,
        acceleration: float,
        reach: tuple[float, float],
        sample_level: int,
    ) -> None:
        self.model, self.reduced = model, reduced
        self.twist = self.lean = np.zeros(model.sag.size)  # sag under 1 N m of a drive; under 1 rad/s^2
        self.kept = KeptParts()
        self.bodies: dict[float, Reduced] = {}  # of each friction, but for what a piece changes
        self.sample_level = sample_level  # of the lowest speed
        self._phasor, self._reach, self._acceleration = phasor, reach, acceleration
        self._libraries: dict[tuple[str, float], RetunedLibrary] = {}
        self._pairs: dict[float, FrictionPairs] = {}
        self.first: tuple[tuple[float, ...], PieceSetup] | None = None  # of a case, and what it is of

    def serve(self, speed: float, acceleration: float) -> bool:
        """Whether a piece may use them."""
        far, changed = self._reach
        return abs(speed - self.reduced.spin) <= far and abs(acceleration - self._acceleration) <= changed

    def driven(self, torque: float, acceleration: float) -> Model:
        """The model with the sag under a drive's torque, N m, at an acceleration, rad/s^2."""
        moved = torque * self.twist + acceleration * self.lean
        return _sagging(self.model, self.model.sag + moved)

    def tuned(
        self, kind: type[R], piece: PieceSetup, friction: float, make: Callable[[], dict[str, Any]]
    ) -> R:
        """Contact modes of a friction, tuned to a piece; `make` gives what this kind of library asks for."""
        key = kind.__name__, friction
        if key not in self._libraries:
            if any(known != friction for _, known in self._libraries):  # of earlier cases
                self._libraries.clear()
            self._libraries[key] = kind(
                self.reduced,
                self.model,
                friction,
                phasor=self._phasor,
                known=self.kept,
                tick=piece.tick,
                sample_level=piece.sample_level,
                n_level=piece.n_level,
                **make(),
            )
        library = self._libraries[key]
        assert isinstance(library, kind)
        library.tune(piece.spin, piece.factor, piece.tick)
        return library

    def pairs(self, friction: float, make: Callable[[float], FrictionPairs]) -> FrictionPairs:
        """The pairs of a friction, with the rims at the speed of some piece."""
        if friction not in self._pairs:
            self._pairs[friction] = make(friction)
        return self._pairs[friction]


# Of each set-up, the matrices by speed and acceleration, the latest last: other cases may have them too.
_KNOWN: WeakKeyDictionary[ModalSetup, dict[tuple[float, float], HeldMatrices]] = WeakKeyDictionary()


@dataclass(frozen=True, kw_only=True, eq=False)
class PieceSetup(ModalSetup):
    """A set-up at the speed of a piece, whose matrices are those of other pieces too."""

    held: HeldMatrices
    factor: complex  # 1/s^2, by which the unbalance at unit speed acts
    most_energy: float  # J, beyond which the motion has diverged, at the highest speed

    @cached_property
    def energy_limit(self) -> float:
        """Mechanical energy, J, beyond which a motion has diverged."""
        return self.most_energy

    @cached_property
    def sample_level(self) -> int:
        """2^sample_level ticks are the interval of samples, at all speeds of the same matrices."""
        return self.held.sample_level

    @property
    def n_level(self) -> int:
        """Levels for which exponentials are tabulated."""
        return self._n_level

    @property
    def _known_of_ring(self) -> Solved:
        return self.held.kept

    @cached_property
    def _known(self) -> Solved:
        return self.held.kept

    def bodies(self, friction: float, clearance: Floats) -> Reduced:
        """The reduced bodies of a case as kernels take them; clearance (q,), m."""
        known = self.held.bodies
        if friction not in known:
            known[friction] = super().bodies(friction, clearance)
        of_pieces = known[friction]
        return of_pieces._replace(
            force_cosine=self.reduced.force[0].copy(),
            force_sine=self.reduced.force[1].copy(),
            rim_speed=of_pieces.radius * abs(self.spin),
            clearance=clearance,
        )

    def library(self, friction: float) -> ModeLibrary:
        """Contact modes of a friction, which serve until another piece asks for them."""
        return self.held.tuned(RetunedLibrary, self, friction, dict)

    def penalty_library(self, friction: float) -> ModeLibrary:
        """The same under a penalty."""

        def penalty() -> dict[str, Any]:
            gap_jacobian, force_direction, _ = directions(self.held.reduced, self.held.model, friction)
            law = self.law
            return {"penalty": Penalty(law.stiffness, law.damping, gap_jacobian, force_direction)}

        return self.held.tuned(RetunedPenaltyLibrary, self, friction, penalty)

    def friction_pairs(self, friction: float) -> FrictionPairs:
        """The pairs of a friction."""
        pairs = self.held.pairs(friction, super().friction_pairs)
        radius = np.array([stator.radius for stator in self.model.stators])
        return _with(pairs, rim_speed=radius * abs(self.spin))

    def friction_library(self, friction: float) -> ModeLibrary:
        """Contact modes of a friction whose slip may turn."""

        def pairs() -> dict[str, Any]:
            radius = np.array([stator.radius for stator in self.model.stators])
            rim_speed = radius * abs(self.held.reduced.spin)
            return {"pairs": replace(self.friction_pairs(friction), rim_speed=rim_speed)}

        kind = RetunedSoftFrictionLibrary if self.law.stiffness else RetunedFrictionLibrary
        return self.held.tuned(kind, self, friction, pairs)


class Pieces:
    """The set-ups of the pieces of a run-up, from that at its highest speed, which keeps the most modes.

    Where the spin is free (`ModalSetup.free_spin`), the drive's torque twists the shaft, not its
    acceleration, and `phi'' G u / 2` takes the place of `phi'' G u`, as Lagrange's equations have it.
    """

    def __init__(self, fastest: ModalSetup) -> None:
        self._fastest = fastest
        self._basis = fastest.reduced.basis
        self._held: list[HeldMatrices] = []  # the latest first
        model = fastest.model
        rotor = model.rotor
        self._inertia = rotor.mass @ unit_rotation(rotor)
        n, n_all = rotor.n_dof, model.body_start[-1]
        momentum = np.zeros((n_all, n_all))
        momentum[:n, :n] = rotor.gyroscopic if fastest.free_spin is None else 0.5 * rotor.gyroscopic
        self._momentum = self._basis.T @ momentum @ self._basis
        phasor = (model.unbalance_cosine - 1j * model.unbalance_sine) @ self._basis[:n]
        self._phasor = phasor.astype(np.complex128)

    def setup(
        self, speed: float, acceleration: float, angle: float, duration: float, torque: float = 0.0
    ) -> PieceSetup:
        """The set-up of a piece: mean speed (rad/s), acceleration (rad/s^2), first angle, duration (s).

        `torque` (N m) is that of the drive of a free spin.
        """
        held, fastest = self._find(speed, acceleration), self._fastest
        asked = speed, acceleration, duration, torque
        if angle == 0.0 and held.first is not None and held.first[0] == asked:
            return held.first[1]
        lag = acceleration * duration**2 / 12.0
        factor = (speed**2 - 1j * acceleration) * cmath.exp(1j * (angle - lag))
        phasor = self._phasor * factor
        force = np.empty((2, phasor.size))
        force[0], force[1] = phasor.real, -phasor.imag
        model = held.model if fastest.free_spin is None else held.driven(torque, acceleration)
        interval = 2.0 * math.pi / (abs(speed) * fastest.samples_per_revolution)
        found = _with(
            held.template,
            model=model,
            reduced=_with(held.reduced, spin=speed, force=force),
            spin=speed,
            interval=interval,
            tick=interval / (1 << held.sample_level),
            factor=factor,
            _curved_libraries={},  # which are of this speed alone
            _open_tables={},
        )
        if angle == 0.0:
            held.first = asked, found
        return found

    def _find(self, speed: float, acceleration: float) -> HeldMatrices:
        """Matrices that may be held at a speed and an acceleration."""
        for i, held in enumerate(self._held):
            if held.serve(speed, acceleration):
                if i:
                    self._held.insert(0, self._held.pop(i))
                return held
        known = _KNOWN.setdefault(self._fastest, {})
        found = known.pop((speed, acceleration), None) or self._hold(speed, acceleration)
        known[speed, acceleration] = found
        if len(known) > MOST_HELD:
            del known[next(iter(known))]
        self._held = [found, *self._held[: MOST_HELD - 1]]
        return found

    def _hold(self, speed: float, acceleration: float) -> HeldMatrices:
        """Matrices for a speed at the near end of the range over which they may be held.

        That of a free spin, which may turn back, is in the middle of the range.
        """
        fastest, free = self._fastest, self._fastest.free_spin
        model, damping, stiffness = self._matrices(speed, acceleration)
        _, next_damping, next_stiffness = self._matrices(speed * (1.0 + SPEED_STEP), acceleration)
        step = SPEED_STEP * speed
        drift = (next_stiffness - stiffness) / step, (next_damping - damping) / step
        reach, swing = held_range(
            stiffness,
            damping,
            drift,
            speed,
            acceleration,
            accuracy=fastest.accuracy,
            momentum=self._momentum,
            widest=WIDEST_TABULATED if fastest.model.rotor.tabulated_speeds else WIDEST,
        )
        if free is None:
            if acceleration > 0.0:  # no farther than the law goes
                reach = min(reach, max(0.5 * (fastest.spin - speed), 0.0))
            else:
                reach = min(reach, LONGEST_FALL * speed)
            speed += np.sign(acceleration) * reach
            model, damping, stiffness = self._matrices(speed, acceleration)
            model = _sagging(model, sag_under(model.rotor, model.load - acceleration * self._inertia))
        else:
            model = _sagging(model, sag_under(model.rotor, model.load))
        phasor = self._phasor * speed**2
        reduced = replace(
            fastest.reduced,
            spin=speed,
            stiffness=stiffness,
            damping=damping,
            force=np.stack([phasor.real, -phasor.imag]),
        )
        for name in ("translations", "project"):  # which need no computing anew
            reduced.__dict__[name] = getattr(fastest.reduced, name)
        near_end = reach * (1.0 + 1e-9)  # rounding apart
        slowest = replace(fastest, spin=abs(speed) - reach)
        ranges = near_end, swing
        held = HeldMatrices(model, reduced, self._phasor, acceleration, ranges, slowest.sample_level)
        held.template = PieceSetup(
            scheme=fastest.scheme,
            model=model,
            reduced=reduced,
            spin=speed,
            step=fastest.step,
            contact_step=fastest.contact_step,
            samples_per_revolution=fastest.samples_per_revolution,
            is_updated=fastest.is_updated,
            law=fastest.law,
            accuracy=fastest.accuracy,
            displacement_limit=fastest.displacement_limit,
            held=held,
            factor=complex(speed**2),
            most_energy=fastest.energy_limit,
        )
        for name in ("energy_limit", "sample_level"):  # for `_with`, which takes them along
            getattr(held.template, name)
        if free is not None:
            held.twist = sag_under(model.rotor, -free.share)
            held.lean = sag_under(model.rotor, -0.5 * model.rotor.gyroscopic @ model.sag)
        return held

    def _matrices(self, speed: float, acceleration: float) -> tuple[Model, Floats, Floats]:
        """The model at a speed, within the tables of its bearings, its damping and its stiffness."""
        model = self._fastest.model
        if speeds := model.rotor.tabulated_speeds:
            model = model_at(model, float(np.clip(speed, speeds[0], speeds[-1])))
        _, damping, stiffness, _ = whole_system(model, speed)
        stiffness = self._basis.T @ stiffness @ self._basis + acceleration * self._momentum
        return model, self._basis.T @ damping @ self._basis, stiffness


def _with(instance: D, **values: Any) -> D:
    """The same with other values, and with what has been computed of it: `replace` at a tenth of its time."""
    other = object.__new__(type(instance))
    other.__dict__.update(instance.__dict__, **values)
    return other


def _sagging(model: Model, sag: Floats) -> Model:
    """A model about another sag of its rotor, (n_rotor_dof,)."""
    if model.probe is not None:
        constant = model.probe_rows[0][:, : sag.size] @ sag
        model = replace(model, probe=replace(model.probe, constant=constant))
    return replace(model, sag=sag)
