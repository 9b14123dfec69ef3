"""The least knock on the ranks of a launcher: they claim the cases, and each keeps its own results."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from rubhpc.errors import RubError
from rubhpc.knock_cases import Progress
from rubhpc.knocks import dataset_of, search_of
from rubhpc.running.crash import crash
from rubhpc.running.pool import RankLost, Totals
from rubhpc.threads import on_one_thread

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    import xarray as xr

    from rubhpc.knock_cases import LeastKnock, Search
    from rubhpc.running.pool import Pool
    from rubhpc.study.study import Study


@on_one_thread
def least_knock_on(
    pool: Pool,
    read: Callable[[], Study],
    *,
    angles: int,
    nodes: Sequence[int],
    most: float | None,
    tolerance: float,
    progress: Path,
    report: Callable[[int, int], None],
) -> xr.Dataset:
    """Return on all ranks what `rubhpc.least_knock` returns on one.

    Parameters
    ----------
    pool : Pool
    read : callable
        Reads the study, on the first rank.
    progress : Path
        A file that keeps the results of cases that are done; ranks after the first add their number to it.
    report : callable
        Called on the first rank with the number of cases that are done, and of all.

    Raises
    ------
    InputError
        As by `least_knock`, or a rank could not keep its results; on all ranks.
    """
    try:

        def begin() -> tuple[Search, dict[str, LeastKnock]]:
            search = search_of(read(), angles=angles, nodes=nodes, most=most, tolerance=tolerance)
            found = Progress(progress).found
            if search.left(found):
                search.compile()  # once, before all ranks do so at the same time
            return replace(search), found  # without its grid, which every rank makes for itself

        search, found = pool.from_first(begin)
        error = None
        try:
            _take_cases(pool, search, found, Progress(progress, pool.rank), report)
        except RankLost:
            raise
        except RubError as trouble:
            error = trouble
        for other in pool.gather(error):
            if other is not None:
                raise other
        for own in pool.gather(found):
            found = found | own
        made = dataset_of(search, found)
    except RankLost as lost:
        pool.abort(lost.exit_code)
        raise
    except RubError:  # on all ranks alike
        pool.close()
        raise
    except Exception as problem:
        crashed = crash(problem, None)
        if pool.size > 1:  # the others wait for this rank
            print(f"rubhpc: {crashed}", flush=True)
            pool.abort(crashed.exit_code)
        raise crashed from problem
    pool.close()
    return made


def _take_cases(
    pool: Pool,
    search: Search,
    found: dict[str, LeastKnock],
    kept: Progress,
    report: Callable[[int, int], None],
) -> None:
    """Search one case after another until none is left; results are kept, and added to those found."""
    left, n_case = search.left(found), search.grid.n_case
    if pool.rank == 0:
        report(n_case - len(left), n_case)
    while (number := pool.claim().claimed) < len(left):
        index = left[number]
        found[search.key(index)] = one = search.of_case(index)
        kept.enter(search.key(index), one)
        done = pool.add(Totals(done=1)).done + 1
        if pool.rank == 0:
            report(n_case - len(left) + done, n_case)
