"""What the axes of a study amount to, case by case: rig, spin speed, clearance, free amplitude, steps."""

from __future__ import annotations

import itertools
import math
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.axes import CLEARANCE_AXES, SPEED_AXES
from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble
from rubhpc.fem.held import find_free
from rubhpc.fem.response import contact_free_amplitude, first_lateral_frequency, step_limit
from rubhpc.rig import with_keys

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.rig import Rig
    from rubhpc.study import Study

_EVENT_STEPS = 60  # that the modal scheme takes a revolution, samples apart
_TOUCHING = 0.15  # share of the time in contact, where it takes short steps there
_MOST_RIGS = 256  # asked for their step, 1 ms each; of more, the first stands for all

Index = tuple[int, ...]


class Settings:
    """Values on the axes, resolved: ratios to SI units, keys to rigs. What is costly is kept for reuse.

    Parameters
    ----------
    study : Study

    Raises
    ------
    InputError
        When the step asked for is above the stability limit of a rig, or nothing holds a rig that the modal
        scheme is to solve.
    """

    def __init__(self, study: Study) -> None:
        self.study = study
        self._values = [axis.values for axis in study.axes]
        names = [axis.name for axis in study.axes]
        self.speed_axis, self.clearance_axis, self._friction_axis = (
            next(i for i, name in enumerate(names) if name in ways)
            for ways in (SPEED_AXES, CLEARANCE_AXES, ("friction",))
        )
        self._is_speed_ratio = names[self.speed_axis] == "speed_ratio"
        self._is_clearance_ratio = names[self.clearance_axis] == "clearance_ratio"
        self.rig_axes = [i for i, axis in enumerate(study.axes) if axis.is_rig_key]
        self._rotor_axes = [i for i in self.rig_axes if names[i].startswith("rotor.")]
        # The contact-free response knows the rotor, and of the stators the node at which it is read.
        self._node_axes = [
            i for i in self.rig_axes if names[i].startswith("stator.") and names[i].endswith(".node")
        ]
        self._response_axes = sorted(self._rotor_axes + self._node_axes)
        self._rig_at = lru_cache(maxsize=256)(self._make_rig)
        self._model_at = lru_cache(maxsize=4)(self._make_model)
        self._unit_speed_at = lru_cache(maxsize=65536)(self._make_unit_speed)
        self._response_at = lru_cache(maxsize=65536)(self._make_response)
        self._limit_at = lru_cache(maxsize=4096)(self._make_limit)
        if study.integrator.step is not None and study.integrator.method == "central-difference":
            self._check_step(study.integrator.step)
        if study.integrator.method == "modal":
            self._check_held()

    def rig(self, index: Index) -> Rig:
        """Rig of a case."""
        return self._rig_at(tuple(index[i] for i in self.rig_axes))

    def response(self, index: Index) -> tuple[float, float]:
        """Spin speed (rad/s) and contact-free amplitude (m) of a case."""
        return self._response_at(tuple(index[i] for i in self._response_axes), index[self.speed_axis])

    def clearance(self, index: Index) -> float:
        """Radial clearance at rest of a case, m."""
        value = self._values[self.clearance_axis][index[self.clearance_axis]]
        return value * self.response(index)[1] if self._is_clearance_ratio else value

    def friction(self, index: Index) -> float:
        """Coefficient of friction of a case."""
        return self._values[self._friction_axis][index[self._friction_axis]]

    def arrays(self) -> dict[str, tuple[list[int], NDArray[np.float64]]]:
        """Return name -> (axes that set it, values along them, SI units), for all cases.

        `spin_speed` in rad/s, `clearance` and `contact_free_amplitude` in m.

        Raises
        ------
        InputError
            When a clearance leaves no gap at a stator.
        """
        along_speed = sorted({*(self._rotor_axes if self._is_speed_ratio else ()), self.speed_axis})
        along_response = sorted({*self._response_axes, self.speed_axis})
        along_clearance = [self.clearance_axis]
        if self._is_clearance_ratio:
            along_clearance = sorted({*along_response, self.clearance_axis})
        found = {
            "spin_speed": (along_speed, self._tabulated(along_speed, lambda at: self.response(at)[0])),
            "clearance": (along_clearance, self._tabulated(along_clearance, self.clearance)),
            "contact_free_amplitude": (
                along_response,
                self._tabulated(along_response, lambda at: self.response(at)[1]),
            ),
        }
        self._check_gap(float(found["clearance"][1].min()))
        return found

    @cached_property
    def steps(self) -> NDArray[np.float64]:
        """Predicted integration steps of a case, with length 1 along the axes that do not change them."""
        axes = [self.speed_axis, *(self.rig_axes if self._is_few else ())]
        recording = self.study.recording
        turns = recording.longest_transient + recording.revolutions

        is_modal = self.study.integrator.method == "modal"
        modal_steps = recording.longest_transient * _EVENT_STEPS + recording.revolutions * (
            _EVENT_STEPS + recording.samples_per_revolution
        )

        def predict(index: Index) -> float:
            if is_modal and not self.study.contact.is_stepped:
                return float(modal_steps)
            unit = self._unit_speed_at(tuple(index[i] for i in self._response_axes))
            speed = abs(self._values[self.speed_axis][index[self.speed_axis]]) * unit
            duration = turns * 2 * math.pi / speed
            if is_modal:
                return modal_steps + _TOUCHING * duration / self.study.integrator.contact_step(
                    self.study.contact
                )
            return duration / self._step_at(tuple(index[i] for i in self.rig_axes))

        shape = [len(values) if i in axes else 1 for i, values in enumerate(self._values)]
        return self._tabulated(axes, predict).reshape(shape)

    @property
    def _is_few(self) -> bool:
        """Whether every rig of the study can be asked before the run."""
        return math.prod(len(self._values[i]) for i in self.rig_axes) <= _MOST_RIGS

    def _tabulated(self, axes: Iterable[int], value: Callable[[Index], float]) -> NDArray[np.float64]:
        """Values along some axes, taken at the first place of the others."""
        shape = [len(self._values[i]) for i in sorted(axes)]
        along = set(axes)
        places = itertools.product(*(range(len(v) if i in along else 1) for i, v in enumerate(self._values)))
        return np.fromiter((value(at) for at in places), dtype=np.float64, count=math.prod(shape)).reshape(
            shape
        )

    def _make_rig(self, at: Index) -> Rig:
        """Rig at the places of the rig axes."""
        keys = (self.study.axes[i].name for i in self.rig_axes)
        return with_keys(self.study.rig, dict(zip(keys, self._at(self.rig_axes, at), strict=True)))

    def _at(self, axes: Iterable[int], at: Index) -> Iterator[float]:
        return (self._values[axis][i] for axis, i in zip(axes, at, strict=True))

    def _make_model(self, at: Index) -> Model:
        """Model at the places of the response axes and the first of the other rig axes."""
        chosen = dict(zip(self._response_axes, at, strict=True))
        return assemble(self._rig_at(tuple(chosen.get(i, 0) for i in self.rig_axes)))

    def _make_unit_speed(self, at: Index) -> float:
        """Speed, rad/s, of 1 on the speed axis."""
        return first_lateral_frequency(self._model_at(at)) if self._is_speed_ratio else 1.0

    def _make_response(self, at: Index, i_speed: int) -> tuple[float, float]:
        speed = self._values[self.speed_axis][i_speed] * self._unit_speed_at(at)
        amplitude = contact_free_amplitude(self._model_at(at), speed)
        if self._is_clearance_ratio and not amplitude > 0:
            problem = f"no contact-free amplitude at {speed:.6g} rad/s to take it of"
            raise InputError(f"[grid] clearance_ratio: {problem}; give clearance instead")
        return speed, amplitude

    def _step_at(self, at: Index) -> float:
        """Time step, s, at the places of the rig axes."""
        return self.study.integrator.step_within(self._limit_at(at))

    def _make_limit(self, at: Index) -> float:
        """Stability limit of the step, s, at the places of the rig axes."""
        return step_limit(assemble(self._rig_at(at)))

    def _check_step(self, step: float) -> None:
        every = (range(len(self._values[i]) if self._is_few else 1) for i in self.rig_axes)
        for at in itertools.product(*every):
            limit = self._limit_at(at)
            if step >= limit:
                told = zip(
                    (self.study.axes[i].name for i in self.rig_axes), self._at(self.rig_axes, at), strict=True
                )
                where = ", ".join(f"{name} = {value:g}" for name, value in told)
                problem = f"{step:g} s is above the stability limit{f' at {where}' if where else ''}"
                raise InputError(f"[integrator] step: {problem}; take less than {limit:.3g} s")

    def _check_held(self) -> None:
        """Refuse the modal scheme for a body that nothing holds: it has no constant response."""
        every = (range(len(self._values[i]) if self._is_few else 1) for i in self._response_axes)
        for at in itertools.product(*every):
            if free := find_free(self._model_at(at)):
                told = zip(
                    (self.study.axes[i].name for i in self._response_axes),
                    self._at(self._response_axes, at),
                    strict=True,
                )
                where = ", ".join(f"{name} = {value:g}" for name, value in told)
                problem = f"modal needs bodies that are held, and {free}{f' at {where}' if where else ''}"
                raise InputError(
                    f'[integrator] method: {problem}; hold it, or take method = "central-difference"'
                )

    def _check_gap(self, least: float) -> None:
        """Refuse a least clearance that a stator's own offset closes."""
        names = [axis.name for axis in self.study.axes]
        varied = [range(len(self._values[i]) if names[i].endswith("offset") else 1) for i in self.rig_axes]
        offset = min(s.clearance_offset for at in itertools.product(*varied) for s in self._rig_at(at).stator)
        if least + offset <= 0:
            problem = f"{least:g} m and a stator's clearance_offset of {offset:g} m leave no gap"
            raise InputError(f"[grid] {names[self.clearance_axis]}: {problem}; take a larger one")
