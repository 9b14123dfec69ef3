"""The arguments that describe one case to a function of the library: rig, speed, clearance and laws."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from numbers import Integral
from typing import TYPE_CHECKING, Any, TypeVar, cast

from rubhpc.errors import InputError, located
from rubhpc.fem.assemble import assemble
from rubhpc.fem.response import contact_free_amplitude, first_lateral_frequency
from rubhpc.fem.stability import instability_message
from rubhpc.input.fields import parse_field
from rubhpc.input.messages import brief, nearest
from rubhpc.input.quantity import parse_quantity
from rubhpc.input.reading import build
from rubhpc.integrate.modal_setup import ModalSetup
from rubhpc.integrate.record import State
from rubhpc.integrate.setup import prepare
from rubhpc.models import chosen
from rubhpc.recent import recent
from rubhpc.rig.probes import Probe
from rubhpc.rig.reading import packaged_name, read_rig, with_keys
from rubhpc.rig.rig import Rig
from rubhpc.rig.stators import gap_problem
from rubhpc.study.contact_keys import Contact, ContactArguments
from rubhpc.study.initial import Initial
from rubhpc.study.state_of_case import with_state
from rubhpc.study.table_axes import check_initials
from rubhpc.study.tables import Integrator, Recording

if TYPE_CHECKING:
    from collections.abc import Sequence
    from os import PathLike

    from rubhpc.fem.model import Model
    from rubhpc.integrate.setup import Setup
    from rubhpc.study.drive_law import DriveLaw

T = TypeVar("T")

FRICTION = 0.3  # coefficient, where none is given
_FRICTIONS = 8  # of a set-up, whose contact modes are kept for further cases
AT_REST = Initial()


class CaseArguments(ContactArguments, total=False):
    """Arguments of `simulate` that describe a case, without its rig.

    Keys of the tables [contact] and [integrator] are read and checked as those tables declare them.
    """

    speed: float | str | None
    speed_ratio: float | None
    clearance: float | str | None
    clearance_ratio: float | None
    friction: float
    overrides: dict[str, float | str] | None
    method: str
    step: float | str | None
    accuracy: float


def check_count(caller: str, name: str, value: object, least: int, most: int | None = None) -> None:
    """Refuse an argument that is not a whole number within its limits."""
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise InputError(f"{caller}: {name}: {brief(value)} is not a whole number; give one such as {least}")
    if int(value) < least or (most is not None and int(value) > most):
        limits = f"at least {least}" if most is None else f"from {least} to {most}"
        raise InputError(f"{caller}: {name}: {value} is out of range; it must be {limits}")


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """One case, ready to be integrated."""

    rig: Rig
    contact: Contact
    integrator: Integrator
    setup: Setup
    clearance: float  # m
    friction: float
    contact_free_amplitude: float  # m; NaN of an unstable rotor
    initial: State | Initial
    note: str  # what is wrong with the rig at this speed, or ""


def recording_of(caller: str, *, keep: object = (), **keys: Any) -> Recording:
    """Return the table [record] of the arguments of `caller`; one name to `keep` needs no list."""
    names = [keep] if isinstance(keep, str) else keep
    with located(f"{caller}: "):
        if not isinstance(names, Iterable):
            raise InputError(f'keep: {brief(keep)} is not a list of names; give one such as ("section",)')
        return Recording(keep=tuple(names), **keys)


def pick(arguments: Mapping[str, object]) -> CaseArguments:
    """Those arguments of a function that describe its case."""
    return cast("CaseArguments", {name: arguments[name] for name in CaseArguments.__annotations__})


def case_of(
    caller: str,
    rig: Rig | str | PathLike[str],
    given: CaseArguments,
    *,
    samples_per_revolution: int,
    initial: object,
    probes: Sequence[Probe] = (),
    drive: DriveLaw | None = None,
) -> Case:
    """Check the arguments of `caller` and assemble its case; `drive` turns it where its speed is free.

    Calls with the same rig and speed share what they assemble, tables of contact modes included.
    """
    known = CaseArguments.__annotations__
    for name in given:
        if name not in known:
            raise InputError(f"{caller}: {name}: unknown argument; {nearest(name, known)}")
    start = _read_initial(caller, initial)
    known_by = None if isinstance(rig, Rig) else packaged_name(rig)  # its content never changes
    if not isinstance(rig, Rig):
        rig = read_rig(rig)
    measured = tuple(probes)
    case = recent(
        lambda: _assembled(caller, rig, given, samples_per_revolution, measured, drive),
        *("case", known_by or rig, given, samples_per_revolution, measured, drive),
    )
    return replace(case, initial=start)


def _assembled(
    caller: str,
    rig: Rig,
    given: CaseArguments,
    samples_per_revolution: int,
    probes: tuple[Probe, ...],
    drive: DriveLaw | None,
) -> Case:
    """Check and assemble all of a case but where it starts."""
    contact = _declared(Contact, given, caller)
    with located(f"{caller}: overrides: "):
        rig = with_keys(rig, given.get("overrides") or {})
    rig = rig.with_geometry(chosen("geometry", contact.model))
    speed, speed_ratio = given.get("speed"), given.get("speed_ratio")
    clearance, clearance_ratio = given.get("clearance"), given.get("clearance_ratio")
    if (speed is None) == (speed_ratio is None):
        raise InputError(f"{caller}: give either speed or speed_ratio")
    if (clearance is None) == (clearance_ratio is None):
        raise InputError(f"{caller}: give either clearance or clearance_ratio")
    model = recent(lambda: assemble(rig), "model", rig)
    if speed_ratio is not None:
        ratio = parse_quantity(speed_ratio, "", f"{caller}: speed_ratio")
        spin = ratio * recent(lambda: first_lateral_frequency(model), "first frequency", rig)
    else:
        spin = parse_quantity(speed, "rad/s", f"{caller}: speed")
    unstable, amplitude = recent(lambda: _without_contact(model, spin), "without contact", rig, spin)
    if clearance_ratio is not None:
        ratio = parse_quantity(clearance_ratio, "", f"{caller}: clearance_ratio")
        if unstable:
            raise InputError(f"{caller}: clearance_ratio: {unstable}; give clearance instead")
        if spin == 0.0:
            raise InputError(f"{caller}: speed: 0 rad/s; sampling is locked to the shaft, so it has to turn")
        gap = ratio * amplitude
    else:
        gap = parse_quantity(clearance, "m", f"{caller}: clearance")
    is_ratio = clearance_ratio is not None
    if problem := gap_problem(rig.stator, gap, is_ratio=is_ratio):
        raise InputError(f"{caller}: {'clearance_ratio' if is_ratio else 'clearance'}: {problem}")
    mu = parse_quantity(given.get("friction", FRICTION), "", f"{caller}: friction")
    if mu < 0:
        raise InputError(f"{caller}: friction: {mu:g} is out of range; it must be at least 0")
    integrator = _declared(Integrator, given, caller)
    setup = recent(
        lambda: prepare(
            rig,
            spin,
            contact=contact,
            integrator=integrator,
            samples_per_revolution=samples_per_revolution,
            model=model,
            probes=probes,
            drive=drive,
        ),
        *("set-up", rig, spin, contact, integrator, samples_per_revolution, probes, drive),
    )
    if isinstance(setup, ModalSetup):  # another friction may be asked for each time
        setup.forget_but(_FRICTIONS)
    return Case(
        rig=rig,
        contact=contact,
        integrator=integrator,
        setup=setup,
        clearance=gap,
        friction=mu,
        contact_free_amplitude=amplitude,
        initial=AT_REST,
        note=unstable,
    )


def _without_contact(model: Model, spin: float) -> tuple[str, float]:
    """What is wrong with a rotor at a speed, or "", and its amplitude there, m; NaN of an unstable one."""
    unstable = instability_message(model, spin)
    return unstable, math.nan if unstable else contact_free_amplitude(model, spin)


def read_probes(caller: str, probes: Sequence[Probe | Mapping[str, object]]) -> tuple[Probe, ...]:
    """Return probes, of which some may be given by their keys."""
    if isinstance(probes, Probe | Mapping):
        probes = [probes]
    return tuple(
        probe if isinstance(probe, Probe) else build(Probe, probe, caller, f"probes.{i}")
        for i, probe in enumerate(probes, 1)
    )


def _declared(kind: type[T], given: CaseArguments, caller: str) -> T:
    """A table of the study file from the arguments that are named as its keys; absent ones have defaults."""
    declared = {field.name: field for field in fields(cast("Any", kind))}
    values = {
        name: parse_field(declared[name], value, f"{caller}: {name}")
        for name, value in given.items()
        if name in declared and value is not None
    }
    with located(f"{caller}: "):
        return kind(**values)


def _read_initial(caller: str, initial: object) -> State | Initial:
    """Where to start."""
    if isinstance(initial, State):
        return initial
    if initial is None:
        return AT_REST
    if not isinstance(initial, dict):
        problem = "is neither a State nor a dict"
        raise InputError(f"{caller}: initial: {brief(initial)} {problem}; give a record's `final`")
    start = build(Initial, initial, caller, "initial")
    with located(f"{caller}: "):
        check_initials(start, [])
        return with_state(start) if start.is_from_store else start
