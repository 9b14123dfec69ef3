"""A study: a rig, the axes of a grid, and how each case is computed, recorded and run."""

from __future__ import annotations

import itertools
import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rubhpc.errors import InputError, located
from rubhpc.fem.assemble import assemble
from rubhpc.fem.probes import with_probes
from rubhpc.input.messages import brief, nearest, place, quoted
from rubhpc.input.quantity import parse_quantity
from rubhpc.input.reading import build, plain, read_toml, refuse_unknown
from rubhpc.models import SECOND_ORDER, chosen, in_words
from rubhpc.rig.reading import read_rig, with_keys
from rubhpc.rig.stators import gap_problem, geometries
from rubhpc.schema import VARIABLES
from rubhpc.study.axes import (
    BOTH,
    CLEARANCE_AXES,
    DIRECTION,
    FROM_REST,
    NO_NEIGHBOURS,
    SPEED_AXES,
    Axis,
    direction_axis,
)
from rubhpc.study.axis_reading import flatten, make_axis, make_range, unit_of
from rubhpc.study.branch_keys import BranchKeys, branch_axis, check_branch
from rubhpc.study.contact_keys import Contact, ContactKeys
from rubhpc.study.drive_keys import DriveKeys, check_drive, first_speed
from rubhpc.study.initial import CONTACT_FREE, Initial
from rubhpc.study.refine import Refine
from rubhpc.study.run_up_keys import RunUpKeys, check_forces, check_run_up, refuse_speeds, speed_axis
from rubhpc.study.sampling import draw
from rubhpc.study.state_of_case import with_state
from rubhpc.study.table_axes import check_contacts, check_initials, laws_of
from rubhpc.study.tables import Integrator, Recording, Run, Sample, check_method

if TYPE_CHECKING:
    from collections.abc import Iterable
    from os import PathLike

    from rubhpc.rig.probes import Probe
    from rubhpc.rig.rig import Rig
    from rubhpc.rig.stators import AnyStator


def line_of_text(table: dict[str, Any], key: str, default: str, file: str) -> str:
    """A key whose value is one line of text."""
    value = table.get(key, default)
    if not isinstance(value, str) or not value.strip() or not value.isprintable():
        raise InputError(f'{place(file, "", key)}: {brief(value)} is not a line of text; write {key} = "..."')
    return value


def table_of(table: dict[str, Any], key: str, file: str) -> dict[str, Any]:
    """A table by its name; empty where it is left out."""
    value = table.get(key, {})
    if not isinstance(value, dict):
        raise InputError(
            f"{place(file, key)}: {brief(value)} is not a table; write [{key}] and its keys below"
        )
    return value


def rig_of(table: dict[str, Any], source: Path, *, trust_rig: bool) -> Rig:
    """The rig that the tables of a file name, with the values of [override]."""
    file = str(source)
    name = line_of_text(table, "rig", "", file)
    rig = read_rig(name, source.parent, place(file, "", "rig"), trust_rig=trust_rig)
    with located(f"{place(file, 'override')} "):
        return with_keys(rig, dict(flatten(table_of(table, "override", file))))


def read_branch(table: dict[str, Any], grid: dict[str, Any], rig: Rig, file: str) -> BranchKeys:
    """Return the table [branch], its step in the unit of its axis."""
    along, step = table.get("along"), table.get("step")
    axes = dict(flatten(grid))
    if isinstance(along, str) and along not in axes:
        meant = nearest(along, axes)
        fix = meant if meant.startswith("did") else "add it as { start, stop }"
        raise InputError(f"{place(file, 'branch', 'along')}: {along} is not an axis of the grid; {fix}")
    if isinstance(along, str) and isinstance(step, str):
        where = place(file, "branch", "step")
        try:
            table = {**table, "step": parse_quantity(step, unit_of(along, rig), where)}
        except InputError as error:
            raise InputError(str(error) if where in str(error) else f"{where}: {error}") from None
    return build(BranchKeys, table, file, "branch")


