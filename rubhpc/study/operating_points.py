"""Operating points: rig, spin speed, clearance and contact-free amplitude of each case."""

from __future__ import annotations

import itertools
import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble, model_at
from rubhpc.fem.free_spin import release
from rubhpc.fem.response import (
    contact_free_amplitude,
    first_lateral_frequency,
    step_limit,
)
from rubhpc.fem.stability import instability_message, is_passive
from rubhpc.fem.statics import sag_at_stators
from rubhpc.rig.reading import with_keys
from rubhpc.study.axes import CLEARANCE_AXES, SPEED_AXES, TABLES, meanings_of
from rubhpc.study.initial import CONTACT_FREE
from rubhpc.study.points import Points
from rubhpc.study.table_axes import contact_at, initial_at

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.rig.rig import Rig
    from rubhpc.study.contact_keys import Contact
    from rubhpc.study.drive_law import DriveLaw
    from rubhpc.study.initial import Initial
    from rubhpc.study.points import Index, Values
    from rubhpc.study.speed_law import SpeedLaw
    from rubhpc.study.study import Study

_latest: list[OperatingPoints] = []  # of the study that was asked for last
_MOST_RIGS = 256  # whose time step is determined, 1 ms each; with more, that of the first is used for all


def operating_points_of(study: Study) -> OperatingPoints:
    """Return the operating points of a study; a run makes several grids of one, which share them."""
    if not (_latest and _latest[0].study is study):
        _latest[:] = [OperatingPoints(study)]
    return _latest[0]


