"""A study: a rig, the axes of a grid, and how each case is computed, recorded and run."""

from __future__ import annotations

import itertools
import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rubhpc.axes import CLEARANCE_AXES, SPEED_AXES, Axis, flatten, make_axis
from rubhpc.errors import InputError
from rubhpc.input.fields import FieldError, check_fields, choice, choices, count, place, quantity
from rubhpc.input.quantity import brief
from rubhpc.input.reading import build, read_toml, refuse_unknown
from rubhpc.rig import Rig, read_rig, with_keys
from rubhpc.schema import KEEPABLE, VARIABLES

if TYPE_CHECKING:
    from collections.abc import Iterable
    from os import PathLike

__all__ = ["Axis", "Contact", "Integrator", "Recording", "Run", "Study", "make_axis", "read_study"]

_TABLES = ("title", "rig", "output", "grid", "override", "contact", "integrator", "record", "run")
AUTO = "auto"  # transient until the motion has settled
LONGEST_TRANSIENT, SETTLED_WITHIN = 240, 1e-4  # then
PAPER_STEP = 0.5e-6  # s
SAFE_SHARE = 0.9  # of the stability limit
BLIND_STEP = 1e-6  # s, of the modal scheme with the fixed normal
TURNING_STEP = 0.25e-6  # s, with the updated one, set-valued friction or a penalty
# Names that a store takes for itself; an axis `clearance` is the very setting of that name.
_RESERVED = (set(VARIABLES) | {"stator", "sample", "order", "section", "revolution"}) - {"clearance"}
_MOST_RIGS = 4096  # tried out one by one; of more, only those along each axis


@dataclass(frozen=True, kw_only=True)
class Contact:
    """Laws of contact and friction, and which way the normal points.

    Attributes
    ----------
    law : {"lagrange", "penalty"}
        Gaps closed exactly, by multipliers; or the conventional spring and damper in the closed gap.
    stiffness, damping : float, N/m and N s/m
        Of the penalty.
    restitution : float
        Normal velocity after an impact over that before it, 0 to 1. Default: none, the gap is closed at once.
    friction_law : {"sliding", "coulomb"}
        Steady sliding, in the sense of the spin; or set-valued, with stick and reversal of the slip.
    static_friction_ratio : float
        Coefficient of friction at rest over that in sliding, 1 or more. Default 1.
    normal : {"fixed", "updated"}
        Along the stator's axis, or along the line of centres.
    """

    law: str = choice(of=("lagrange", "penalty"), default="lagrange")
    stiffness: float | None = quantity("N/m", default=None, above=0)
    damping: float | None = quantity("N*s/m", default=None, at_least=0)
    restitution: float | None = quantity("", default=None, at_least=0)
    friction_law: str = choice(of=("sliding", "coulomb"), default="sliding")
    static_friction_ratio: float | None = quantity("", default=None, at_least=1)
    normal: str = choice(of=("fixed", "updated"), default="fixed")

    def __post_init__(self) -> None:
        check_fields(self)
        if self.law == "penalty":
            if self.stiffness is None:
                raise FieldError("stiffness", "missing; a penalty needs one, such as stiffness = 1e8")
            if self.restitution is not None:
                problem = "a penalty's rebound comes from its spring and damper; leave it out"
                raise FieldError("restitution", problem)
        for key in ("stiffness", "damping"):
            if self.law == "lagrange" and getattr(self, key) is not None:
                raise FieldError(key, 'a multiplier has none; take law = "penalty", or leave it out')
        if self.restitution is not None and self.restitution > 1:
            raise FieldError("restitution", f"{self.restitution:g} is out of range; it must be at most 1")
        if self.static_friction_ratio is not None and self.friction_law != "coulomb":
            problem = 'steady sliding never sticks; take friction_law = "coulomb", or leave it out'
            raise FieldError("static_friction_ratio", problem)

    @property
    def is_stepped(self) -> bool:
        """Whether closed contacts have no closed form, so that the modal scheme takes short steps."""
        return self.normal == "updated" or self.law == "penalty" or self.friction_law == "coulomb"


