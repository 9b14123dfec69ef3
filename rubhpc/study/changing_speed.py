"""What studies have in common whose speed changes within a case, by [run_up] or [drive]."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rubhpc.errors import InputError
from rubhpc.schema import STATE
from rubhpc.study.axes import FROM_REST, SPEED_AXES, Axis

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.study.tables import Integrator, Recording


def speed_axis(speed: float, long_name: str) -> Axis:
    """The axis that a study needs, of one speed (rad/s)."""
    return Axis(name="speed", dimension="speed", unit="rad s-1", values=(speed,), long_name=long_name)


def refuse_speeds(table: str, names: Sequence[str]) -> None:
    """Refuse an axis of speeds, whose place a table takes that changes the speed."""
    for name in names:
        if name in SPEED_AXES:
            raise InputError(f"[grid] {name}: conflicts with [{table}], which changes the speed; remove one")


def check_changing(
    table: str, axes: Sequence[Axis], integrator: Integrator, recording: Recording, others: str
) -> None:
    """Refuse what a changing speed has no meaning for; `others` names a table that leaves no room, or is "".

    Raises
    ------
    InputError
        It names the key.
    """
    if others:
        raise InputError(f"[{table}]: run-ups are not combined with [{others}]; remove one of them")
    if integrator.method != "modal":
        problem = f"{integrator.method} keeps the speed constant"
        raise InputError(f'[integrator] method: {problem}; set method = "modal", or remove [{table}]')
    for axis in axes:
        if axis.sweep != FROM_REST:
            raise InputError(f"[grid] {axis.name}: sweep: a run-up begins at its first speed; remove sweep")
    if "clearance_ratio" in [axis.name for axis in axes]:
        raise InputError("[grid] clearance_ratio: the speed changes; give clearance instead")
    if STATE in recording.keep:
        raise InputError(f'[record] keep: the state of a run-up is not stored; remove "{STATE}"')
