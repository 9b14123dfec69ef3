"""The cases of a study and their blocks: identity, ids, chunks, predicted cost.

No object is kept per case: a million cases are planned as arrays.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError, located
from rubhpc.fem.assemble import assemble
from rubhpc.fem.model import state_size
from rubhpc.fem.response import check_response_node
from rubhpc.fem.statics import find_rigid_body_mode, unheld_message
from rubhpc.input.messages import place
from rubhpc.rig.reading import with_keys
from rubhpc.rig.stators import gap_problem
from rubhpc.schema import STATE
from rubhpc.study.axes import FROM_REST, KNOCKED, RUN_UP_TIME
from rubhpc.study.continuation import CaseIds, continuation_of
from rubhpc.study.identity import identity_parts
from rubhpc.study.operating_points import operating_points_of
from rubhpc.study.points import MOST_CASES, Points, boxed
from rubhpc.study.warnings import decay_of, warnings_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from contextlib import AbstractContextManager

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.rig.rig import Rig
    from rubhpc.study.contact_keys import Contact
    from rubhpc.study.drive_law import DriveLaw
    from rubhpc.study.initial import Initial
    from rubhpc.study.operating_points import OperatingPoints
    from rubhpc.study.points import Index
    from rubhpc.study.speed_law import SpeedLaw
    from rubhpc.study.study import Study


def check_points(points: OperatingPoints) -> None:
    """Check what is known before clearances are.

    Raises
    ------
    InputError
        When the time step exceeds the stability limit of a rig, the modal scheme meets a rig with a
        rigid-body mode, or an impulse acts on a node that does not move sideways.
    """
    if points.is_checked:
        return
    integrator = points.study.integrator
    if integrator.step is not None and integrator.method == "central-difference":
        _check_step(points, integrator.step)
    if integrator.method == "modal":
        _check_held(points)
    _check_knocks(points)
    points.is_checked = True


def check_gap(points: OperatingPoints, least: float) -> None:
    """Refuse a least clearance, m, that stators cannot have."""
    varied = [i for i in points.rig_axes if points.study.axes[i].name.endswith("offset")]
    is_ratio = points.is_clearance_ratio
    for at in points.along(varied):
        if problem := gap_problem(points.rig(at).stator, least, is_ratio=is_ratio):
            raise InputError(f"[grid] {'clearance_ratio' if is_ratio else 'clearance'}: {problem}")


def _check_step(points: OperatingPoints, step: float) -> None:
    for index in points.along(points.rig_axes) if points.has_few_rigs else ():
        limit = points.step_limit(index)
        if step >= limit:
            where = points.named(points.rig_axes, index)
            problem = f"{step:g} s is above the stability limit{f' at {where}' if where else ''}"
            raise InputError(f"[integrator] step: {problem}; use less than {limit:.3g} s")


def _check_held(points: OperatingPoints) -> None:
    """Refuse the modal scheme for a body that nothing holds: it has no constant response."""
    for index in points.along(points.response_axes) if points.has_few_rigs else ():
        if free := find_rigid_body_mode(points.model(index)):
            raise InputError(unheld_message(free, points.named(points.response_axes, index)))


def _check_knocks(points: OperatingPoints) -> None:
    """Refuse an impulse on a node that does not move sideways."""
    study = points.study
    axis = next((axis for axis in study.axes if axis.name == KNOCKED), None)
    nodes = [study.initial.impulse_node] if axis is None else axis.values
    where = "[initial] impulse_node" if axis is None else f"[grid] {KNOCKED}"
    first = points.model((0,) * len(points.points.dims))
    for node in nodes:
        if node is not None:
            check_response_node(first, int(node), where)


_MOST_RIGS = 64  # along an axis: assembled before the run, 1 ms each; of more values only the two ends


def count_state(study: Study) -> int:
    """Length of the final state of a case: displacement and velocity of each degree, two per stator."""
    models = _models(study)
    n_state = state_size(next(models)[1])
    for name, model in models:
        if state_size(model) == n_state:
            continue
        swept = next((a.name for a in study.axes if a.sweep != FROM_REST), None)
        problem = "changes the number of degrees of freedom"
        if swept is None:
            fix = f'remove this axis, or "{STATE}" from [record] keep'
            raise InputError(f"[grid] {name}: {problem}, so final states differ in length; {fix}")
        problem += ", so a final state cannot start the next case"
        raise InputError(f"[grid] {name}: {problem}; remove this axis, or the sweep of {swept}")
    return n_state


def check_start(study: Study) -> None:
    """Refuse a state of a store that does not fit the rigs of a study."""
    if study.initial.state is not None:
        for _, model in _models(study):
            study.initial.state.check_fit(model)


def _models(study: Study) -> Iterator[tuple[str, Model]]:
    """The model at the first values, named "", then those along each axis of the rig, few of a long one."""
    first = {axis.name: axis.values[0] for axis in study.axes if axis.is_rig_key}
    yield "", assemble(with_keys(study.rig, first))
    for axis in study.axes:
        values = axis.values if len(axis.values) <= _MOST_RIGS else axis.values[:: len(axis.values) - 1]
        for value in values if axis.is_rig_key else ():
            yield axis.name, assemble(with_keys(study.rig, {**first, axis.name: value}))


_BLOCK = 16  # cases of a block by default, at most


@dataclass(frozen=True, kw_only=True, slots=True)
class Case:
    """One point of the grid, with all that is needed to compute it."""

    index: tuple[int, ...]
    id: str
    rig: Rig
    speed: float  # rad/s
    clearance: float  # m
    friction: float
    contact: Contact
    initial: Initial
    contact_free_amplitude: float  # m
    speed_law: SpeedLaw | DriveLaw | None = None  # of a changing speed, of which the highest is `speed`


@dataclass(frozen=True, kw_only=True, slots=True)
class Block:
    """A box of the grid: the unit of work, and one chunk of every stored array."""

    number: int
    start: tuple[int, ...]
    shape: tuple[int, ...]
    cost: int  # predicted integration steps


class CaseGrid:
    """The cases of a study.

    Parameters
    ----------
    study : Study
    chunk : tuple of int, optional
        Cases of a block along each dimension, as in an existing store. Default: at most `[run] block` cases,
        first along the swept axis, then along the dimensions that do not change speed or rig, so that a block
        shares its setup.

    Attributes
    ----------
    points : Points
        Where the cases lie.
    dims, shape : tuple
        Names of the dimensions, and cases along each.
    n_case, n_stator : int
        Number of cases, and of stators.
    chunk : tuple of int
        Cases of a block along each dimension.
    continuation : Continuation or None
        Of a sweep: from which case each one starts.
    n_degree : int
        Length of the final state where it is stored, as in a continuation; else 0.
    identity, identity_parts : str, dict
        SHA-256 of all that changes results but the values on the axes, and what went into it.

    Raises
    ------
    InputError
        When the time step exceeds the stability limit of a rig, or rigs whose final states are kept, or that
        start from a state of a store, differ in their degrees of freedom.
    """

    def __init__(self, study: Study, chunk: tuple[int, ...] | None = None) -> None:
        self.study = study
        self.points = Points(study.axes)
        self.dims, self.shape, self.n_case = self.points.dims, self.points.shape, self.points.n_case
        if self.n_case > MOST_CASES:
            with _named(study):
                sizes = " x ".join(map(str, self.shape))
                raise InputError(
                    f"[grid]: {sizes} cases are too many, the limit is {MOST_CASES}; split the study"
                )
        self.n_stator = len(study.rig.stator)
        with _named(study):
            self._operating_points = operating_points_of(study)
            check_points(self._operating_points)
            self.continuation = continuation_of(study.axes)
            keeps_state = self.continuation is not None or STATE in study.recording.keep
            self.n_degree = count_state(study) if keeps_state and study.branch is None else 0
            check_start(study)
        self.chunk = chunk if chunk is not None else self._default_chunk()
        self.identity_parts = identity_parts(study)
        text = json.dumps(self.identity_parts, sort_keys=True, separators=(",", ":"), allow_nan=False)
        self.identity = hashlib.sha256(text.encode()).hexdigest()
        self._ids = CaseIds(self.identity, self.points.values, self.continuation)

    def sequences(self) -> list[list[Block]]:
        """Return the sequences of blocks that one rank computes in order, the most expensive one first.

        Without a continuation every block is a sequence of its own.
        """
        blocks = self.blocks()
        continuation = self.continuation
        if continuation is None:
            return [[block] for block in blocks]
        together: dict[tuple[int, ...], list[Block]] = {}
        for block in sorted(blocks, key=lambda block: block.start):
            at = block.start
            together.setdefault((*at[: continuation.axis], *at[continuation.axis + 1 :]), []).append(block)
        sequences = [
            part[::-1] if continuation.is_downward(part[0].start) else part for part in together.values()
        ]
        return sorted(sequences, key=lambda part: -sum(block.cost for block in part))

    def in_turn(self, cases: Sequence[Case]) -> list[int]:
        """Positions of the cases of a block in the order in which they are to be computed."""
        continuation, order = self.continuation, range(len(cases))
        return (
            sorted(order, key=lambda i: continuation.position(cases[i].index))
            if continuation
            else list(order)
        )

    def predecessor(self, index: Sequence[int]) -> tuple[int, ...] | None:
        """Index of the case this one starts from; None where it starts at rest."""
        return (
            self.continuation.predecessor(index, self.shape[self.continuation.axis])
            if self.continuation
            else None
        )

    def blocks(self) -> list[Block]:
        """Return all blocks, the longest first."""
        starts = [range(0, n, c) for n, c in zip(self.shape, self.chunk, strict=True)]
        sizes = [[min(c, n - s) for s in at] for n, c, at in zip(self.shape, self.chunk, starts, strict=True)]
        cost: NDArray[np.float64] = predicted_steps(self._operating_points)
        for i, at in enumerate(starts):
            if cost.shape[i] == self.shape[i]:
                cost = np.add.reduceat(cost, np.array(at), axis=i)
            else:  # equal for all cases along this dimension
                cost = cost * np.array(sizes[i]).reshape([-1 if j == i else 1 for j in range(cost.ndim)])
        steps = np.rint(cost.ravel()).astype(np.int64)
        order = np.argsort(-steps, kind="stable")
        corners, shapes = list(itertools.product(*starts)), list(itertools.product(*sizes))
        return [
            Block(number=n, start=corners[n], shape=shapes[n], cost=c)
            for n, c in zip(order.tolist(), steps[order].tolist(), strict=True)
        ]

    def cases(self, block: Block, places: Sequence[int] | None = None) -> list[Case]:
        """Return the cases of a block, the last axis running fastest, or those at some places in it."""
        indices = list(boxed(block.start, block.shape))
        return [self.case(indices[i]) for i in (range(len(indices)) if places is None else places)]

    def case(self, index: Sequence[int]) -> Case:
        """Return the case at an index of the grid."""
        return self._case(tuple(index), self._ids(self.points.at(index)))

    def case_ids(self, block: Block) -> list[str]:
        """Return the ids of the cases of a block, in the order of `cases`."""
        points = self.points.within(block.start, block.shape)
        return [self._ids(point) for point in points]

    def setup_values(self, index: Sequence[int]) -> tuple[tuple[float, ...], float]:
        """Values on the axes that set the set-up of a case, and its friction: cases may share them."""
        values, points = self.points.at(index), self._operating_points
        return tuple([values[i] for i in points.setup_axes]), values[points.friction_axis]

    def with_each_law(self, index: Sequence[int]) -> list[Case]:
        """Return the case at an index, and those that differ from it in nothing but laws of contact."""
        return [self.case(at) for at in self._operating_points.with_each_law(tuple(index))]

    def operating_points(self) -> dict[str, tuple[tuple[str, ...], NDArray[np.float64]]]:
        """Return the operating points: name -> (dimensions it depends on, values in SI units).

        `spin_speed` in rad/s, `clearance` and `contact_free_amplitude` in m.

        Raises
        ------
        InputError
            When a clearance leaves no gap at a stator.
        """
        with _named(self.study):
            found = self._operating_points.arrays()
            check_gap(self._operating_points, float(found["clearance"][1].min()))
        return {name: (tuple(self.dims[i] for i in dims), values) for name, (dims, values) in found.items()}

    def warnings(self) -> tuple[str, ...]:
        """Return what the study is to be warned of: unstable speeds, sag beyond the clearance, no damping."""
        return warnings_of(self._operating_points)

    def decay(self) -> str:
        """Return which free motion decays slowest, and how the transient compares; "" without a transient."""
        return decay_of(self._operating_points)

    @property
    def most_revolutions(self) -> int:
        """Revolutions of the longest case, of a study whose speed changes."""
        axes = [axis for axis in self.study.axes if axis.name == RUN_UP_TIME]
        run_up = self.study.run_up
        if run_up is None:
            return 0 if self.study.drive is None else self.study.drive.revolutions
        times = axes[0].values if axes else (None,)
        return max(run_up.law_at(time).n_revolution for time in times)

    def _case(self, index: tuple[int, ...], name: str) -> Case:
        speed, amplitude = self._operating_points.response(index)
        law = self._operating_points.speed_law(index) if self.study.changes_speed else None
        return Case(
            index=index,
            id=name,
            rig=self._operating_points.rig(index),
            speed=self._operating_points.fastest(index) if self.study.drive else speed,
            clearance=self._operating_points.clearance(index),
            friction=self._operating_points.friction(index),
            contact=self._operating_points.contact(index),
            initial=self._operating_points.initial(index),
            contact_free_amplitude=amplitude,
            speed_law=law,
        )

    def _default_chunk(self) -> tuple[int, ...]:
        wanted = self.study.run.block or min(max(self.n_case // 64, 1), _BLOCK)
        costly = self._operating_points.costly_dims
        order = [*(i for i in reversed(range(len(self.shape))) if i not in costly), *costly]
        chunk = [1] * len(self.shape)
        if (continuation := self.continuation) is not None:
            # One rank computes a whole sweep: a block is an eighth of it, or several whole ones.
            n = self.shape[continuation.axis]
            chunk[continuation.axis] = _evenly(n, self.study.run.block or min(max(n // 8, 1), _BLOCK))
            n_sequence = self.n_case // n
            wanted = (self.study.run.block or min(max(n_sequence // 64, 1), _BLOCK)) // chunk[
                continuation.axis
            ]
            order = [
                i for i in order if i not in (continuation.axis, continuation.direction)
            ]  # a block has one direction
        for i in order:
            chunk[i] = _evenly(self.shape[i], wanted)
            wanted = max(wanted // chunk[i], 1)
        return tuple(chunk)


def _evenly(n: int, most: int) -> int:
    """Size of equal blocks of at most `most` cases, rather than full blocks and a remainder."""
    n_block = -(-n // max(min(n, most), 1))
    return -(-n // n_block)


def _named(study: Study) -> AbstractContextManager[None]:
    """Put the study's file before an InputError."""
    return located("" if study.source is None else f"{place(str(study.source))}: ")


