"""One case of a branch study: the branches found in a range, as arrays over their points."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.branches.branch import branch_of
from rubhpc.integrate.branches.branching import Branching
from rubhpc.integrate.branches.search import search, starts
from rubhpc.integrate.compilation import seconds_compiling
from rubhpc.integrate.periodic_motions.family import Family
from rubhpc.schema import BRANCH_EVENT, DONE, MULTIPLIERS, POINT, branch_variables
from rubhpc.study.axes import written

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.branches.branch import Branch
    from rubhpc.integrate.periodic_motions.family import Operation
    from rubhpc.study.axes import Axis
    from rubhpc.study.branch_keys import BranchKeys
    from rubhpc.study.tables import Recording

    Floats = NDArray[np.float64]

STEPS = 50  # in the range, where no step is given


@dataclass(frozen=True, kw_only=True, eq=False)
class BranchRecord:
    """What a case of a branch study yields.

    Attributes
    ----------
    arrays : dict of (n_point, ...)
        By the names of `schema.branch_variables`; NaN beyond the last point.
    measures : dict
        Of the case: its wall time.
    """

    arrays: dict[str, Floats]
    measures: dict[str, Any] = field(default_factory=dict)
    remark: str = ""
    status: int = DONE


def record_branches(
    operation: Operation,
    keys: BranchKeys,
    axis: Axis,
    recording: Recording,
    check: Callable[[], None] | None = None,
    say: Callable[[str], None] | None = None,
    note: Callable[[float], None] | None = None,
) -> BranchRecord:
    """Find the branches of a case and measure every point.

    Parameters
    ----------
    axis : Axis
        The parameter that is followed, with the range that it is drawn from.
    recording : Recording
        Its transient is that of the simulations that lead to first motions.
    check : callable, optional
        Called several times a second; what it raises ends the case.
    say : callable, optional
        Called with the progress, as text.
    note : callable, optional
        Called before with the value of the parameter there.
    """
    began, span = time.perf_counter() - seconds_compiling(), axis.drawn_from
    assert span is not None

    def say_found(n_found: int, value: float) -> None:
        if note is not None:
            note(value)
        if say is not None:
            say(f"{n_found} motions of branches found, now at {written(axis.name, value, axis.unit)}")

    low, high = sorted((span.start, span.stop))
    step = (high - low) / STEPS if keys.step is None else keys.step
    branching = Branching(Family(operation, keys.along, (low, high)), step, check, say_found)
    values = np.linspace(low, high, keys.sweeps).tolist() if keys.sweeps > 1 else [0.5 * (low + high)]
    found = starts(branching, values, [int(period) for period in keys.periods], recording)
    tracks = search(branching, found, low=low, high=high, most=keys.points, doublings=keys.doublings)
    branches = [branch_of(branching, track, recording) for track in tracks]
    arrays, n_point = _arrays(branches, keys, check, say)
    remark = "" if n_point else "no periodic motion was found"
    if n_point > keys.points:
        remark = f"{n_point} points, of which {keys.points} are stored; increase points in [branch]"
    measures = {"wall_time": time.perf_counter() - seconds_compiling() - began}
    return BranchRecord(arrays=arrays, measures=measures, remark=remark)


def _arrays(
    branches: list[Branch],
    keys: BranchKeys,
    check: Callable[[], None] | None,
    say: Callable[[str], None] | None,
) -> tuple[dict[str, Floats], int]:
    """All points, branch after branch, and their number."""
    rows: dict[str, list[Any]] = {name: [] for name in branch_variables()}
    for number, branch in enumerate(branches, 1):
        for i_point, point in enumerate(branch.points):
            if len(rows[f"{POINT}value"]) >= keys.points:
                break
            if say is not None:
                say(f"{len(rows[f'{POINT}value'])} points recorded; branches: {len(branches)}")
            if check is not None:
                check()
            record = branch.record(i_point)
            multipliers = np.full(MULTIPLIERS, np.nan, dtype=np.complex128)
            known = point.multipliers[:MULTIPLIERS]
            multipliers[: known.size] = known
            own = {
                "value": point.value,
                "branch": number,
                "stability": point.is_stable,
                "event": BRANCH_EVENT.index(point.event),
                "multiplier_real": multipliers.real,
                "multiplier_imag": multipliers.imag,
            }
            for name, row in rows.items():
                short = name.removeprefix(POINT)
                if short in record.sections:
                    section = np.full(keys.longest, np.nan)
                    section[: branch.period] = record.sections[short]
                    row.append(section)
                else:
                    row.append(own[short] if short in own else record.measures[short])
    n_point = sum(len(branch.points) for branch in branches)
    return {name: np.array(row, dtype=np.float64) for name, row in rows.items()}, n_point
