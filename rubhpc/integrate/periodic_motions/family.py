"""Cases that differ in one parameter: motions transferred between them, derivatives by the parameter."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble, model_at
from rubhpc.fem.response import contact_free_amplitude, first_lateral_frequency
from rubhpc.integrate.marches.case_modes import NoClosedForm
from rubhpc.integrate.modal_setup import ModalSetup
from rubhpc.integrate.packing import law_of
from rubhpc.integrate.periodic_motions.collocated_motion import followed_motion
from rubhpc.integrate.periodic_motions.piecewise_motion import Unfollowed
from rubhpc.integrate.record import State
from rubhpc.integrate.reduced_model.reduction import AlongSpeeds, reduce_to
from rubhpc.integrate.reduced_model.truncation import Touch, at_standstill, completed, kept_modes, touch_of
from rubhpc.integrate.setup import prepare
from rubhpc.rig.reading import with_keys
from rubhpc.rig.stators import gap_problem

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.periodic_motions.collocated_motion import CollocatedMotion
    from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
    from rubhpc.integrate.reduced_model.reduction import ReducedModel
    from rubhpc.rig.rig import Rig
    from rubhpc.study.contact_keys import Contact
    from rubhpc.study.tables import Integrator

    Floats = NDArray[np.float64]
    Motion = PiecewiseMotion | CollocatedMotion

SPEEDS, CLEARANCES = ("speed_ratio", "speed"), ("clearance_ratio", "clearance")
MOST_KEPT = 6  # models and set-ups that are kept, and cases in any case
ROOM = 256_000_000  # bytes of the tables of further ones
ACCURACY = 1e-6  # of forces by collocation: multipliers come about as near


@dataclass(frozen=True, kw_only=True, eq=False)
class Operation:
    """Operation of a rig: one of the two speeds and one of the two clearances is None."""

    rig: Rig
    speed_ratio: float | None = None
    speed: float | None = None  # rad/s
    clearance_ratio: float | None = None
    clearance: float | None = None  # m
    friction: float
    contact: Contact
    integrator: Integrator
    samples_per_revolution: int

    def at(self, along: str, value: float) -> Operation:
        """The same with another value of a parameter."""
        if along in SPEEDS:
            return replace(self, speed_ratio=None, speed=None).having(along, value)
        if along in CLEARANCES:
            return replace(self, clearance_ratio=None, clearance=None).having(along, value)
        if along == "friction":
            return replace(self, friction=value)
        return replace(self, rig=with_keys(self.rig, {along: value}))

    def having(self, name: str, value: float) -> Operation:
        """The same with another number."""
        changed: dict[str, Any] = {name: value}
        return replace(self, **changed)


class Family:
    """Cases along one parameter.

    Parameters
    ----------
    along : str
        speed_ratio, speed, clearance_ratio, clearance, friction or a key of the rig.
    ends : (2,)
        Of the range of the parameter; the smallest change of interest is small compared with it.

    Attributes
    ----------
    span : float
        Of the range.
    """

    def __init__(self, operation: Operation, along: str, ends: tuple[float, float]) -> None:
        """Set the case that is varied."""
        self.along, self.span = along, abs(ends[1] - ends[0])
        self._operation, self._ends = operation, ends
        self._speeds: AlongSpeeds | None = None
        self._kept: list[NDArray[np.bool_]] = []  # modes kept at either end of the range
        self._models: OrderedDict[int, tuple[Rig, Model]] = OrderedDict()
        self._frequency: tuple[Model, float] | None = None
        self._setups: OrderedDict[tuple[int, float, bool], ModalSetup] = OrderedDict()
        self._cases: OrderedDict[float, Motion] = OrderedDict()

    def at(self, value: float) -> Motion:
        """The case at a value of the parameter.

        Raises
        ------
        Unfollowed
            It cannot be followed.
        InputError
            The case does not exist.
        """
        if value not in self._cases:
            setup, clearance, friction = self.settings(value, is_measured=self.along not in SPEEDS)
            try:
                begin = followed_motion(setup.scheme, ACCURACY)
                found = begin(setup, clearance, friction, State.at_rest(setup.model))
            except NoClosedForm:
                raise Unfollowed("contacts open and close without end, or in too many combinations") from None
            self._cases[value] = found
            self._make_room()
        self._cases.move_to_end(value)
        return self._cases[value]

    def settings(self, value: float, *, is_measured: bool = True) -> tuple[ModalSetup, float, float]:
        """Set-up, clearance (m) and friction at a value; to record, or only to follow."""
        case = self._operation.at(self.along, value)
        model = self._model(case.rig)
        spin = self._spin(case, model)
        clearance = case.clearance
        if clearance is None:
            assert case.clearance_ratio is not None
            clearance = case.clearance_ratio * contact_free_amplitude(model, spin)
        if problem := gap_problem(case.rig.stator, clearance, is_ratio=case.clearance is None):
            raise InputError(f"{self.along}: {value:g}: {problem}")
        return self._setup(case, model, spin, is_measured), clearance, case.friction

    def carry(self, motion: Floats, before: Motion, after: Motion) -> Floats:
        """A motion (2 n,) of one case in the coordinates of another."""
        old, new = before.setup, after.setup
        if old.reduced.basis is new.reduced.basis or (
            np.array_equal(old.reduced.basis, new.reduced.basis)
            and np.array_equal(old.model.sag, new.model.sag)
        ):
            return motion
        if old.reduced.basis.shape[0] != new.reduced.basis.shape[0]:
            raise InputError(
                f"{self.along}: changes the number of degrees of freedom, so one motion cannot start the next"
            )
        displacement, velocity = old.reduced.basis @ motion.reshape(2, -1)[:, :, None]
        shift = np.zeros_like(displacement)
        shift[: old.model.sag.size, 0] = old.model.sag - new.model.sag
        project = new.reduced.project
        return np.concatenate([project @ (displacement + shift), project @ velocity])[:, 0]

    def derivative(
        self,
        value: float,
        motion: Floats,
        states: int,
        revolutions: list[Any],
        phase: float,
        step: float | None = None,
    ) -> tuple[Floats, list[Any]]:
        """Derivative (2 n,) by the parameter of the residual of a period, at a fixed beginning.

        It is the difference of two flow maps over a step; those of the second are returned with it.
        """
        here = self.at(value)
        step = here.tolerances.difference * self.span if step is None else step
        there = self.at(value + step)
        begun = self.carry(motion, here, there)
        followed = there.follow(begun, states, len(revolutions), phase=phase)
        defect = self.carry(followed[-1].end, there, here) - self.carry(begun, there, here)
        return (defect - (revolutions[-1].end - motion)) / step, followed

    def _make_room(self) -> None:
        """Give up the cases that have not been used for longest, unless there are few, or room for them."""
        room = ROOM - sum(case.nbytes for case in self._cases.values())  # they grow while they are used
        while room < 0 and len(self._cases) > MOST_KEPT:
            case = self._cases.popitem(last=False)[1]
            room += case.nbytes
            if self.along == "friction":  # contact modes of one friction in a shared set-up
                case.setup.forget(float(case.bodies.friction[0]))

    def _spin(self, case: Operation, model: Model) -> float:
        """Speed of a case, rad/s."""
        if case.speed is not None:
            return case.speed
        assert case.speed_ratio is not None
        return case.speed_ratio * self._first_frequency(model)

    def _first_frequency(self, model: Model) -> float:
        """Lowest lateral natural frequency of a model, rad/s, found once."""
        if self._frequency is None or self._frequency[0] is not model:
            self._frequency = model, first_lateral_frequency(model)
        return self._frequency[1]

    def _model(self, rig: Rig) -> Model:
        if id(rig) not in self._models:
            self._models[id(rig)] = rig, assemble(rig)
            if len(self._models) > MOST_KEPT:
                self._models.popitem(last=False)
        return self._models[id(rig)][1]

    def _reduced(self, model: Model, spin: float) -> ReducedModel | None:
        """A model with the modes of the whole range; None for a single model at one speed.

        Where only its speed changes, it has the same coordinates everywhere.
        """
        integrator = self._operation.integrator
        if self.along in (*CLEARANCES, "friction") or integrator.method != "modal":
            return None
        if self.along not in SPEEDS or model.rotor.by_speed is not None:
            self._kept = self._kept or self._kept_at_ends()
            model = model_at(model, spin)
            parts = at_standstill(model).parts
            if [part.frequency.size for part in parts] != [of.size for of in self._kept]:
                return None  # its coupling differs
            are_kept = [completed(part, of) for part, of in zip(parts, self._kept, strict=True)]
            return reduce_to(model, spin, integrator.accuracy, are_kept)
        if self._speeds is None:
            spins = [self._spin(self._operation.at(self.along, end), model) for end in self._ends]
            self._speeds = AlongSpeeds(model, spins, integrator.accuracy, self._touch(model))
        return self._speeds.at(spin)

    def _kept_at_ends(self) -> list[NDArray[np.bool_]]:
        """Modes of each part that either end of the range keeps."""
        ends = []
        for end in self._ends:
            case = self._operation.at(self.along, end)
            model = self._model(case.rig)
            spin = self._spin(case, model)
            model = model_at(model, spin)
            ends.append(kept_modes(model, spin, self._operation.integrator.accuracy, self._touch(model)))
        if [of.size for of in ends[0]] != [of.size for of in ends[1]]:
            return ends[0]
        return [one | other for one, other in zip(*ends, strict=True)]

    def _touch(self, model: Model) -> Touch:
        contact = self._operation.contact
        return touch_of(model, law_of(contact), is_updated=contact.normal == "updated")

    def _setup(self, case: Operation, model: Model, spin: float, is_measured: bool) -> ModalSetup:
        key = id(case.rig), spin, is_measured
        if key not in self._setups:
            setup = prepare(
                case.rig,
                spin,
                contact=case.contact,
                integrator=case.integrator,
                samples_per_revolution=case.samples_per_revolution,
                model=model,
                reduced=self._reduced(model, spin),
                is_measured=is_measured,
            )
            if not isinstance(setup, ModalSetup):
                raise InputError(f'{self.along}: branches need [integrator] method = "modal"')
            self._setups[key] = setup
            if len(self._setups) > MOST_KEPT:
                self._setups.popitem(last=False)
        return self._setups[key]