def read_axes(
    table: dict[str, Any], rig: Rig, sample: Sample | None, file: str, along: str
) -> tuple[Axis, ...]:
    """The axes of [grid], those of a sample drawn; `along` is the axis of a branch."""
    pairs = flatten(table)
    names = [name for name, _ in pairs]
    if len(names) > _MOST_AXES:
        problem = f"{len(names)} axes are too many; use at most {_MOST_AXES}, and [override] for the others"
        raise InputError(f"{place(file, 'grid')}: {problem}")
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{place(file, 'grid', name)}: is duplicated; remove one")
    if sample is None:
        return tuple(
            (branch_axis if name == along else make_axis)(name, values, rig, file) for name, values in pairs
        )
    axes = [(make_range if isinstance(v, dict) else make_axis)(name, v, rig, file) for name, v in pairs]
    with located(f"{place(file)}: "):
        return draw(axes, sample, rig)


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
        where = ", ".join(f"{name} = {value:g}" for name, value in case.items())
        with located(f"[grid] {where}: invalid rig: " if case else ""):
            _check_rig(with_keys(rig, case), axes)
    if probes:  # of the first rig, since each is assembled for it
        chosen = with_keys(rig, {axis.name: axis.tried[0] for axis in rig_axes})
        model = assemble(chosen)
        with_probes(model, chosen, probes, next(iter(model.rotor.tabulated_speeds), 0.0))


def _check_rig(rig: Rig, axes: tuple[Axis, ...]) -> None:
    if not rig.stator:
        raise InputError(f"rig: {rig.name} has no stator to touch; add a [[stator]] to it")
    by_name = {axis.name: axis for axis in axes}
    forces = [*(u.mass * u.radius for u in rig.rotor.unbalance), *(h.force for h in rig.rotor.harmonic)]
    if "clearance_ratio" in by_name and not any(forces):
        problem = f"{rig.name} has no unbalance, so no contact-free amplitude"
        raise InputError(f"[grid] clearance_ratio: {problem}; give clearance instead, or an unbalance")
    if "clearance" in by_name:
        problem = gap_problem(rig.stator, min(by_name["clearance"].tried))
        if problem:
            raise InputError(f"[grid] clearance: {problem}")


_TABLES = (
    *("title", "rig", "output", "grid", "sample", "refine", "branch", "run_up", "drive", "override"),
    *("contact", "initial", "integrator", "record", "run"),
)
_MOST_AXES = 32  # arrays have 64 dimensions at most


