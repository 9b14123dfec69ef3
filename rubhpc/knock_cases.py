"""Least knocks of the cases of a study: one by one, kept, and put together."""

from __future__ import annotations

import glob
import hashlib
import json
import math
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.errors import InputError, reason_of
from rubhpc.fem.assemble import assemble
from rubhpc.fem.response import check_response_node, first_lateral_frequency
from rubhpc.integrate.case import compile_kernels, run_case
from rubhpc.integrate.setup import prepare
from rubhpc.knock_search import Direction, find_least
from rubhpc.schema import DONE, REGIME, described
from rubhpc.study.cases import CaseGrid
from rubhpc.study.initial import CONTACT_FREE, Initial

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    import xarray as xr

    from rubhpc.fem.model import Model
    from rubhpc.study.cases import Case
    from rubhpc.study.study import Study

    Index = tuple[int, ...]

_LOW, _HIGH = 0.02, 10.0  # first and last impulse tried, over mass x first frequency x clearance


def _value(default: float, unit: str, about: str) -> Any:
    return field(default=default, metadata={"unit": unit, "about": about})


@dataclass(frozen=True, kw_only=True)
class LeastKnock:
    """What is found of one case, SI units; NaN and node 0 (the output node) where no knock leads to rub."""

    least_impulse: float = _value(math.nan, "N s", "least impulse that leads to rub")
    harmless_impulse: float = _value(math.nan, "N s", "largest impulse below it that did not")
    worst_angle: float = _value(
        math.nan, "rad", "direction of the least impulse, from straight up in the sense of positive spin"
    )
    worst_node: int = _value(0, "1", "node of the least impulse (0: the output node)")
    knocks: int = _value(0, "1", "knocks computed")
    has_contact_free_motion: bool = _value(False, "1", "whether the machine can run free of contact")


@dataclass(frozen=True, kw_only=True)
class Search:
    """How the cases of a study are searched; see `rubhpc.least_knock`."""

    study: Study
    angles: int
    nodes: tuple[int, ...]
    most: float | None
    tolerance: float

    @cached_property
    def grid(self) -> CaseGrid:
        """The cases, whose own starts are left out."""
        return CaseGrid(replace(self.study, initial=Initial(), refine=None))

    def key(self, index: Index) -> str:
        """What identifies the result of a case: the case, and how it is searched."""
        how = (self.grid.case(index).id, self.angles, self.nodes, self.most, self.tolerance)
        return hashlib.sha256(repr(how).encode()).hexdigest()[:32]

    def left(self, found: Mapping[str, LeastKnock]) -> list[Index]:
        """Indices of the cases of which no result is there."""
        return [index for index in np.ndindex(self.grid.shape) if self.key(index) not in found]

    def of_case(self, index: Index) -> LeastKnock:
        """Search one case."""
        knocks = _Knocks(self.study, self.grid.case(index), self.nodes)
        if not knocks.has_contact_free_motion():
            return LeastKnock()
        directions = [
            Direction(2 * math.pi * i / self.angles, node)
            for node in (self.nodes or (None,))
            for i in range(self.angles)
        ]
        high = self.most if self.most is not None else _HIGH * knocks.scale
        found = find_least(knocks, directions, min(_LOW * knocks.scale, high), high, self.tolerance)
        worst = found.direction
        return LeastKnock(
            least_impulse=found.impulse,
            harmless_impulse=found.harmless,
            worst_angle=math.nan if worst is None else worst.angle,
            worst_node=0 if worst is None else worst.node or 0,
            knocks=found.n_tried,
            has_contact_free_motion=True,
        )

    def compile(self) -> None:
        """Compile what the search calls: processes that do so at the same time disturb one another."""
        _Knocks(self.study, self.grid.case((0,) * len(self.grid.shape)), self.nodes).compile()


