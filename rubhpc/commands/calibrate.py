"""`rubhpc calibrate`: whether identification is right as often as it says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from rubhpc.commands.options import SEED, STUDY, TRUST_STUDY, WORKERS


@click.command()
@STUDY
@click.option(
    "--output", type=click.Path(path_type=Path), metavar="DIR", help="[default: STUDY_calibrated here]"
)
@click.option(
    "--posteriors", type=click.IntRange(min=2), default=100, show_default=True, help="A noise level."
)
@click.option(
    "--noise",
    type=click.FloatRange(min=0.0, min_open=True),
    multiple=True,
    default=(0.01, 0.1, 0.3),
    show_default=True,
    help="Over the rms of each signal; repeat it for several levels.",
)
@click.option(
    "--signal",
    "signals",
    multiple=True,
    default=("vertical", "horizontal", "torsion"),
    show_default=True,
    help="What is measured.",
)
@click.option(
    "--method",
    type=click.Choice(("central-difference", "modal")),
    default="central-difference",
    show_default=True,
    help="Scheme of the truth.",
)
@click.option("--transient", type=click.IntRange(min=1), default=400, show_default=True, help="Of the truth.")
@click.option(
    "--revolutions", type=click.IntRange(min=26), default=32, show_default=True, help="That are measured."
)
@click.option("--live", type=click.IntRange(min=10), default=50, show_default=True, help="Live points.")
@SEED
@WORKERS
@TRUST_STUDY
def calibrate(
    study: Path, output: Path | None, posteriors: int, noise: tuple[float, ...], workers: int, **keys: Any
) -> int:
    """Test identification on records whose truth is known.

    Truths are drawn from the priors in [grid] of STUDY.toml. Prints how often the intervals of the posteriors
    hold them, and whether their ranks are uniform, as a Markdown table. DIR keeps the result of each
    posterior; the same command resumes after a stop. With --workers, or under mpirun, several processes share
    the posteriors.
    """
    from rubhpc.identification.calibration import Trial, calibrate_on, in_table
    from rubhpc.identification.evaluation import processes, take_part
    from rubhpc.running.progress import one_line

    folder = output or Path(f"{study.stem}_calibrated")
    trials = [
        Trial(study=str(study), noise=level, draw=draw, output=str(folder), **keys)
        for draw in range(posteriors)
        for level in noise
    ]
    with one_line() as say, processes(workers) as pool:
        if pool.rank > 0:
            take_part(pool)
            return 0
        found = calibrate_on(pool, trials, report=say)
    for line in in_table(trials, found):
        click.echo(line)
    return 0
