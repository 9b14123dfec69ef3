"""Final states of cases: their length, and whether one may start a case of a study."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble
from rubhpc.fem.model import state_size
from rubhpc.rig.reading import with_keys
from rubhpc.schema import STATE
from rubhpc.study.axes import FROM_REST

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rubhpc.fem.model import Model
    from rubhpc.study.study import Study
_MOST_RIGS = 64  # along an axis: assembled before the run, 1 ms each; of more values only the two ends


def count_state(study: Study) -> int:
    """Length of the final state of a case: displacement and velocity of each degree, two per stator.

    Raises
    ------
    InputError
        When it differs between cases: the final state of one cannot start another.
    """
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
    """Refuse a state of a store that does not fit the rigs of a study.

    Raises
    ------
    InputError
        Names the degrees of freedom of both.
    """
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