class Progress:
    """Results of cases as lines of a file, from which an interrupted search goes on.

    Parameters
    ----------
    path : Path or None
        None keeps nothing.
    rank : int
        Each rank has a file of its own; all are read.
    """

    def __init__(self, path: Path | None, rank: int = 0) -> None:
        self._files = [] if path is None else [path, *sorted(path.parent.glob(f"{glob.escape(path.name)}.*"))]
        self._path = path if path is None or rank == 0 else path.with_name(f"{path.name}.{rank}")
        self.found: dict[str, LeastKnock] = {}
        for file in self._files:
            self._read(file)

    def _read(self, path: Path) -> None:
        if not path.exists():
            return
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
            try:  # the last line of a search that was killed may be a part of one
                entry = json.loads(line)
                key = entry.pop("key")
                self.found[key] = LeastKnock(**entry)
            except (ValueError, TypeError, KeyError, AttributeError):
                continue

    def forget(self) -> None:
        """Remove the files."""
        for file in self._files:
            file.unlink(missing_ok=True)

    def enter(self, key: str, found: LeastKnock) -> None:
        """Keep a result."""
        self.found[key] = found
        if self._path is None:
            return
        try:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(f"\n{json.dumps({'key': key} | asdict(found))}\n")
        except OSError as error:
            raise InputError(
                f"{self._path}: cannot be written ({reason_of(error, self._path)}); choose another place"
            ) from None


def search_of(
    study: Study, *, angles: int, nodes: Sequence[int], most: float | None, tolerance: float
) -> Search:
    """Return the search of a study's cases; see `rubhpc.least_knock`."""
    if starts := [axis.name for axis in study.axes if axis.table == "initial"]:
        raise InputError(f"[grid] {starts[0]}: the knock itself is searched for; remove this axis")
    tables = {"branch": study.branch, "run_up": study.run_up, "drive": study.drive}
    for table, found in tables.items():
        if found is not None:
            raise InputError(f"[{table}]: knocks are searched for at a constant speed; remove this table")
    if angles < 1 or not 0.0 < tolerance < 1.0 or (most is not None and not most > 0.0):
        raise InputError(f"angles {angles}, tolerance {tolerance:g}, most {most}: give numbers above 0")
    return Search(study=study, angles=angles, nodes=tuple(nodes), most=most, tolerance=tolerance)


def dataset_of(search: Search, found: Mapping[str, LeastKnock]) -> xr.Dataset:
    """Return the results of all cases, by their keys, over the axes of the study."""
    import xarray as xr

    study, grid = search.study, search.grid
    results = [found[search.key(index)] for index in np.ndindex(grid.shape)]
    variables = {
        field.name: (
            grid.dims,
            np.array([getattr(one, field.name) for one in results]).reshape(grid.shape),
            described(field.metadata["unit"], field.metadata["about"]),
        )
        for field in fields(LeastKnock)
    }
    coords = {
        axis.coordinate: (axis.dimension, np.array(axis.values), described(axis.unit or "1", axis.long_name))
        for axis in study.axes
    }
    return xr.Dataset(variables, coords, attrs={"title": study.title})


def impulse_scale(model: Model, reach: float) -> float:
    """Return mass x first lateral frequency x reach (m), N s: a knock that moves the rotor about that far."""
    return model.rotor.total_mass * first_lateral_frequency(model) * reach


def knocked(impulse: float, direction: Direction) -> Initial:
    """Return a start in the contact-free motion with an impulse, N s."""
    angle, node = direction if impulse else (0.0, None)
    return Initial(from_=CONTACT_FREE, impulse=impulse, impulse_angle=angle, impulse_node=node)


class _Knocks:
    """Knocks on one case; as a function of impulse and direction, whether one leads to rub."""

    def __init__(self, study: Study, case: Case, nodes: Sequence[int]) -> None:
        self._case: Any = {
            "clearance": case.clearance,
            "friction": case.friction,
            "recording": replace(study.recording, keep=()),
        }
        model = assemble(case.rig)
        for node in nodes:
            check_response_node(model, node, "node")
        self._setup = prepare(
            case.rig,
            case.speed,
            contact=case.contact,
            integrator=study.integrator,
            samples_per_revolution=study.recording.samples_per_revolution,
            model=model,
        )
        self.scale = impulse_scale(model, abs(case.clearance) or case.contact_free_amplitude)

    def compile(self) -> None:
        """Compile what a knock calls."""
        compile_kernels(self._setup, **self._case)

    def has_contact_free_motion(self) -> bool:
        """Whether the case stays free of contact without a knock."""
        return not self(0.0, Direction(0.0, None))

    def __call__(self, impulse: float, direction: Direction) -> bool:
        """Whether a knock leads to rub: contact in the recorded revolutions."""
        record = run_case(self._setup, **self._case, initial=knocked(impulse, direction))
        return record.status != DONE or record.measures["regime"] != REGIME.index("no_contact")
