"""The least knock that takes a machine from its contact-free motion to sustained rub."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import InputError
from rubhpc.knock_cases import LeastKnock, Progress, Search, search_cases
from rubhpc.threads import on_one_thread

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    import xarray as xr

    from rubhpc.study.study import Study


@on_one_thread
def least_knock(
    study: Study,
    *,
    angles: int = 12,
    nodes: Sequence[int] = (),
    most: float | None = None,
    tolerance: float = 0.02,
    workers: int = 1,
    progress: Path | None = None,
    report: Callable[[int, int], None] = lambda done, n_case: None,
) -> xr.Dataset:
    """Return the least knock of every case of a study, over its axes.

    Each case starts in its contact-free motion and is knocked when the unbalance points straight up. A knock
    leads to rub if there is contact in the revolutions that are recorded, after the transient.

    Parameters
    ----------
    study : Study
        Its own `[initial]` is ignored; it may have no axes of starts.
    angles : int
        Directions tried, evenly spread.
    nodes : sequence of int
        Nodes of the rotor that are knocked; by default the output node.
    most : float, N s, optional
        Largest impulse tried; by default ten times mass x first lateral frequency x clearance.
    tolerance : float
        Relative width of the interval in which the least impulse is found.
    workers : int
        Processes that share the cases; the result is the same for any number.
    progress : Path, optional
        A file for the results of finished cases; with it an interrupted search is resumed.
    report : callable
        Called with the number of finished cases and the number of all cases.

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
        The study has axes of starts, [branch], [run_up] or [drive], a node does not move sideways, or a
        number is out of range.
    """
    search = search_of(study, angles=angles, nodes=nodes, most=most, tolerance=tolerance)
    if workers < 1:
        raise InputError(f"workers {workers}: give 1 or more")
    kept, n_case = Progress(progress), search.grid.n_case
    left = search.left(kept.found)
    report(n_case - len(left), n_case)
    for done, (index, one) in enumerate(search_cases(search, left, workers), n_case - len(left) + 1):
        kept.enter(search.key(index), one)
        report(done, n_case)
    return dataset_of(search, kept.found)


def search_of(
    study: Study, *, angles: int, nodes: Sequence[int], most: float | None, tolerance: float
) -> Search:
    """Return the search of a study's cases; see `least_knock`.

    Raises
    ------
    InputError
        As there.
    """
    if starts := [axis.name for axis in study.axes if axis.is_initial_key]:
        raise InputError(f"[grid] {starts[0]}: the knock itself is searched for; remove this axis")
    tables = {"branch": study.branch, "run_up": study.run_up, "drive": study.drive}
    for table, found in tables.items():
        if found is not None:
            raise InputError(f"[{table}]: knocks are searched for at a constant speed; remove this table")
    if angles < 1 or not 0.0 < tolerance < 1.0 or (most is not None and not most > 0.0):
        raise InputError(f"angles {angles}, tolerance {tolerance:g}, most {most}: give numbers above 0")
    return Search(study=study, angles=angles, nodes=tuple(nodes), most=most, tolerance=tolerance)


def dataset_of(search: Search, found: Mapping[str, LeastKnock]) -> xr.Dataset:
    """Return the results of all cases, by their keys, over the axes of the study; see `least_knock`."""
    import xarray as xr

    study, grid = search.study, search.grid
    keys = [search.key(index) for index in np.ndindex(grid.shape)]
    columns = {
        name: np.array([getattr(found[key], name) for key in keys]).reshape(grid.shape)
        for name in LeastKnock.__annotations__
    }
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
