"""How many integration steps a case is likely to take: what sets the order of blocks, and their size."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.study.operating_points import OperatingPoints
    from rubhpc.study.points import Index

_EVENT_STEPS = 60  # that the modal scheme takes a revolution, samples apart
_TOUCHING = 0.15  # share of the time in contact, where it takes short steps there


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
    is_modal = study.integrator.method == "modal"
    if is_modal and (contact.closed_form == "always" or contact.is_smooth):
        return float(modal_steps)
    like = index if points.has_few_rigs else (0,) * len(points.points.dims)
    turns = recording.longest_transient + recording.revolutions
    duration = turns * 2 * math.pi / points.speed_of(index, like)
    if is_modal:
        return modal_steps + _TOUCHING * duration / study.integrator.contact_step(contact)
    return duration / study.integrator.step_within(points.step_limit(like))
