"""What operating points must satisfy: a step within its limit, bodies held, nodes that move, a gap."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rubhpc.errors import InputError
from rubhpc.fem.constraints import find_rigid_body_mode, unheld_message
from rubhpc.fem.response import check_response_node
from rubhpc.study.initial import KNOCKED
from rubhpc.units import typed_quantity

if TYPE_CHECKING:
    from rubhpc.study.operating_points import OperatingPoints


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
    """Refuse a least clearance, m, that a stator's own offset closes."""
    varied = [i for i in points.rig_axes if points.study.axes[i].name.endswith("offset")]
    offset = min(s.clearance_offset for at in points.along(varied) for s in points.rig(at).stator)
    if least + offset <= 0:
        gap, shift = typed_quantity(least, "m"), typed_quantity(offset, "m")
        problem = f"{gap} and a stator's clearance_offset of {shift} leave no gap"
        name = "clearance_ratio" if points.is_clearance_ratio else "clearance"
        raise InputError(f"[grid] {name}: {problem}; use a larger one")


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