@dataclass(frozen=True, kw_only=True)
class Integrator:
    """Scheme, time step and accuracy.

    Without a step the modal scheme takes 1 us in contact (0.25 us with the updated normal, set-valued
    friction or a penalty), the central difference 0.5 us, or 0.9 of the stability limit where that is less.
    The accuracy (relative) sets how many modes the modal scheme keeps.
    """

    method: str = choice(of=("modal", "central-difference"), default="modal")
    step: float | None = quantity("s", default=None, above=0)
    accuracy: float = quantity("", default=1e-3, above=0, below=1)

    def __post_init__(self) -> None:
        check_fields(self)

    def contact_step(self, contact: Contact) -> float:
        """Step in contact, s, of the modal scheme."""
        if self.step is not None:
            return self.step
        return TURNING_STEP if contact.is_stepped else BLIND_STEP

    def step_within(self, limit: float) -> float:
        """Time step, s, of the central difference for matrices that are stable up to `limit`, s."""
        return self.step if self.step is not None else min(PAPER_STEP, SAFE_SHARE * limit)


@dataclass(frozen=True, kw_only=True)
class Recording:
    """How long a case runs, in revolutions, and what is kept of it."""

    transient: int | str = count(default=120, at_least=0, at_most=1_000_000, or_word=AUTO)
    transient_limit: int | None = count(default=None, at_most=1_000_000)  # with "auto": 240
    transient_tolerance: float | None = quantity("", default=None, above=0, below=1)  # with "auto": 1e-4
    revolutions: int = count(default=64, at_most=100_000)
    samples_per_revolution: int = count(default=256, at_least=16, at_most=65_536)
    keep: tuple[str, ...] = choices(of=KEEPABLE, default=KEEPABLE)

    def __post_init__(self) -> None:
        check_fields(self)
        if self.samples_per_revolution % 2:
            problem = f"{self.samples_per_revolution} is odd; give an even number such as 256"
            raise FieldError("samples_per_revolution", problem)
        for key in ("transient_limit", "transient_tolerance"):
            if self.transient != AUTO and getattr(self, key) is not None:
                raise FieldError(key, f'it goes with transient = "{AUTO}"; leave it out, or set that')

    @property
    def is_transient_auto(self) -> bool:
        """Whether the transient ends where the motion has settled."""
        return self.transient == AUTO

    @property
    def longest_transient(self) -> int:
        """Revolutions thrown away at most."""
        if isinstance(self.transient, str):
            return LONGEST_TRANSIENT if self.transient_limit is None else self.transient_limit
        return self.transient

    @property
    def settled_within(self) -> float:
        """Share of a signal's largest value by which cycles may differ for the motion to have settled."""
        return SETTLED_WITHIN if self.transient_tolerance is None else self.transient_tolerance


@dataclass(frozen=True, kw_only=True)
class Run:
    """How the study is run; nothing here changes results."""

    block: int | None = count(default=None, at_most=1_000_000)  # cases per work unit and stored chunk
    time_limit: float | None = quantity("s", default=None, above=0)
    case_time_limit: float | None = quantity("s", default=None, above=0)
    max_failures: int | None = count(default=None, at_least=0)

    def __post_init__(self) -> None:
        check_fields(self)


DEFAULT_CONTACT, DEFAULT_INTEGRATOR, DEFAULT_RECORDING, DEFAULT_RUN = (
    Contact(),
    Integrator(),
    Recording(),
    Run(),
)


