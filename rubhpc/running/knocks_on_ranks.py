"""The least knock on the ranks of a pool: they claim the cases, and each keeps its own results."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from rubhpc.errors import RubError
from rubhpc.knock_cases import Progress, dataset_of, search_of
from rubhpc.running.ending import crash, ended_together
from rubhpc.running.pool import Totals, together
from rubhpc.streams import lasting_streams
from rubhpc.threads import on_one_thread

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    import xarray as xr

    from rubhpc.knock_cases import LeastKnock, Search
    from rubhpc.running.pool import Pool
    from rubhpc.running.stopping import Stopping
    from rubhpc.study.study import Study

    Results = dict[str, LeastKnock]
    Begun = tuple[Search, Results, Path | None]


@on_one_thread
def least_knock_on(
    pool: Pool,
    read: Callable[[], Study],
    *,
    angles: int,
    nodes: Sequence[int],
    most: float | None,
    tolerance: float,
    progress: Path | None,
    report: Callable[[int, int], None],
) -> xr.Dataset:
    """Return on all ranks what `rubhpc.least_knock` returns on one.

    Parameters
    ----------
    pool : Pool
    read : callable
        Reads the study, on the first rank.
    progress : Path, optional
        A file that keeps the results of cases that are done; ranks after the first add their number to it.
    report : callable
        Called on the first rank with the number of cases that are done, and of all.

    Raises
    ------
    InputError
        As by `least_knock`, or a rank could not keep its results; on all ranks.
    """

    def begin() -> Begun:
        search = search_of(read(), angles=angles, nodes=nodes, most=most, tolerance=tolerance)
        found = Progress(progress).found
        if search.left(found):
            search.compile()  # once, before all ranks do so at the same time
        return replace(search), found, progress  # without its grid, which every rank makes for itself

    return dataset_of(*_search_on(pool, begin, report))


@on_one_thread
@lasting_streams()
def take_part(pool: Pool, stopping: Stopping) -> None:
    """Do a worker's part of a search; all information comes from the first rank."""

    def unknown() -> Begun:
        raise AssertionError("a worker is not the first rank")

    _search_on(pool, unknown, lambda done, n_case: None)


def _search_on(
    pool: Pool, begin: Callable[[], Begun], report: Callable[[int, int], None]
) -> tuple[Search, Results]:
    """Search the cases that are left, together; returns the results of all."""
    with ended_together(pool):
        search, found, progress = pool.from_first(begin)

        def work() -> Results:
            try:
                return _take_cases(pool, search, found, Progress(progress, pool.rank), report)
            except RubError:
                raise
            except Exception as error:
                raise crash(error) from error

        for own in together(pool, work):
            found = found | own
        return search, found


def _take_cases(
    pool: Pool,
    search: Search,
    found: Results,
    kept: Progress,
    report: Callable[[int, int], None],
) -> Results:
    """Search one case after another until none is left; results are kept, and added to those found."""
    found, left, n_case = dict(found), search.left(found), search.grid.n_case
    if pool.rank == 0:
        report(n_case - len(left), n_case)
    while not (sums := pool.claim()).stop and sums.claimed < len(left):
        index = left[sums.claimed]
        found[search.key(index)] = one = search.of_case(index)
        kept.enter(search.key(index), one)
        done = pool.add(Totals(done=1)).done + 1
        if pool.rank == 0:
            report(n_case - len(left) + done, n_case)
    return found
