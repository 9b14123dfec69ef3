"""The set-ups of the pieces of a run-up: matrices of a range of speeds, tables tuned to each piece."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from rubhpc.fem.probes import probes_at, seen_at_rest
from rubhpc.fem.statics import at_rest_under
from rubhpc.integrate.changing_speed.mode_courses import between
from rubhpc.integrate.changing_speed.range_library import RangeLibrary, TableBuffer
from rubhpc.integrate.modal_setup import ModalSetup
from rubhpc.integrate.reduced_model.flight_modes import FlightModes, motion_rows
from rubhpc.integrate.reduced_model.reduction import reduced_sag

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.reduced_model.mode_library import ModeLibrary
    from rubhpc.integrate.reduced_model.reduction import ReducedModel
    from rubhpc.kernels.closed_form.filling import Speeds
    from rubhpc.kernels.contact_modes import Reduced

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]

D = TypeVar("D")

CORRECTIONS = 2  # of coordinates in interpolated modes


class RangeMatrices:
    """Matrices at a speed, rad/s, and an acceleration, rad/s^2, with their solved contact modes.

    `momentum` (n, n) is the change of the stiffness with the acceleration, per rad/s^2. `beside` are the
    model and its matrices at other speeds of the range (`mode_courses.NODES`), through which they follow
    the speed; none where they are constant.
    """

    template: PieceSetup  # set-up to copy for the speed of a piece
    is_balanced = True  # whether energies are requested

    def __init__(
        self,
        model: Model,
        reduced: ReducedModel,
        phasor: Complexes,
        momentum: Floats,
        acceleration: float,
        slope: float,
        reach: tuple[float, float],
        sample_level: int,
        buffers: dict[tuple[object, ...], TableBuffer],
        beside: Sequence[tuple[Model, ReducedModel]] = (),
    ) -> None:
        self._buffers, self._beside = buffers, beside
        self.model, self.reduced = model, reduced
        self.twist = self.lean = np.zeros(model.sag.size)  # sag under 1 N m of a drive; under 1 rad/s^2
        self.slope = np.zeros(model.sag.size)  # change of the sag with the speed
        self.sagging_models: list[Model] = []  # at `mode_courses.NODES`, where the sag depends on the speed
        self.bodies: dict[float, Reduced] = {}  # of each friction, without what a piece changes
        self.sample_level = sample_level  # of the lowest speed
        self.acceleration, self.momentum = acceleration, momentum
        self._phasor, self._reach = phasor, reach
        self._slope = slope  # N m s, of a drive's torque over the speed
        self._libraries: dict[float, RangeLibrary] = {}
        self._latest: tuple[tuple[float, ...], Model] | None = None  # by request
        self.first: tuple[tuple[float, ...], object] | None = None  # block of a case, by what was asked

    @property
    def n_byte(self) -> int:
        """Memory of the tables of contact modes, bytes."""
        return sum(library.n_byte for library in self._libraries.values())

    def forget(self) -> None:
        """Free contact modes, which would wait for a garbage collection: libraries refer to this object."""
        self._libraries.clear()
        self.first = None

    def serve(self, speed: float, acceleration: float, slope: float = 0.0) -> bool:
        """Whether a piece may use them."""
        far, changed = self._reach
        if abs(speed - self.reduced.spin) > far or slope != self._slope:
            return False
        return abs(acceleration - self.acceleration) <= changed

    @property
    def reach(self) -> float:
        """Half of the range of speeds, rad/s."""
        return self._reach[0]

    @property
    def is_interpolated(self) -> bool:
        """Whether they follow the speed."""
        return bool(self._beside)

    def within(self, speed: float) -> float:
        """Place of a speed (rad/s) in the range, from -1 to 1."""
        return (speed - self.reduced.spin) / self.reach

    def at_place(self, within: float) -> ReducedModel:
        """The model at a place in the range; its unbalance is that of the middle."""
        if not self._beside:
            return self.reduced
        values = {name: between(nodes, within) for name, nodes in self._at_nodes.items()}
        return with_values(self.reduced, **values)

    @cached_property
    def local_motions(self) -> Floats:
        """Local motions of each pair, which do not follow the speed."""
        return motion_rows(self.reduced, self.model, self.template.accuracy)

    @cached_property
    def _at_nodes(self) -> dict[str, list[Floats]]:
        """Arrays of the model that depend on the speed, at `mode_courses.NODES`."""
        nodes = [self.reduced, *(reduced for _, reduced in self._beside)]
        return {name: [getattr(node, name) for node in nodes] for name in ("stiffness", "damping", "probe")}

    def sagging(self, torque: float, acceleration: float, speed: float) -> Model:
        """The model with the sag under a drive's torque, N m, at an acceleration and a speed, rad/s."""
        models = self.sagging_models or [self.model]
        is_moving = self.sagging_models or self.model.film is not None
        within = self.within(speed) if is_moving else 0.0
        asked = torque, acceleration, within
        if self._latest is None or self._latest[0] != asked:
            sag, film, rows = models[0].sag, models[0].film, models[0].probe_rows[0]
            if within and film is None:
                sag = between([model.sag for model in models], within)
                if self.model.rotor.softness:  # which bends over the speed, metres wide
                    sag = reduced_sag(self.model, self.at_place(within))
                rows = between([model.probe_rows[0] for model in models], within)
            elif within:  # positions of journals may bend where no matrix does
                known = self.model.rotor.tabulated_speeds
                at, before = np.clip([speed, self.reduced.spin], known[0], known[-1]).tolist()
                sag, film = at_rest_under(self.model.rotor.at(at), self.model.load, at)
                rows = probes_at(self.model, at, before).probe_rows[0]
            sag = sag + torque * self.twist + acceleration * self.lean
            self._latest = asked, sagging(self.model, sag, film, rows)
        return self._latest[1]

    def tuned(self, piece: PieceSetup, friction: float) -> RangeLibrary:
        """Contact modes of a friction, tuned to a piece and valid until another one requests them."""
        if friction not in self._libraries:
            self._libraries.clear()  # of earlier cases
            self._libraries[friction] = RangeLibrary(
                self.reduced,
                self.model,
                friction,
                phasor=self._phasor,
                tick=piece.tick,
                sample_level=piece.sample_level,
                n_level=piece.n_level,
                reach=self.reach,
                buffers=self._buffers,
                beside=[reduced for _, reduced in self._beside],
                at_place=self.at_place,
                is_balanced=self.is_balanced,
            )
        library = self._libraries[friction]
        library.tune(piece.speeds, piece.place)
        return library


