"""Which drawn cases rub, as far as that is known before any is run, and a sample with a share of them.

A case counts as rubbing if its contact-free motion, the steady response to the unbalance about the sagged
shaft, would reach a stator: that motion cannot last then. Where it stays clear, a case may still rub, if the
start or a disturbance leads to another motion.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble, model_at
from rubhpc.fem.response import contact_free_amplitude, contact_free_reach, first_lateral_frequency
from rubhpc.fem.stability import instability_message, is_passive
from rubhpc.rig.reading import with_keys
from rubhpc.study.axes import CLEARANCE_AXES, SPEED_AXES

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from rubhpc.fem.model import Model
    from rubhpc.rig.rig import Rig
    from rubhpc.study.axes import Axis

_MOST_DRAWN = 64  # points drawn for each case at most, before the ranges count as those of one kind alone


def balanced(
    axes: Sequence[Axis], rig: Rig, n: int, share: float, drawn: Callable[[int], Sequence[Sequence[float]]]
) -> list[Sequence[float]]:
    """Return the first points of a sequence, among which rubbing and free ones are in a fixed pattern.

    Of any first k cases, `floor(k share)` rub. More cases thus continue fewer.

    Parameters
    ----------
    axes : sequence of Axis
        Those of the grid; the ranges are the ones with `drawn_from`.
    n : int
        Cases.
    share : float
        Of rubbing cases.
    drawn : callable
        Gives the first so many points of the sequence, the values on the ranges; more continue fewer.
    """
    rubs = _decision(axes, rig)
    wanted = {True: int(n * share), False: n - int(n * share)}
    found: dict[bool, list[Sequence[float]]] = {True: [], False: []}
    for n_seen, point in enumerate(_in_turn(drawn, n)):
        lacking = [kind for kind in found if len(found[kind]) < wanted[kind]]
        if not lacking:
            break
        if n_seen == _MOST_DRAWN * n:
            kind = lacking[0]
            what = "reach a stator" if kind else "stay clear of the stators"
            problem = f"{len(found[kind])} of {n_seen} drawn cases {what}, {wanted[kind]} are needed"
            fix = f"take {'smaller' if kind else 'larger'} clearances into the ranges"
            raise InputError(f"[sample] rub_share: {problem}; {fix}")
        found[rubs(point)].append(point)
    kinds = (int((k + 1) * share) > int(k * share) for k in range(n))
    queues = {kind: iter(points) for kind, points in found.items()}
    return [next(queues[kind]) for kind in kinds]


def _in_turn(drawn: Callable[[int], Sequence[Sequence[float]]], n: int) -> Iterator[Sequence[float]]:
    """The points of a sequence without end, drawn anew as more are needed."""
    n_before = 0
    while True:
        yield from drawn(n)[n_before:]
        n_before, n = n, 2 * n


def _decision(axes: Sequence[Axis], rig: Rig) -> Callable[[Sequence[float]], bool]:
    """Whether a case rubs, as a function of the values on the ranges."""
    names = [axis.name for axis in axes]
    for needed in (SPEED_AXES, CLEARANCE_AXES):
        if not set(needed).intersection(names):
            problem = f"needs {' or '.join(needed)} in [grid], which decides whether a case rubs"
            raise InputError(f"[sample] rub_share: {problem}; add it, or leave rub_share out")
    deciding = [a for a in axes if a.name in (*SPEED_AXES, *CLEARANCE_AXES) or _moves_reach(a)]
    for axis in deciding:
        if axis.drawn_from is None and len(axis.values) > 1:
            problem = f"{axis.name} has {len(axis.values)} values, at each of which other cases rub"
            raise InputError(f"[sample] rub_share: {problem}; give one, or a range {{ start, stop }}")
    ranges = [axis.name for axis in axes if axis.drawn_from is not None]
    fixed = {axis.name: axis.values[0] for axis in deciding}
    keys = [axis.name for axis in deciding if axis.is_rig_key]

    @lru_cache(maxsize=4)
    def model_of(values: tuple[float, ...]) -> tuple[Model, float, bool]:
        """The model, the speed of 1 on the axis of speeds, and whether it is stable at every speed."""
        model = assemble(with_keys(rig, dict(zip(keys, values, strict=True))))
        unit = first_lateral_frequency(model) if "speed_ratio" in names else 1.0
        return model, unit, model.rotor.by_speed is None and is_passive(model.rotor)

    def rubs(point: Sequence[float]) -> bool:
        at = fixed | dict(zip(ranges, point, strict=True))
        model, unit, is_stable = model_of(tuple([at[key] for key in keys]))
        spin = unit * (at["speed_ratio"] if "speed_ratio" in at else at["speed"])
        if not is_stable and instability_message(model, spin):
            return True  # it grows until it touches
        ratio = at.get("clearance_ratio")
        clearance = at["clearance"] if ratio is None else ratio * contact_free_amplitude(model, spin)
        return contact_free_reach(model_at(model, spin), spin) > clearance

    return rubs


def _moves_reach(axis: Axis) -> bool:
    """Whether a key of the rig changes where the contact-free motion reaches a stator."""
    of_gap = axis.name.endswith((".node", ".angle", ".clearance_offset"))
    return axis.is_rig_key and (of_gap or axis.name.startswith("rotor."))