@dataclass(frozen=True, kw_only=True)
class Study:
    """A rig and a grid of cases.

    Attributes
    ----------
    title : str
        For people.
    rig : Rig
        With the study's overrides applied.
    axes : tuple of Axis
        The cases are their Cartesian product, the last axis running fastest.
    output : Path
        The store.
    source : Path or None
        The file that the study was read from.

    Raises
    ------
    InputError
        When the grid lacks an axis, has two for one thing, or holds values with which the rig cannot be.
    """

    title: str
    rig: Rig
    axes: tuple[Axis, ...]
    contact: Contact = DEFAULT_CONTACT
    integrator: Integrator = DEFAULT_INTEGRATOR
    recording: Recording = DEFAULT_RECORDING
    run: Run = DEFAULT_RUN
    output: Path
    source: Path | None = None

    def __post_init__(self) -> None:
        _check_axes(self.axes)
        _check_rigs(self.rig, [axis for axis in self.axes if axis.is_rig_key], self.axes)

    def axis(self, *names: str) -> Axis:
        """Return the first axis that has one of these names."""
        return next(axis for axis in self.axes if axis.name in names)

    def as_dict(self) -> dict[str, Any]:
        """Return what the study computes as plain dicts, lists, numbers and text, for JSON.

        Where and how it is run is left out: two runs of one study give the same.
        """
        return {
            "title": self.title,
            "rig": self.rig.name,
            "grid": {axis.name: {"unit": axis.unit, "values": list(axis.values)} for axis in self.axes},
            "contact": {key: value for key, value in asdict(self.contact).items() if value is not None},
            "integrator": asdict(self.integrator),
            "record": asdict(self.recording) | {"keep": list(self.recording.keep)},
        }


def read_study(
    path: str | PathLike[str], output: str | PathLike[str] | None = None, *, trust_rig: bool = False
) -> Study:
    """Return the study of a TOML file.

    Parameters
    ----------
    path : path
        The study file; a relative path of a rig file in it counts from its folder.
    output : path, optional
        The store, in place of the one that the file names.
    trust_rig : bool
        Whether a rig that is Python code, `rig = "my_rig.py:build"`, may be run.

    Raises
    ------
    InputError
        When the file or its rig cannot be used as it stands; one line with file, table, key and mend.
    """
    source = Path(path)
    file = str(source)
    table = read_toml(source)
    refuse_unknown(table, dict.fromkeys(_TABLES), file, "")
    title = _text(table, "title", source.stem, file)
    store = output if output is not None else _text(table, "output", f"{source.stem}.zarr", file)
    if "rig" not in table:
        raise InputError(
            f'{place(file, "", "rig")}: missing; add rig = "mokhtar2017", or the path of a rig file'
        )
    rig = read_rig(_text(table, "rig", "", file), source.parent, place(file, "", "rig"), trust_rig=trust_rig)
    rig = _overridden(rig, _table(table, "override", file), file)
    axes = _read_axes(_table(table, "grid", file), rig, file)
    for name in {axis.name for axis in axes} & dict(flatten(table.get("override", {}))).keys():
        raise InputError(f"{place(file, 'override', name)}: is an axis of the grid too; leave one out")
    contact = build(Contact, table.get("contact", {}), file, "contact")
    integrator = build(Integrator, table.get("integrator", {}), file, "integrator")
    recording = build(Recording, table.get("record", {}), file, "record")
    run = build(Run, table.get("run", {}), file, "run")
    try:
        return Study(
            title=title,
            rig=rig,
            axes=axes,
            contact=contact,
            integrator=integrator,
            recording=recording,
            run=run,
            output=Path(store),
            source=source,
        )
    except InputError as error:
        raise InputError(f"{place(file)}: {error}") from None


def _text(table: dict[str, Any], key: str, default: str, file: str) -> str:
    value = table.get(key, default)
    if not isinstance(value, str) or not value.strip() or not value.isprintable():
        raise InputError(f'{place(file, "", key)}: {brief(value)} is not a line of text; write {key} = "..."')
    return value


def _table(table: dict[str, Any], key: str, file: str) -> dict[str, Any]:
    value = table.get(key, {})
    if not isinstance(value, dict):
        raise InputError(f"{place(file, key)}: {brief(value)} is no table; write [{key}] and its keys below")
    return value


