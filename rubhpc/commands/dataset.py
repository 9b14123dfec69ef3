"""`rubhpc dataset`: labelled windows of many cases, as files for machine learning."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from rubhpc.commands.options import quantity
from rubhpc.commands.selection import SELECT, open_cases

_COUNT: dict[str, Any] = {"show_default": True, "type": click.IntRange(min=1), "metavar": "N"}


@click.command()
@click.argument("store")
@SELECT
@click.option(
    "--output", required=True, type=click.Path(path_type=Path), metavar="DIR", help="A new directory."
)
@click.option(
    "--signal",
    "signals",
    multiple=True,
    metavar="NAME",
    help="What sensors see [default: all probes, or vertical, horizontal and torsion].",
)
@click.option("--rate", metavar="RATE", help='Such as "5 kHz" [default: the lowest of the stored samples].')
@click.option("--samples", "n_sample", default=1024, help="Of a window.", **_COUNT)
@click.option("--draws", "n_draw", default=10, help="Windows of a case and level of the noise.", **_COUNT)
@click.option(
    "--noise",
    "levels",
    multiple=True,
    type=click.FloatRange(min=0.0),
    metavar="LEVEL",
    help="White noise over the median vibration of the cases that touch [default: 0.05].",
)
@click.option("--sensors", metavar="FILE", help="Sensors of each signal (TOML), in place of --noise.")
@click.option(
    "--split",
    "shares",
    nargs=3,
    default=(0.7, 0.15, 0.15),
    show_default=True,
    type=float,
    metavar="A B C",
    help="Shares of the cases for training, validation and test.",
)
@click.option("--seed", default=1, show_default=True, type=click.IntRange(min=0), metavar="N")
def dataset(store: str, selection: tuple[str, ...], output: Path, rate: str | None, **options: Any) -> None:
    """Write labelled windows of the cases of STORE, seen by sensors, as a data set for machine learning.

    DIR gets a Parquet file for each split, a card (croissant.json) and a README that explains all columns. No
    case is in two splits. Parquet needs `pip install 'rubhpc[parquet]'`.
    """
    from postproc.datasets.dataset import write_dataset
    from rubhpc.running.progress import one_line

    hertz = quantity(rate, "Hz", "--rate") if rate else None
    with one_line() as say:
        made = write_dataset(open_cases(store, selection), output, rate=hertz, say=say, **options)
    for name, (n_case, n_window, n_contact) in made.files.items():
        click.echo(f"{name}: {n_window} windows of {n_case} cases, {n_contact} with contact")
    if made.n_left_out:
        click.echo(f"{made.n_left_out} cases without a result are left out")
    click.echo(str(output))
