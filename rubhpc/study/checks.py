"""What makes a grid of axes and a rig a study: axes that are there once, rigs and contacts that can be."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble
from rubhpc.fem.probes import with_probes
from rubhpc.rig.reading import with_keys
from rubhpc.rig.stators import gap_problem
from rubhpc.schema import VARIABLES
from rubhpc.study.axes import CLEARANCE_AXES, FROM_REST, NO_NEIGHBOURS, SPEED_AXES, Axis

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rubhpc.rig.probes import Probe
    from rubhpc.rig.rig import Rig

# Names that a store takes for itself; an axis `clearance` is the very setting of that name.
_RESERVED = (set(VARIABLES) | {"stator", "sample", "order", "section", "revolution", "degree"}) - {
    "clearance"
}
_MOST_RIGS = 4096  # tried out one by one; of more, only those along each axis


def check_axes(axes: tuple[Axis, ...]) -> None:
    """Refuse axes that lack one that is needed, or set one thing twice."""
    names = [axis.name for axis in axes]
    for options, example in (
        (SPEED_AXES, "speed_ratio = [0.75, 1.5]"),
        (CLEARANCE_AXES, "clearance_ratio = 0.7"),
        (("friction",), "friction = 0.3"),
    ):
        given = [name for name in names if name in options]
        if not given:
            raise InputError(f"[grid] {options[0]}: missing; add {' or '.join(options)}, such as {example}")
        if len(given) > 1:
            raise InputError(f"[grid] {given[1]}: conflicts with {given[0]}; give only one of them")
    swept = [axis.name for axis in axes if axis.sweep != FROM_REST]
    if len(swept) > 1:
        raise InputError(f"[grid] {swept[1]}: sweep: {swept[0]} is swept already; remove one sweep")
    if swept and any(axis.dimension != axis.coordinate for axis in axes):
        raise InputError(f"[grid] {swept[0]}: sweep: {NO_NEIGHBOURS}")
    taken: dict[str, str] = {}
    for axis in axes:
        if axis.coordinate in _RESERVED:
            fix = "name one stator, such as stator.1.lateral" if axis.is_rig_key else "remove it"
            raise InputError(f"[grid] {axis.name}: {axis.coordinate} is another variable of a store; {fix}")
        if axis.coordinate in taken:
            raise InputError(
                f"[grid] {axis.name}: is the same dimension as {taken[axis.coordinate]}; remove one"
            )
        taken[axis.coordinate] = axis.name
        for other in axes:
            without_numbers = ".".join(part for part in axis.name.split(".") if not part.isdigit())
            if other.name == without_numbers != axis.name:
                raise InputError(f"[grid] {axis.name}: is also set by the axis {other.name}; remove one")


def check_rigs(rig: Rig, axes: tuple[Axis, ...], probes: tuple[Probe, ...] = ()) -> None:
    """Refuse a grid some of whose rigs cannot be, or cannot be studied, or whose probes see nothing."""
    rig_axes = [axis for axis in axes if axis.is_rig_key]
    names = [axis.name for axis in rig_axes]
    grid: Iterable[tuple[float, ...]]
    if math.prod(len(axis.tried) for axis in rig_axes) <= _MOST_RIGS:
        grid = itertools.product(*(axis.tried for axis in rig_axes))
    else:
        first = [axis.tried[0] for axis in rig_axes]
        grid = itertools.chain.from_iterable(
            ((*first[:i], value, *first[i + 1 :]) for value in axis.tried) for i, axis in enumerate(rig_axes)
        )
    for values in grid:
        case = dict(zip(names, values, strict=True))
        try:
            _check_rig(with_keys(rig, case), axes)
        except InputError as error:
            if not case:
                raise
            values_text = ", ".join(f"{name} = {value:g}" for name, value in case.items())
            raise InputError(f"[grid] {values_text}: invalid rig: {error}") from None
    if probes:  # of the first rig, since each is assembled for it
        chosen = with_keys(rig, {axis.name: axis.tried[0] for axis in rig_axes})
        model = assemble(chosen)
        with_probes(model, chosen, probes, next(iter(model.rotor.tabulated_speeds), 0.0))


def _check_rig(rig: Rig, axes: tuple[Axis, ...]) -> None:
    if not rig.stator:
        raise InputError(f"rig: {rig.name} has no stator to touch; add a [[stator]] to it")
    by_name = {axis.name: axis for axis in axes}
    if "clearance_ratio" in by_name and not any(u.mass * u.radius for u in rig.rotor.unbalance):
        problem = f"{rig.name} has no unbalance, so no contact-free amplitude"
        raise InputError(f"[grid] clearance_ratio: {problem}; give clearance instead, or an unbalance")
    if "clearance" in by_name:
        problem = gap_problem(rig.stator, min(by_name["clearance"].tried))
        if problem:
            raise InputError(f"[grid] clearance: {problem}")