def _overridden(rig: Rig, table: dict[str, Any], file: str) -> Rig:
    try:
        return with_keys(rig, dict(flatten(table)))
    except InputError as error:
        raise InputError(f"{place(file, 'override')} {error}") from None


def _read_axes(table: dict[str, Any], rig: Rig, file: str) -> tuple[Axis, ...]:
    pairs = flatten(table)
    names = [name for name, _ in pairs]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{place(file, 'grid', name)}: stands twice; leave one out")
    return tuple(make_axis(name, values, rig, file) for name, values in pairs)


def _check_axes(axes: tuple[Axis, ...]) -> None:
    names = [axis.name for axis in axes]
    for ways, example in (
        (SPEED_AXES, "speed_ratio = [0.75, 1.5]"),
        (CLEARANCE_AXES, "clearance_ratio = 0.7"),
        (("friction",), "friction = 0.3"),
    ):
        given = [name for name in names if name in ways]
        if not given:
            raise InputError(f"[grid] {ways[0]}: missing; add {' or '.join(ways)}, such as {example}")
        if len(given) > 1:
            raise InputError(f"[grid] {given[1]}: stands beside {given[0]}; give one of them")
    taken: dict[str, str] = {}
    for axis in axes:
        if axis.dimension in _RESERVED:
            mend = "name one stator, such as stator.1.lateral" if axis.is_rig_key else "leave it out"
            raise InputError(f"[grid] {axis.name}: a store has another {axis.dimension}; {mend}")
        if axis.dimension in taken:
            raise InputError(
                f"[grid] {axis.name}: is the same dimension as {taken[axis.dimension]}; leave one out"
            )
        taken[axis.dimension] = axis.name
        for other in axes:
            without_numbers = ".".join(part for part in axis.name.split(".") if not part.isdigit())
            if other.name == without_numbers != axis.name:
                raise InputError(f"[grid] {axis.name}: is set by the axis {other.name} too; leave one out")


def _check_rigs(rig: Rig, rig_axes: list[Axis], axes: tuple[Axis, ...]) -> None:
    """Refuse a grid some of whose rigs cannot be, or cannot be studied."""
    names = [axis.name for axis in rig_axes]
    grid: Iterable[tuple[float, ...]]
    if math.prod(len(axis.values) for axis in rig_axes) <= _MOST_RIGS:
        grid = itertools.product(*(axis.values for axis in rig_axes))
    else:
        first = [axis.values[0] for axis in rig_axes]
        grid = itertools.chain.from_iterable(
            ((*first[:i], value, *first[i + 1 :]) for value in axis.values) for i, axis in enumerate(rig_axes)
        )
    for values in grid:
        case = dict(zip(names, values, strict=True))
        try:
            _check_rig(with_keys(rig, case), axes)
        except InputError as error:
            if not case:
                raise
            told = ", ".join(f"{name} = {value:g}" for name, value in case.items())
            raise InputError(f"[grid] {told}: the rig cannot be so: {error}") from None


def _check_rig(rig: Rig, axes: tuple[Axis, ...]) -> None:
    if not rig.stator:
        raise InputError(f"rig: {rig.name} has no stator to touch; add a [[stator]] to it")
    by_name = {axis.name: axis for axis in axes}
    if "clearance_ratio" in by_name and not any(u.mass * u.radius for u in rig.rotor.unbalance):
        problem = f"{rig.name} has no unbalance, so no contact-free amplitude"
        raise InputError(f"[grid] clearance_ratio: {problem}; give clearance instead, or an unbalance")
    if "clearance" in by_name:
        least = min(by_name["clearance"].values)
        offset = min(stator.clearance_offset for stator in rig.stator)
        if least + offset <= 0:
            problem = f"{least:g} m and a stator's clearance_offset of {offset:g} m leave no gap"
            raise InputError(f"[grid] clearance: {problem}; give a larger clearance")
