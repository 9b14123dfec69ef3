"""The least knock that takes a machine from its contact-free motion to sustained rub."""

from __future__ import annotations

from contextlib import nullcontext
from typing import TYPE_CHECKING

from rubhpc.running.knocks_on_ranks import least_knock_on, take_part
from rubhpc.running.pool import Pool
from rubhpc.running.workers import start_workers
from rubhpc.streams import lasting_streams

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    import xarray as xr

    from rubhpc.study.study import Study


@lasting_streams()
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
    with nullcontext(Pool()) if workers == 1 else start_workers(workers, take_part) as pool:
        return least_knock_on(
            pool,
            lambda: study,
            angles=angles,
            nodes=nodes,
            most=most,
            tolerance=tolerance,
            progress=progress,
            report=report,
        )
