"""`rubhpc knock`."""

from __future__ import annotations

import time
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

import click

from rubhpc.commands.options import STUDY, TRUST_STUDY, WORKERS, quantity
from rubhpc.running.launch import launch

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

_GAP = 10.0  # s between lines that report the progress


@click.command()
@STUDY
@click.option("--angles", type=click.IntRange(min=1), default=12, show_default=True, help="Directions tried.")
@click.option(
    "--node", "nodes", type=int, multiple=True, help="Node that is knocked [default: the output node]."
)
@click.option("--most", metavar="IMPULSE", help='Largest impulse tried: "2 N*s", or a number in N s.')
@click.option(
    "--tolerance",
    type=click.FloatRange(0.0, 1.0, min_open=True, max_open=True),
    default=0.02,
    show_default=True,
    help="Relative width of the interval of the least impulse.",
)
@WORKERS
@click.option("--figure", metavar="FILE", help=".png, .pdf or .svg [default: STUDY_knock.png here]")
@click.option("--data", metavar="FILE", help="Write the data too: .csv, .json, .zarr or .nc.")
@TRUST_STUDY
def knock(
    study: Path,
    most: str | None,
    workers: int,
    figure: str | None,
    data: str | None,
    trust_rig: bool,
    **search: Any,
) -> int:
    """Find the least knock that takes a machine from its contact-free motion to sustained rub.

    For every case of STUDY.toml: the smallest impulse over all directions and nodes tried. A figure shows it
    over the speed, the resilience curve of the machine. No store is made; cases that are done are kept in
    files next to the figure until it is drawn, so that the same command resumes an interrupted search. With
    --workers, or under mpirun, several processes share the cases.
    """
    from postproc.figures.drawing import check_figure_path
    from postproc.figures.resilience_curve import resilience
    from postproc.store.export import check_data_path, write_data
    from rubhpc.knock_cases import Progress
    from rubhpc.running.knocks_on_ranks import least_knock_on, take_part
    from rubhpc.running.pool import connect
    from rubhpc.running.workers import start_workers
    from rubhpc.study.study import read_study

    path = check_figure_path(figure or f"{study.stem}_knock.png")
    progress = path.with_name(f".{path.stem}.progress")
    data_path = check_data_path(data) if data else None
    largest = None if most is None else quantity(most, "N*s", "--most")
    search |= {"most": largest, "progress": progress, "report": _report()}
    with nullcontext(connect()) if workers == 1 else start_workers(workers, take_part) as pool:
        found = least_knock_on(pool, lambda: read_study(study, trust_rig=trust_rig), **search)
    if launch().rank > 0:
        return 0
    drawing = resilience(found)
    for line in drawing.lines:
        click.echo(line)
    click.echo(str(drawing.save(path)))
    if data_path is not None:
        click.echo(str(write_data(drawing.shown, data_path)))
    Progress(progress).forget()
    return 0


def _report() -> Callable[[int, int], None]:
    """Print how many cases are done, at first and then every few seconds."""
    printed: list[float] = []

    def report(n_done: int, n_case: int) -> None:
        if not printed or time.monotonic() > printed[-1] + _GAP:
            rest = "; searching the rest" if not printed else ""
            click.echo(f"{n_done}/{n_case} cases are done{rest}")
            printed.append(time.monotonic())

    return report
