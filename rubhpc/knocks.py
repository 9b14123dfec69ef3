"""The least knock that takes a machine from its contact-free motion to a rub that stays."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble
from rubhpc.fem.response import check_response_node, first_lateral_frequency
from rubhpc.integrate.case import run_case
from rubhpc.integrate.setup import prepare
from rubhpc.schema import DONE, REGIME
from rubhpc.study.cases import CaseGrid
from rubhpc.study.initial import CONTACT_FREE, Initial
from rubhpc.threads import on_one_thread

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import xarray as xr

    from rubhpc.study.cases import Case
    from rubhpc.study.study import Study

_RATIO = 1.25  # of one impulse tried to the one before
_LOW, _HIGH = 0.02, 10.0  # first and last impulse tried, over mass x first frequency x clearance


class Direction(NamedTuple):
    """Where a knock acts: angle from straight up, rad, and node, or None for the output node."""

    angle: float
    node: int | None


@dataclass(frozen=True, kw_only=True)
class Found:
    """The least knock.

    Attributes
    ----------
    impulse : float
        The smallest that leads to rub, N s; NaN where none does.
    harmless : float
        The largest below it of which no direction leads to rub, as far as it was tried, N s.
    direction : Direction or None
        Of the smallest.
    n_tried : int
        Knocks computed.
    """

    impulse: float
    harmless: float
    direction: Direction | None
    n_tried: int


def find_least(
    leads_to_rub: Callable[[float, Direction], bool],
    directions: Sequence[Direction],
    low: float,
    high: float,
    tolerance: float,
) -> Found:
    """Return the least impulse that leads to rub in any of some directions.

    Each impulse tried is a quarter larger than the one before, so that a narrower range of them that leads
    to rub may be passed over. The step to the first that does is then bisected, in the directions that did.

    Parameters
    ----------
    leads_to_rub : callable
        Of impulse, N s, and direction.
    low, high : float, N s
        First and last impulse.
    tolerance : float
        Relative width of the interval that is left.
    """
    n_tried, harmless, impulse = 0, 0.0, low
    while True:
        rubbing = [d for d in directions if leads_to_rub(impulse, d)]
        n_tried += len(directions)
        if rubbing:
            break
        harmless = impulse
        if impulse >= high:
            return Found(impulse=math.nan, harmless=harmless, direction=None, n_tried=n_tried)
        impulse = min(impulse * _RATIO, high)
    while impulse - harmless > tolerance * impulse:
        middle = 0.5 * (impulse + harmless)
        nearer = [d for d in rubbing if leads_to_rub(middle, d)]
        n_tried += len(rubbing)
        if nearer:
            impulse, rubbing = middle, nearer
        else:
            harmless = middle
    return Found(impulse=impulse, harmless=harmless, direction=rubbing[0], n_tried=n_tried)


@on_one_thread
def least_knock(
    study: Study,
    *,
    angles: int = 12,
    nodes: Sequence[int] = (),
    most: float | None = None,
    tolerance: float = 0.02,
    report: Callable[[int, int], None] = lambda done, n_case: None,
) -> xr.Dataset:
    """Return the least knock of every case of a study, over its axes.

    Each case starts in its contact-free motion and is knocked when the unbalance points straight up. A knock
    leads to rub if there is contact in the revolutions that are recorded, after the transient.

    Parameters
    ----------
    study : Study
        Its own starts are left out; it may have no axes of starts.
    angles : int
        Directions tried, evenly spread.
    nodes : sequence of int
        Nodes of the rotor that are knocked; by default the output node.
    most : float, N s, optional
        Largest impulse tried; by default ten times mass x first lateral frequency x clearance.
    tolerance : float
        Relative width of the interval in which the least impulse is found.
    report : callable
        Called with the number of cases that are done, and of all.

    Returns
    -------
    Dataset
        Over the axes of the study: `least_impulse`, N s (NaN: no knock up to the largest leads to rub, or
        there is no contact-free motion: `has_contact_free_motion`), `harmless_impulse`, N s, the largest
        below it that led to none, `worst_angle`, rad, `worst_node` (0: the output node) and `knocks`, the
        number tried.

    Raises
    ------
    InputError
        The study has axes of starts, a node does not move sideways, or a number is out of range.
    """
    import xarray as xr

    if starts := [axis.name for axis in study.axes if axis.is_initial_key]:
        raise InputError(f"[grid] {starts[0]}: the knock itself is searched for; remove this axis")
    if angles < 1 or not 0.0 < tolerance < 1.0 or (most is not None and not most > 0.0):
        raise InputError(f"angles {angles}, tolerance {tolerance:g}, most {most}: give numbers above 0")
    grid = CaseGrid(replace(study, initial=Initial(), refine=None))
    directions = [
        Direction(2 * math.pi * i / angles, node) for node in (nodes or (None,)) for i in range(angles)
    ]
    names = ("least_impulse", "harmless_impulse", "worst_angle")
    found = {name: np.full(grid.shape, np.nan) for name in names}
    numbers = {name: np.zeros(grid.shape, np.int64) for name in ("worst_node", "knocks")}
    is_free = np.zeros(grid.shape, bool)
    for done, index in enumerate(np.ndindex(grid.shape)):
        report(done, grid.n_case)
        knocks = _Knocks(study, grid.case(index), nodes)
        is_free[index] = knocks.has_contact_free_motion()
        if not is_free[index]:
            continue
        high = most if most is not None else _HIGH * knocks.scale
        one = find_least(knocks, directions, min(_LOW * knocks.scale, high), high, tolerance)
        found["least_impulse"][index], found["harmless_impulse"][index] = one.impulse, one.harmless
        numbers["knocks"][index] = one.n_tried
        if one.direction is not None:
            found["worst_angle"][index] = one.direction.angle
            numbers["worst_node"][index] = one.direction.node or 0
    report(grid.n_case, grid.n_case)
    about = {
        "least_impulse": ("N s", "least impulse that leads to rub"),
        "harmless_impulse": ("N s", "largest impulse below it that did not"),
        "worst_angle": (
            "rad",
            "direction of the least impulse, from straight up in the sense of positive spin",
        ),
        "worst_node": ("1", "node of the least impulse (0: the output node)"),
        "knocks": ("1", "knocks computed"),
        "has_contact_free_motion": ("1", "whether the machine can run free of contact"),
    }
    columns = found | numbers | {"has_contact_free_motion": is_free}
    return xr.Dataset(
        {
            name: (grid.dims, values, {"units": about[name][0], "long_name": about[name][1]})
            for name, values in columns.items()
        },
        coords={
            axis.coordinate: (
                axis.dimension,
                np.array(axis.values),
                {"units": axis.unit or "1", "long_name": axis.long_name},
            )
            for axis in study.axes
        },
        attrs={"title": study.title},
    )


class _Knocks:
    """Knocks on one case; as a function of impulse and direction, whether one leads to rub."""

    def __init__(self, study: Study, case: Case, nodes: Sequence[int]) -> None:
        self._study, self._case = study, case
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
        is_vertical = np.array([name == "v" for _, name in model.rotor.degrees])
        mass = float(model.rotor.mass[np.ix_(is_vertical, is_vertical)].sum())
        self.scale = mass * first_lateral_frequency(model) * case.clearance

    def has_contact_free_motion(self) -> bool:
        """Whether the case stays free of contact without a knock."""
        return not self(0.0, Direction(0.0, None))

    def __call__(self, impulse: float, direction: Direction) -> bool:
        """Whether a knock leads to rub: contact in the recorded revolutions."""
        initial = Initial(
            from_=CONTACT_FREE,
            impulse=impulse,
            impulse_angle=direction.angle,
            impulse_node=direction.node,
        )
        record = run_case(
            self._setup,
            clearance=self._case.clearance,
            friction=self._case.friction,
            recording=replace(self._study.recording, keep=()),
            initial=initial,
        )
        return record.status != DONE or record.measures["regime"] != REGIME.index("no_contact")
