"""The arguments that describe one case to a function of the library: rig, speed, clearance and laws."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypedDict

from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble
from rubhpc.fem.response import contact_free_amplitude, first_lateral_frequency
from rubhpc.fem.stability import instability_message
from rubhpc.input.quantity import brief, parse_quantity
from rubhpc.input.reading import build
from rubhpc.integrate.record import State
from rubhpc.integrate.setup import prepare
from rubhpc.rig.reading import read_rig, with_keys
from rubhpc.rig.rig import Rig
from rubhpc.study.initial import Initial, check_initials
from rubhpc.study.study import Contact, Integrator

if TYPE_CHECKING:
    from collections.abc import Sequence
    from os import PathLike

    from rubhpc.integrate.setup import Setup


class CaseArguments(TypedDict, total=False):
    """What `simulate` takes to describe a case, but for its rig."""

    speed: float | str | None
    speed_ratio: float | None
    clearance: float | str | None
    clearance_ratio: float | None
    friction: float
    overrides: dict[str, float | str] | None
    law: str
    stiffness: float | str | None
    damping: float | str | None
    restitution: float | None
    friction_law: str
    static_friction_ratio: float | None
    stribeck_speed: float | str | None
    slip_speed: Sequence[float | str] | None
    friction_ratio: Sequence[float] | None
    normal: str
    method: str
    step: float | str | None
    accuracy: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """One case, ready to be integrated."""

    setup: Setup
    clearance: float  # m
    friction: float
    contact_free_amplitude: float  # m; NaN of an unstable rotor
    initial: State | Initial
    note: str  # what is wrong with the rig at this speed, or ""


def case_of(
    caller: str,
    rig: Rig | str | PathLike[str],
    *,
    samples_per_revolution: int,
    initial: object,
    speed: float | str | None = None,
    speed_ratio: float | None = None,
    clearance: float | str | None = None,
    clearance_ratio: float | None = None,
    friction: float = 0.3,
    overrides: dict[str, float | str] | None = None,
    law: str = "lagrange",
    stiffness: float | str | None = None,
    damping: float | str | None = None,
    restitution: float | None = None,
    friction_law: str = "sliding",
    static_friction_ratio: float | None = None,
    stribeck_speed: float | str | None = None,
    slip_speed: Sequence[float | str] | None = None,
    friction_ratio: Sequence[float] | None = None,
    normal: str = "fixed",
    method: str = "modal",
    step: float | str | None = None,
    accuracy: float = 1e-3,
) -> Case:
    """Check the arguments of `caller` and assemble its case.

    Raises
    ------
    InputError
        If an argument cannot be used; its text says which one and how to fix it.
    """
    start = _read_initial(caller, initial)
    if not isinstance(rig, Rig):
        rig = read_rig(rig)
    rig = with_keys(rig, overrides or {})
    if (speed is None) == (speed_ratio is None):
        raise InputError(f"{caller}: give speed or speed_ratio, one of the two")
    if (clearance is None) == (clearance_ratio is None):
        raise InputError(f"{caller}: give clearance or clearance_ratio, one of the two")
    model = assemble(rig)
    if speed_ratio is not None:
        ratio = parse_quantity(speed_ratio, "", f"{caller}: speed_ratio")
        spin = ratio * first_lateral_frequency(model)
    else:
        spin = parse_quantity(speed, "rad/s", f"{caller}: speed")
    unstable = instability_message(model, spin)
    amplitude = math.nan if unstable else contact_free_amplitude(model, spin)
    if clearance_ratio is not None:
        ratio = parse_quantity(clearance_ratio, "", f"{caller}: clearance_ratio")
        if unstable:
            raise InputError(f"{caller}: clearance_ratio: {unstable}; give clearance instead")
        gap = ratio * amplitude
    else:
        gap = parse_quantity(clearance, "m", f"{caller}: clearance")
    for stator in model.stators:
        if gap + stator.clearance_offset <= 0:
            offset = stator.clearance_offset
            problem = f"{gap:g} m and a stator's clearance_offset of {offset:g} m leave no gap"
            raise InputError(f"{caller}: clearance: {problem}; take a larger one")
    mu = parse_quantity(friction, "", f"{caller}: friction")
    if mu < 0:
        raise InputError(f"{caller}: friction: {mu:g} is out of range; it must be at least 0")
    numbers: dict[str, Any] = {
        name: None if value is None else parse_quantity(value, unit, f"{caller}: {name}")
        for name, value, unit in (
            ("stiffness", stiffness, "N/m"),
            ("damping", damping, "N*s/m"),
            ("restitution", restitution, ""),
            ("static_friction_ratio", static_friction_ratio, ""),
            ("stribeck_speed", stribeck_speed, "m/s"),
        )
    }
    table: dict[str, Any] = {
        name: None if values is None else tuple(parse_quantity(v, unit, f"{caller}: {name}") for v in values)
        for name, values, unit in (("slip_speed", slip_speed, "m/s"), ("friction_ratio", friction_ratio, ""))
    }
    contact = Contact(law=law, friction_law=friction_law, normal=normal, **numbers, **table)
    setup = prepare(
        rig,
        spin,
        contact=contact,
        integrator=Integrator(
            method=method,
            step=None if step is None else parse_quantity(step, "s", f"{caller}: step"),
            accuracy=accuracy,
        ),
        samples_per_revolution=samples_per_revolution,
        model=model,
    )
    return Case(
        setup=setup,
        clearance=gap,
        friction=mu,
        contact_free_amplitude=amplitude,
        initial=start,
        note=unstable,
    )


def _read_initial(caller: str, initial: object) -> State | Initial:
    """Where to start."""
    if isinstance(initial, State):
        return initial
    if initial is not None and not isinstance(initial, dict):
        problem = "is neither a State nor a dict"
        raise InputError(f"{caller}: initial: {brief(initial)} {problem}; give a record's `final`")
    start = build(Initial, initial or {}, caller, "initial")
    try:
        check_initials(start, [])
    except InputError as error:
        raise InputError(f"{caller}: {error}") from None
    return start