@dataclass(frozen=True, kw_only=True, eq=False)
class PieceSetup(ModalSetup):
    """A set-up at the speed of a piece, whose matrices are shared with other pieces."""

    matrices: RangeMatrices
    speeds: Speeds  # of this piece and of others that have the same matrices
    place: int  # of this piece among them
    most_energy: float  # J, beyond which the motion has diverged, at the highest speed

    @cached_property
    def energy_limit(self) -> float:
        """Mechanical energy, J, beyond which a motion has diverged."""
        return self.most_energy

    @cached_property
    def sample_level(self) -> int:
        """Samples are 2^sample_level ticks apart, at all speeds of the same matrices."""
        return self.matrices.sample_level

    @property
    def within(self) -> float:
        """Place of the speed in the range of the matrices, from -1 to 1."""
        return float(self.speeds.within[self.place])

    @property
    def has_energies(self) -> bool:
        """Whether energies are requested."""
        return self.matrices.is_balanced

    @property
    def local_motions(self) -> Floats:
        """Local motions of each pair, at all speeds of the same range."""
        return self.matrices.local_motions

    def goes_on_in(self, other: PieceSetup, acceleration: float, next_acceleration: float) -> bool:
        """Whether the next piece has matrices of the same range that follow the speed."""
        return (
            other.matrices is self.matrices
            and self.matrices.is_interpolated
            and next_acceleration == acceleration
        )

    def bodies(self, friction: float, clearance: Floats) -> Reduced:
        """The reduced bodies of a case for kernels; clearance (q,), m."""
        known = self.matrices.bodies
        made = known.get(friction)
        if made is None:
            of_range = super().bodies(friction, clearance)
            made = of_range._replace(
                force_cosine=of_range.force_cosine.copy(),
                force_sine=of_range.force_sine.copy(),
                stiffness=of_range.stiffness.copy(),
                damping=of_range.damping.copy(),
            )
        if friction not in known or made.clearance is not clearance:
            known[friction] = made._replace(clearance=clearance, overlap=self._overlap(made, clearance))
        of_pieces = known[friction]
        of_pieces.stiffness[:], of_pieces.damping[:] = self.reduced.stiffness, self.reduced.damping
        of_pieces.force_cosine[:], of_pieces.force_sine[:] = self.reduced.force
        np.multiply(of_pieces.radius, abs(self.spin), out=of_pieces.rim_speed)
        return of_pieces

    def _overlap(self, made: Reduced, clearance: Floats) -> float:
        """Overlap, m, that modes which follow the speed may leave as a pair opens, without an event."""
        if not self.matrices.is_interpolated:
            return made.overlap
        return max(made.overlap, float(self.accuracy * np.abs(clearance[: len(self.model.stators)]).min()))

    @property
    def flight_modes(self) -> FlightModes:
        """What the collocation integrator takes of the piece: modes at its speed."""
        found: FlightModes | None = vars(self).get("_flight_modes")
        if found is None or found.setup is not self:
            found = vars(self)["_flight_modes"] = self._solve_flight()
        return found

    def _solve_flight(self) -> FlightModes:
        library = self.matrices.tuned(self, 0.0)
        modes = library.eigenmodes(0, min(max(self.within, -1.0), 1.0))
        assert modes is not None
        turning, factor = complex(self.clock.growth, self.spin), complex(self.speeds.factor[self.place])
        return FlightModes(
            self,
            modes.exponent,
            _with_rates(modes.motion, modes.exponent),
            modes.enter,
            np.ones(modes.exponent.size, bool),
            turning,
            np.ones(1, dtype=np.int64),
            _with_rates(modes.response(turning, factor)[:, None], np.array([turning])),
            corrections=CORRECTIONS if self.matrices.is_interpolated else 0,
        )

    def library(self, friction: float) -> ModeLibrary:
        """Contact modes of a friction, tuned to the piece."""
        return self.matrices.tuned(self, friction)


def _with_rates(motion: Complexes, exponent: Complexes) -> Complexes:
    """Motions (2 n, m) whose velocities are the rates of their displacements; interpolated ones nearly are.

    In the shortest steps of collocation a force is found by displacements that it changes by 1e-15 m.
    """
    n = len(motion) // 2
    return np.concatenate([motion[:n], motion[:n] * exponent])


def with_values(instance: D, **values: Any) -> D:
    """A copy with other values that keeps cached properties: `replace` in a tenth of the time."""
    other = object.__new__(type(instance))
    other.__dict__.update(instance.__dict__, **values)
    return other


def sagging(model: Model, sag: Floats, film: Floats | None, rows: Floats | None = None) -> Model:
    """A model about another sag of its rotor, (n_rotor_dof,); `rows` are what probes see of displacements."""
    model = replace(model, sag=sag, film=film)
    if model.probe is not None:
        constant = seen_at_rest(model, model.probe.probes, model.probe_rows[0] if rows is None else rows)
        model = replace(model, probe=replace(model.probe, constant=constant))
    return model
