"""`rubhpc identify`: which rub, if any, is behind a measured vibration."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from rubhpc.commands.options import SEED, STUDY, TRUST_STUDY, WORKERS


@click.command()
@click.argument("measured", metavar="MEASURED.toml", type=click.Path(path_type=Path))
@STUDY
@click.option(
    "--output", type=click.Path(path_type=Path), metavar="DIR", help="[default: MEASURED_identified here]"
)
@click.option(
    "--live",
    type=click.IntRange(min=10),
    default=100,
    show_default=True,
    help="Live points of nested sampling; more of them take longer and give a finer posterior.",
)
@click.option(
    "--draws", type=click.IntRange(min=1), default=1000, show_default=True, help="Of the posterior."
)
@SEED
@click.option("--slack", is_flag=True, help="Try slack bearings too, which takes several times as long.")
@WORKERS
@TRUST_STUDY
def identify(
    measured: Path,
    study: Path,
    output: Path | None,
    slack: bool,
    workers: int,
    trust_rig: bool,
    **sampling: Any,
) -> int:
    """Find the rub behind a measured vibration, and how sure that is.

    Entries of [grid] in STUDY.toml are priors: { start, stop }, { mean, std }, or a list. DIR gets the
    posterior as ArviZ InferenceData (posterior.nc), figures (corner.png, predicted.png), and the cases that
    have been evaluated, from which the same command resumes after a stop. With --workers, or under mpirun,
    several processes share the cases. Needs `pip install 'rubhpc[identify]'`.
    """
    from postproc.figures.identified import corner, predicted
    from rubhpc.identification.evaluation import processes, take_part
    from rubhpc.identification.identify import identify_on
    from rubhpc.identification.problem import read_problem
    from rubhpc.running.progress import one_line

    folder = output or Path(f"{measured.stem}_identified")
    with one_line() as say, processes(workers) as pool:
        if pool.rank > 0:
            take_part(pool)
            return 0
        found = identify_on(
            pool,
            lambda: read_problem(measured, study, slack=slack, trust_rig=trust_rig),
            output=folder,
            report=say,
            **sampling,
        )
    for line in found.lines:
        click.echo(line)
    for name, drawing in (("corner", corner(found.tree)), ("predicted", predicted(found.tree))):
        click.echo(str(drawing.save(folder / f"{name}.png")))
    return 0
