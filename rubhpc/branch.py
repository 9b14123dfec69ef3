"""Branches of periodic motions along a parameter: arguments with units in, curves with their events out."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from rubhpc.case_arguments import CaseArguments, case_of, check_count, recording_of
from rubhpc.errors import InputError, NoPeriodicMotion, located
from rubhpc.input.messages import brief
from rubhpc.input.quantity import parse_quantity
from rubhpc.integrate.branches.branch import branch_of
from rubhpc.integrate.branches.branching import Branching
from rubhpc.integrate.branches.search import search, shot, simulated, starts
from rubhpc.integrate.periodic_motions.collocated_motion import followed_motion
from rubhpc.integrate.periodic_motions.family import CLEARANCES, SPEEDS, Family, Operation
from rubhpc.integrate.periodic_motions.piecewise_motion import Unfollowed
from rubhpc.integrate.periodic_motions.shooting import NotConverged
from rubhpc.integrate.record import State
from rubhpc.integrate.start import fit_to_gaps
from rubhpc.rig.reading import read_rig
from rubhpc.rig.rig import Rig
from rubhpc.rig.stators import gap_problem
from rubhpc.study.axis_reading import unit_of
from rubhpc.study.branch_keys import LONGEST_PERIOD, check_followed
from rubhpc.threads import on_one_thread

if TYPE_CHECKING:
    from collections.abc import Mapping
    from os import PathLike
    from typing import Unpack

    from rubhpc.integrate.branches.branch import Branch
    from rubhpc.integrate.branches.point import Point
    from rubhpc.study.initial import Initial
    from rubhpc.study.tables import Recording

STEPS = 50  # in the range, where no step is given


@on_one_thread
def branch(
    rig: Rig | str | PathLike[str],
    *,
    along: str,
    start: float | str,
    stop: float | str,
    largest_step: float | str | None = None,
    period: int = 1,
    initial: State | Mapping[str, float | str] | None = None,
    sweeps: int = 0,
    doublings: int = 1,
    transient: int = 60,
    most_points: int = 500,
    samples_per_revolution: int = 256,
    keep: str | tuple[str, ...] = ("waveform", "spectrum", "section"),
    **case: Unpack[CaseArguments],
) -> tuple[Branch, ...]:
    """Follow periodic motions along a parameter, through folds, stable and unstable.

    Pseudo-arclength continuation with the exact monodromy matrix. Folds, doublings of the period, second
    frequencies (Neimark and Sacker) and grazing are located to 1e-9 of the range, without closed form of the
    motion between events to 1e-6. At a doubling the motion
    of twice the period is followed too, and where a branch ends at a motion of half its period, that one.

    Parameters
    ----------
    rig : Rig, str or path
        A rig, the name of a packaged one ("mokhtar2017"), or the path of a rig file.
    along : str
        What is varied: speed_ratio, speed, clearance_ratio, clearance, friction or a key of the rig, such as
        "stator.youngs_modulus".
    start, stop : float or str with a unit
        Its range. The first motion is sought at `start`.
    largest_step : float or str with a unit, optional
        Its largest change from one point to the next; by default a fiftieth of the range. Steps are also
        limited to a change of the motion by a fifth of its size.
    period : int
        Revolutions of the first motion, up to 64.
    initial : State or dict, optional
        A motion at `start`, where the search begins; or the start of the simulation that leads to one.
    sweeps : int
        Values of the parameter, spread over the range, at which motions of other branches are sought: by a
        simulation with rising, one with falling parameter, and one from a random disturbance at each.
    doublings : int
        How many times in a row a doubled period is followed.
    transient : int
        Revolutions of each simulation.
    most_points : int
        Largest number of points of a branch.
    samples_per_revolution : int
        Samples in each revolution of the records of points, an even number.
    keep : tuple of {"waveform", "spectrum", "section"}
        What these records contain in addition to measures.
    **case
        Speed, clearance, friction, laws and accuracy as of `simulate`, except the parameter that varies.

    Returns
    -------
    tuple of Branch
        The branch of the first motion, then those found from it, then others.

    Raises
    ------
    InputError
        If an argument cannot be used, or the method is not modal.
    NoPeriodicMotion
        If there is none at `start`.

    Examples
    --------
    >>> found = branch(
    ...     "mokhtar2017", along="clearance", start="100 um", stop="130 um", speed_ratio=0.75, period=2
    ... )
    >>> [name for name, _ in found[0].events()]
    ['grazing', 'grazing', 'period_doubling']
    """
    check_count("branch", "period", period, 1, LONGEST_PERIOD)
    counts = {"sweeps": (sweeps, 0), "doublings": (doublings, 0), "most_points": (most_points, 2)}
    for name, (number, least) in counts.items():
        check_count("branch", name, number, least)
    if not isinstance(rig, Rig):
        rig = read_rig(rig)
    first, last = _range(rig, along, start, stop)
    largest = (
        abs(last - first) / STEPS if largest_step is None else _one(rig, along, largest_step, "largest_step")
    )
    if not largest > 0.0:
        raise InputError(f"branch: largest_step: {largest_step} is out of range; it must be above 0")
    operation, begin = _operation(rig, along, first, initial, samples_per_revolution, case)
    recording = recording_of(
        "branch",
        transient=transient,
        samples_per_revolution=samples_per_revolution,
        keep=keep,
    )
    branching = Branching(Family(operation, along, (first, last)), largest)
    seeds = [_first(branching, first, begin, period, recording)]
    low, high = sorted((first, last))
    places = np.linspace(low, high, sweeps + 2)[1:-1].tolist()

    def every_start() -> Any:
        yield from seeds
        if places:
            yield from starts(branching, places, (1, 2, 3, 4), recording)

    tracks = search(branching, every_start(), low=low, high=high, most=most_points, doublings=doublings)
    return tuple(branch_of(branching, track, recording) for track in tracks)


def _first(
    branching: Branching, value: float, begin: State | Initial, period: int, recording: Recording
) -> Point:
    """The motion with which the first branch begins."""
    reason = ""
    if isinstance(begin, State):
        setup, clearance, friction = branching.family.settings(value)
        followed = followed_motion(setup.scheme)(
            setup, clearance, friction, fit_to_gaps(begin, setup, clearance)
        )
        try:
            return branching.begin(value, followed.start, followed.states, period)
        except (NotConverged, Unfollowed) as problem:
            reason = str(problem)
    else:
        ended = simulated(branching, value, begin, recording)
        if ended and (point := shot(branching, value, ended[1], (period,))) is not None:
            return point
        reason = f"a simulation of {recording.longest_transient} revolutions leads to none"
    raise NoPeriodicMotion(
        f"branch: no motion of period {period} was found at {branching.family.along} {value:.6g}: {reason}; "
        "give another period, start or initial, or a longer transient"
    )


def _range(rig: Rig, along: str, start: float | str, stop: float | str) -> tuple[float, float]:
    """The range in SI units, in the order given."""
    first, last = _one(rig, along, start, "start"), _one(rig, along, stop, "stop")
    if first == last:
        raise InputError(f"branch: stop: {stop} equals start; give a range")
    if along in SPEEDS and first * last <= 0.0:
        raise InputError("branch: start: the range contains 0, which is not a valid speed; use one sign only")
    name, value = ("start", start) if first < last else ("stop", stop)
    least = min(first, last)
    if along in ("friction", "clearance_ratio") and least < 0.0:
        raise InputError(f"branch: {name}: {value} is out of range; {along} must be at least 0")
    if along == "clearance" and (problem := gap_problem(rig.stator, least)):
        raise InputError(f"branch: {name}: {problem}")
    return first, last


def _one(rig: Rig, along: str, value: float | str, name: str) -> float:
    """A value on the axis that is varied, SI."""
    if not isinstance(along, str):
        raise InputError(
            f'branch: along: {brief(along)} is not the name of an axis; give one, such as "friction"'
        )
    check_followed(along, "branch: along")
    with located("branch: along: "):
        unit = unit_of(along, rig)
    found = parse_quantity(value, unit, f"branch: {name}")
    if not math.isfinite(found):
        raise InputError(f"branch: {name}: {value} is not a number")
    return found


def _operation(
    rig: Rig, along: str, value: float, initial: object, samples_per_revolution: int, case: Any
) -> tuple[Operation, State | Initial]:
    """What is held along the branch, checked at its start, and where the search begins."""
    given: dict[str, Any] = dict(case)
    if along in given:
        raise InputError(f"branch: {along}: varies along the branch; remove it")
    there: dict[str, Any] = {along: value}
    if along not in (*SPEEDS, *CLEARANCES, "friction"):
        there = {"overrides": {**(given.get("overrides") or {}), along: value}}
    arguments = cast("CaseArguments", given | there)
    one = case_of("branch", rig, arguments, samples_per_revolution=samples_per_revolution, initial=initial)
    found = {"speed": one.setup.spin, "clearance": one.clearance}
    held = [name for name in (*SPEEDS, *CLEARANCES) if given.get(name) is not None]
    numbers = {name: found[name] if name in found else float(given[name]) for name in held}
    operation = Operation(
        rig=one.rig,
        friction=one.friction,
        contact=one.contact,
        integrator=one.integrator,
        samples_per_revolution=samples_per_revolution,
        **numbers,
    )
    return operation.at(along, value), one.initial