_EVENT_STEPS = 60  # that the modal scheme takes a revolution, samples apart
_COLLOCATION = 4.0  # cost of a revolution without closed form over that of one with it


def predicted_steps(points: OperatingPoints) -> NDArray[np.float64]:
    """Steps of a case, of length 1 along the dimensions that do not change them."""
    along = points.axes_of_steps
    dims = points.dims(*along)
    shape = [n if dim in dims else 1 for dim, n in enumerate(points.points.shape)]
    steps = np.fromiter((_steps_of(points, index) for index in points.along(along)), dtype=np.float64)
    return steps.reshape(shape)


def _steps_of(points: OperatingPoints, index: Index) -> float:
    study, contact, recording = points.study, points.contact(index), points.study.recording
    per_revolution = _EVENT_STEPS + recording.samples_per_revolution
    if study.changes_speed:
        return float(points.speed_law(index).n_revolution * per_revolution)
    modal_steps = recording.longest_transient * _EVENT_STEPS + recording.revolutions * per_revolution
    if study.integrator.method == "modal":
        is_closed = contact.are_laws_closed and contact.normal == "fixed" and not study.has_bent_stator
        return modal_steps if is_closed else _COLLOCATION * modal_steps
    like = index if points.has_few_rigs else (0,) * len(points.points.dims)
    turns = recording.longest_transient + recording.revolutions
    duration = turns * 2 * math.pi / points.speed_of(index, like)
    return duration / study.integrator.step_within(points.step_limit(like))