@dataclass(frozen=True, kw_only=True)
class Study:
    """A rig and a grid of cases.

    Attributes
    ----------
    title : str
        For people.
    rig : Rig
        With the study's overrides applied, and the geometry of every beam stator stated.
    axes : tuple of Axis
        The cases are the Cartesian product of their dimensions, the last one running fastest. An axis that is
        swept in both directions adds a last one, `direction`.
    sample : Sample or None
        How some of the axes have been drawn (`rubhpc.study.sampling.draw`).
    refine : Refine or None
        Which cases are computed, where the others are inferred; it changes the result of no case.
    branch : BranchKeys or None
        Along which axis periodic motions are followed; that axis has one case, and `drawn_from` is its range.
    run_up : RunUpKeys or None
        How the spin speed changes within every case; the axis of speeds then holds the highest one alone.
    drive : DriveKeys or None
        What turns the rotor where its speed is free; the axis of speeds then holds the first one alone.
    contact : ContactKeys
        A `Contact`; with contact axes, the keys that no axis sets, as far as they apply to the law of a case.
    initial : Initial
        Where cases start, apart from initial axes; a state of a store is read here.
    output : Path
        The store.
    source : Path or None
        The file that the study was read from.

    Raises
    ------
    InputError
        When the grid lacks an axis, has two for one quantity, or has values that make the rig invalid.
    """

    title: str
    rig: Rig
    axes: tuple[Axis, ...]
    sample: Sample | None = None
    refine: Refine | None = None
    branch: BranchKeys | None = None
    run_up: RunUpKeys | None = None
    drive: DriveKeys | None = None
    contact: ContactKeys = field(default_factory=Contact)
    initial: Initial = field(default_factory=Initial)
    integrator: Integrator = field(default_factory=Integrator)
    recording: Recording = field(default_factory=Recording)
    run: Run = field(default_factory=Run)
    output: Path
    source: Path | None = None

    def __post_init__(self) -> None:
        if not self.output.name:  # "/" or "."
            problem = f"{brief(str(self.output))} does not name a store"
            raise InputError(f'output: {problem}; write output = "my_study.zarr", or another path')
        object.__setattr__(self, "rig", self.rig.with_geometry(chosen("geometry", self.contact.model)))
        if any(axis.sweep == BOTH for axis in self.axes) and self.axes[-1].name != DIRECTION:
            object.__setattr__(self, "axes", (*self.axes, direction_axis()))
        if self.initial.is_from_store:
            object.__setattr__(self, "initial", with_state(self.initial))
        tables = {"refine": self.refine, "branch": self.branch}
        others = next((name for name, table in tables.items() if table is not None), "")
        check_run_up(self.run_up, self.axes, self.integrator, self.recording, others)
        others = others or ("run_up" if self.run_up is not None else "")
        check_drive(self.drive, self.axes, self.integrator, self.recording, others)
        if self.run_up is not None or self.drive is not None:
            check_forces(self.rig)
        check_axes(self.axes)
        if self.refine is not None:
            self.refine.refined(self.axes)
        contacts = check_contacts(self.contact, [axis for axis in self.axes if axis.table == "contact"])
        check_initials(self.initial, [axis for axis in self.axes if axis.table == "initial"])
        if self.branch is not None:
            beside = [name for name in ("sample", "refine") if getattr(self, name) is not None]
            check_branch(self.branch, self.axes, self.integrator, self.recording, beside)
        check_rigs(self.rig, self.axes, self.recording.probe)
        for contact in contacts:
            check_method(contact, self.integrator, is_bent=self.has_bent_stator, stators=self._freest_stators)

    @property
    def has_bent_stator(self) -> bool:
        """Whether the gap of a stator knows that it bends, in any case."""
        return SECOND_ORDER in geometries(self._freest_stators)

    @property
    def model(self) -> str:
        """The normal, friction law and geometry of stators that its cases use, in words."""
        normals, laws = (laws_of(self.contact, self.axes, k) for k in ("normal", "friction_law"))
        return in_words(normals, laws, geometries(self._freest_stators))

    @property
    def _freest_stators(self) -> tuple[AnyStator, ...]:
        """The stators, free to bend where they are in some cases."""
        freest = {a.name: max(a.tried) for a in self.axes if a.is_rig_key and a.name.endswith(".lateral")}
        return with_keys(self.rig, freest).stator

    @property
    def changes_speed(self) -> bool:
        """Whether the speed changes within a case."""
        return self.run_up is not None or self.drive is not None

    def axis(self, *names: str) -> Axis:
        """Return the first axis that has one of these names."""
        return next(axis for axis in self.axes if axis.name in names)

    def as_dict(self) -> dict[str, Any]:
        """Return what the study computes as plain dicts, lists, numbers and text, for JSON.

        Where and how it is run is left out: two runs of one study give the same.
        """
        own = {"branch": self.branch, "run_up": self.run_up, "drive": self.drive}
        return {
            "title": self.title,
            "rig": self.rig.name,
            "grid": {
                axis.name: {"unit": axis.unit}
                | (asdict(axis.drawn_from) if axis.drawn_from else {"values": [*(axis.words or axis.values)]})
                | ({"sweep": axis.sweep} if axis.sweep != FROM_REST else {})
                for axis in self.axes
                if axis.name != DIRECTION and not (self.changes_speed and axis.name in SPEED_AXES)
            },
            **({"sample": self.sample.as_dict()} if self.sample else {}),
            **{name: asdict(keys) for name, keys in own.items() if keys},
            "contact": {
                key: value
                for key, value in asdict(self.contact).items()
                if value is not None and f"contact.{key}" not in {axis.name for axis in self.axes}
            },
            **({"initial": plain(self.initial)} if self.initial != Initial() else {}),
            "integrator": asdict(self.integrator),
            "record": self.recording.as_dict() | {"keep": list(self.recording.keep)},
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
        When the file or its rig is invalid; one line with file, table, key and how to fix it.
    """
    return study_of(read_toml(Path(path)), Path(path), output, trust_rig=trust_rig)


def study_of(
    table: dict[str, Any],
    source: Path,
    output: str | PathLike[str] | None = None,
    *,
    trust_rig: bool = False,
) -> Study:
    """Return the study of the tables of a file; see `read_study`."""
    file = str(source)
    if "rotor" in table:
        raise InputError(
            f"{place(file)}: is a rig, not a study; name it in a study, rig = {quoted([source.name])}, "
            f"or see rubhpc modes {source.name}"
        )
    refuse_unknown(table, dict.fromkeys(_TABLES), file, "")
    title = line_of_text(table, "title", source.stem, file)
    store = output if output is not None else line_of_text(table, "output", f"{source.stem}.zarr", file)
    if "rig" not in table:
        raise InputError(
            f'{place(file, "", "rig")}: missing; add rig = "mokhtar2017", or the path of a rig file'
        )
    rig = rig_of(table, source, trust_rig=trust_rig)
    kinds = {"sample": Sample, "refine": Refine, "run_up": RunUpKeys, "drive": DriveKeys}
    given: Any = {name: build(kinds[name], table[name], file, name) for name in kinds if name in table}
    sample, run_up, drive = given.get("sample"), given.get("run_up"), given.get("drive")
    grid = table_of(table, "grid", file)
    branch = read_branch(table_of(table, "branch", file), grid, rig, file) if "branch" in table else None
    axes = read_axes(grid, rig, sample, file, branch.along if branch else "")
    with located(f"{place(file)}: "):
        if run_up is not None:
            refuse_speeds("run_up", [axis.name for axis in axes])
            axes = (*axes, speed_axis(run_up.highest, "highest spin speed"))
        elif drive is not None:
            refuse_speeds("drive", [axis.name for axis in axes])
            axes = (*axes, speed_axis(first_speed(drive, axes), "first spin speed"))
    for name in {axis.name for axis in axes} & dict(flatten(table.get("override", {}))).keys():
        raise InputError(f"{place(file, 'override', name)}: is also an axis of the grid; remove one")
    for name in ("contact", "initial"):
        for key in table_of(table, name, file):
            if f"{name}.{key}" in {axis.name for axis in axes}:
                raise InputError(f"{place(file, name, key)}: is also an axis of the grid; remove one")
    is_varied = any(axis.table == "contact" for axis in axes)
    contact = build(ContactKeys if is_varied else Contact, table.get("contact", {}), file, "contact")
    starts = {"from": CONTACT_FREE} if run_up is not None or drive is not None else {}
    initial = build(Initial, starts | table_of(table, "initial", file), file, "initial")
    integrator = build(Integrator, table.get("integrator", {}), file, "integrator")
    recording = build(Recording, table.get("record", {}), file, "record")
    run = build(Run, table.get("run", {}), file, "run")
    with located(f"{place(file)}: "):
        return Study(
            title=title,
            rig=rig,
            axes=axes,
            branch=branch,
            **given,
            contact=contact,
            initial=initial,
            integrator=integrator,
            recording=recording,
            run=run,
            output=Path(store),
            source=source,
        )