class OperatingPoints:
    """Values on the axes, resolved: ratios to SI units, keys to rigs. Expensive results are cached.

    Parameters
    ----------
    study : Study

    Attributes
    ----------
    points : Points
        Where the cases lie; an index here is one along its dimensions.
    is_clearance_ratio : bool
        Whether clearances are given as shares of the contact-free amplitude.
    costly_dims : list of int
        The dimensions along which speed, rig or contact change: cases that differ there share no setup.
    setup_axes : list of int
        Axes that set the set-up of a case, which those of the same values share.
    friction_axis : int
    is_checked : bool
        Whether `point_checks.check_points` has found nothing wrong with them.
    rig_axes, response_axes : list of int
        Axes that set the rig, and those of them that set the contact-free response.
    """

    def __init__(self, study: Study) -> None:
        self.study = study
        self.points = Points(study.axes)
        self.is_checked = False
        self._values = [axis.values for axis in study.axes]
        names = [axis.name for axis in study.axes]
        self._speed_axis, self._clearance_axis, self.friction_axis = (
            next(i for i, name in enumerate(names) if name in options)
            for options in (SPEED_AXES, CLEARANCE_AXES, ("friction",))
        )
        self._is_speed_ratio = names[self._speed_axis] == "speed_ratio"
        self.is_clearance_ratio = names[self._clearance_axis] == "clearance_ratio"
        self._contact_axes, self._initial_axes, self._run_up_axes, self._drive_axes = (
            [i for i, axis in enumerate(study.axes) if axis.table == table] for table in TABLES
        )
        self.rig_axes = [i for i, axis in enumerate(study.axes) if axis.is_rig_key]
        rotor_axes = [i for i in self.rig_axes if names[i].startswith("rotor.")]
        # The contact-free response depends on the rotor, and on the stator's node, at which it is evaluated.
        node_axes = [
            i for i in self.rig_axes if names[i].startswith("stator.") and names[i].endswith(".node")
        ]
        self.response_axes = sorted(rotor_axes + node_axes)
        self._speed_setters = [*(rotor_axes if self._is_speed_ratio else ()), self._speed_axis]
        self.costly_dims = self.dims(self._speed_axis, *self.rig_axes, *self._contact_axes)
        self.setup_axes = [self._speed_axis, *self.rig_axes, *self._contact_axes, *self._drive_axes]
        # Cached by value, not by index: of axes that share a dimension only some may matter here.
        self._rig_at = lru_cache(maxsize=256)(self._make_rig)
        self._contact_at = lru_cache(maxsize=4096)(self._make_contact)
        self._initial_at = lru_cache(maxsize=4096)(self._make_initial)
        self._model_at = lru_cache(maxsize=4)(self._make_model)
        self._is_passive_at = lru_cache(maxsize=65536)(self._make_is_passive)
        self._unit_speed_at = lru_cache(maxsize=65536)(self._make_unit_speed)
        self._fastest_at = lru_cache(maxsize=65536)(self._make_fastest)
        self._response_at = lru_cache(maxsize=65536)(self._make_response)
        self._limit_at = lru_cache(maxsize=4096)(self._make_limit)

    def rig(self, index: Index) -> Rig:
        """Rig of a case."""
        return self._rig_at(self._on(self.rig_axes, index))

    def response(self, index: Index) -> tuple[float, float]:
        """Spin speed (rad/s) and contact-free amplitude (m; NaN of an unstable rotor) of a case."""
        return self._response_at(self._on(self.response_axes, index), self._on([self._speed_axis], index)[0])

    def instability(self, index: Index) -> str:
        """How the rotor of a case is unstable at its speed; "" where it is stable."""
        return instability_message(self.model(index), self.response(index)[0])

    def sag_beyond(self, index: Index, clearance: float) -> float:
        """How far constant loads bend the rotor of a case into a stator, m; negative where they do not."""
        model = model_at(self.model(index), self.response(index)[0])
        nearer, _ = sag_at_stators(model)
        offset = [stator.clearance_offset for stator in self.rig(index).stator]
        return float(max(nearer - offset)) - clearance if model.sag.any() else -math.inf

    def model(self, index: Index) -> Model:
        """Model of a case's rotor, with stators at the same nodes."""
        return self._model_at(self._on(self.response_axes, index))

    def step_limit(self, index: Index) -> float:
        """Stability limit of the central difference's step, s."""
        return self._limit_at(self._on(self.rig_axes, index))

    def speed_of(self, index: Index, like: Index) -> float:
        """Spin speed of a case, rad/s, without its sign, with the rotor of another."""
        return abs(self._on([self._speed_axis], index)[0]) * self._unit_speed_at(
            self._on(self.response_axes, like)
        )

    def clearance(self, index: Index) -> float:
        """Radial clearance at rest of a case, m."""
        (value,) = self._on([self._clearance_axis], index)
        return value * self.response(index)[1] if self.is_clearance_ratio else value

    def friction(self, index: Index) -> float:
        """Coefficient of friction of a case."""
        return self._on([self.friction_axis], index)[0]

    def contact(self, index: Index) -> Contact:
        """Contact of a case."""
        return self._contact_at(self._on(self._contact_axes, index))

    def speed_law(self, index: Index) -> SpeedLaw | DriveLaw:
        """Speed over the time of a case that runs up, or what drives it."""
        if self.study.drive is not None:
            return self._drive_law(self._on(self._drive_axes, index))
        assert self.study.run_up is not None
        return self.study.run_up.law_at(next(iter(self._on(self._run_up_axes, index)), None))

    def fastest(self, index: Index) -> float:
        """Speed, rad/s, that a driven case does not pass."""
        return self._fastest_at(self._on(self.response_axes, index), self._on(self._drive_axes, index))

    def initial(self, index: Index) -> Initial:
        """Where a case starts."""
        return self._initial_at(self._on(self._initial_axes, index))

    def with_each_law(self, index: Index) -> list[Index]:
        """Index of a case and of those that differ from it in the words on contact axes only."""
        laws = set(self.dims(*(i for i in self._contact_axes if meanings_of(self.study.axes[i].name))))
        options = (
            range(n) if dim in laws else index[dim : dim + 1] for dim, n in enumerate(self.points.shape)
        )
        return list(itertools.product(*options))

    def arrays(self) -> dict[str, tuple[list[int], NDArray[np.float64]]]:
        """Return name -> (dimensions that set it, values along them, SI units), for all cases.

        `spin_speed` in rad/s, `clearance` and `contact_free_amplitude` in m.
        """
        along = sorted(self.dims(self._speed_axis, *self.response_axes))
        pairs = np.array([self.response(index) for index in self._indices(along)])
        table = pairs.reshape(*(self.points.shape[dim] for dim in along), 2)
        amplitude = table[..., 1]
        along_speed = sorted(self.dims(*self._speed_setters))
        speed = table[tuple(slice(None) if dim in along_speed else 0 for dim in along)][..., 0]
        along_clearance = self.dims(self._clearance_axis)
        clearance = np.array(self._values[self._clearance_axis], dtype=np.float64)
        if self.is_clearance_ratio:
            whole = sorted({*along, *along_clearance})
            clearance = self._laid(clearance, along_clearance, whole) * self._laid(amplitude, along, whole)
            along_clearance = whole
        return {
            "spin_speed": (along_speed, speed),
            "clearance": (along_clearance, clearance),
            "contact_free_amplitude": (along, amplitude),
        }

    @property
    def axes_of_steps(self) -> list[int]:
        """Axes that set how many steps a case takes."""
        rig_axes = self.rig_axes if self.has_few_rigs else []
        return [self._speed_axis, *rig_axes, *self._contact_axes, *self._run_up_axes]

    @property
    def has_few_rigs(self) -> bool:
        """Whether every rig of the study can be assembled before the run."""
        return math.prod(self.points.shape[dim] for dim in self.dims(*self.rig_axes)) <= _MOST_RIGS

    def dims(self, *axes: int) -> list[int]:
        """Dimensions of some axes, each once."""
        return list(dict.fromkeys(self.points.place[i] for i in axes))

    def _on(self, axes: Iterable[int], index: Index) -> Values:
        """Values of a case on some axes."""
        return tuple([self._values[i][index[self.points.place[i]]] for i in axes])

    def along(self, axes: Iterable[int]) -> Iterable[Index]:
        """Every index along some axes, the first place of the others."""
        return self._indices(self.dims(*axes))

    def _indices(self, dims: Iterable[int]) -> Iterable[Index]:
        """Every index along some dimensions, the first place of the others."""
        along = set(dims)
        return itertools.product(*(range(n if d in along else 1) for d, n in enumerate(self.points.shape)))

    def _laid(self, table: NDArray[np.float64], dims: list[int], among: list[int]) -> NDArray[np.float64]:
        """A table over some dimensions, of length 1 along the others among which it is to lie."""
        return table.reshape([self.points.shape[dim] if dim in dims else 1 for dim in among])

    def named(self, axes: Iterable[int], index: Index) -> str:
        """Values of a case on some axes, for messages."""
        values = self._by_name(axes, self._on(axes, index))
        return ", ".join(f"{name} = {value:g}" for name, value in values.items())

    def _by_name(self, axes: Iterable[int], values: Values) -> dict[str, float]:
        return dict(zip((self.study.axes[i].name for i in axes), values, strict=True))

    def _make_rig(self, values: Values) -> Rig:
        """Rig with these values on the rig axes."""
        return with_keys(self.study.rig, self._by_name(self.rig_axes, values))

    def _make_contact(self, values: Values) -> Contact:
        """Contact with these values on the contact axes."""
        return contact_at(self.study.contact, self._by_name(self._contact_axes, values))

    def _make_initial(self, values: Values) -> Initial:
        """Start with these values on the initial axes."""
        return initial_at(self.study.initial, self._by_name(self._initial_axes, values))

    def _make_model(self, values: Values) -> Model:
        """Model with these values on the response axes, and the first ones on the other rig axes."""
        chosen = dict(zip(self.response_axes, values, strict=True))
        return assemble(self._rig_at(tuple([chosen.get(i, self._values[i][0]) for i in self.rig_axes])))

    def _drive_law(self, values: Values) -> DriveLaw:
        """Drive with these values on the drive axes."""
        assert self.study.drive is not None
        keys = (self.study.axes[i].key for i in self._drive_axes)
        return self.study.drive.law_at(dict(zip(keys, values, strict=True)))

    def _make_fastest(self, response: Values, drive: Values) -> float:
        law, model = self._drive_law(drive), self._model_at(response)
        highest = law.fastest(release(model, law.inertia)[1].inertia)
        return min([highest, *model.rotor.tabulated_speeds[-1:]])

    def _make_unit_speed(self, values: Values) -> float:
        """Speed, rad/s, of 1 on the speed axis."""
        return first_lateral_frequency(self._model_at(values)) if self._is_speed_ratio else 1.0

    def _make_is_passive(self, values: Values) -> bool:
        """Whether the rotor is stable at every speed, as can be seen at once."""
        rotor = self._model_at(values).rotor
        return rotor.by_speed is None and is_passive(rotor)

    def _make_response(self, values: Values, speed: float) -> tuple[float, float]:
        speed = speed * self._unit_speed_at(values)
        amplitude = contact_free_amplitude(self._model_at(values), speed)
        is_stable = self._is_passive_at(values)
        if problem := "" if is_stable else instability_message(self._model_at(values), speed):
            if self.is_clearance_ratio:
                raise InputError(f"[grid] clearance_ratio: {problem}; give clearance instead")
            if self.study.initial.from_ == CONTACT_FREE:
                raise InputError(f'[initial] from: {problem}; set from = "rest"')
            amplitude = math.nan
        if self.is_clearance_ratio and not amplitude > 0:
            problem = f"no contact-free amplitude at {speed:.6g} rad/s to take it of"
            raise InputError(f"[grid] clearance_ratio: {problem}; give clearance instead")
        return speed, amplitude

    def _make_limit(self, values: Values) -> float:
        """Stability limit of the step, s, with these values on the rig axes."""
        return step_limit(assemble(self._rig_at(values)))
