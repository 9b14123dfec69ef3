"""`rubhpc reduce`: a mean, an envelope, quantiles or a histogram over the cases of a store of any size."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from rubhpc.commands.selection import SELECT, pairs
from rubhpc.errors import InputError


@click.command()
@click.argument("store")
@click.option(
    "--what",
    type=click.Choice(["mean", "envelope", "quantiles", "histogram"]),
    default="mean",
    show_default=True,
    help="Mean or envelope of spectra; quantiles or histogram of a measure.",
)
@click.option("--signal", help="Signal whose spectra are reduced [default: torsion].")
@click.option("--measure", help="Measure of quantiles and histogram [default: peak_contact_force].")
@click.option(
    "--over", multiple=True, metavar="AXIS", help="Axis to reduce; may be repeated [default: all axes]."
)
@SELECT
@click.option(
    "--level", "levels", multiple=True, type=click.FloatRange(0, 1), default=(0.05, 0.5, 0.95),
    show_default=True, help="Level of a quantile; may be repeated.",
)  # fmt: skip
@click.option(
    "--bins", type=click.IntRange(min=1), default=50, show_default=True, help="Bins of a histogram."
)
@click.option("--data", metavar="FILE", help=".csv, .json, .zarr or .nc [default: STORE_WHAT.nc here].")
@click.option(
    "--figure", metavar="FILE", help="Figure, if one spectrum is left [default: STORE_WHAT.png here]."
)
@click.option(
    "--on",
    type=click.Choice(["threads", "processes", "slurm", "mpi"]),
    default="threads",
    show_default=True,
    help="Threads, processes of this machine, Slurm jobs, or the ranks of mpirun.",
)
@click.option(
    "--workers", type=click.IntRange(min=1), default=2, show_default=True, help="Processes in total."
)
@click.option(
    "--cores", type=click.IntRange(min=1), default=1, show_default=True,
    help="Cores of a Slurm job, one worker each.",
)  # fmt: skip
@click.option("--memory", default="4 GB", show_default=True, help="Memory of a Slurm job.")
@click.option("--queue", help="Slurm partition.")
@click.option("--walltime", default="01:00:00", show_default=True, help="Time limit of a Slurm job.")
def reduce(
    store: str,
    what: str,
    signal: str | None,
    measure: str | None,
    over: tuple[str, ...],
    selection: tuple[str, ...],
    levels: tuple[float, ...],
    bins: int,
    data: str | None,
    figure: str | None,
    on: str,
    workers: int,
    **job: Any,
) -> None:
    """Reduce the cases of STORE over axes, in bounded memory: spectra, or one measure.

    Writes the result and, where one spectrum is left, draws it. With `--on slurm` this process submits the
    jobs of its workers; `--on mpi` is for `mpirun -n N`, of which N - 2 ranks are workers. Both, and
    `--on processes`, need `pip install 'rubhpc[scale]'`, and every worker reads STORE by the path given.
    """
    import zarr

    from postproc.cases.reduction import of_spectra, reduce_store
    from postproc.cases.workers import become_rank_of_cluster
    from postproc.cases.workers import workers as on_workers
    from postproc.figures.drawing import check_figure_path
    from postproc.store.export import check_data_path, write_data

    if (of_spectra(what) and measure) or (not of_spectra(what) and signal):
        own, other = ("--signal", "--measure") if measure else ("--measure", "--signal")
        raise InputError(f"--what {what}: takes no {other}; give {own} instead")
    if on == "mpi":
        from rubhpc.running.launch import move_to

        try:
            become_rank_of_cluster()
        except SystemExit as ended:  # of the scheduler and the workers, when the command has ended
            raise click.exceptions.Exit(0) from ended
        move_to(0, 1)  # the only rank that is left to print
    stem = f"{Path(store).resolve().stem}_{what}"
    data_path = check_data_path(data or f"{stem}.nc")
    figure_path = check_figure_path(figure or f"{stem}.png")
    zarr.config.set({"threading.max_workers": None})  # one rank of a run has one; here every core decodes
    chosen = signal or measure or ("torsion" if of_spectra(what) else "peak_contact_force")
    choice = dict(pairs(selection, "--select"))
    with on_workers(on, workers, **job):
        found = reduce_store(store, what, chosen, over, choice, levels=levels, bins=bins)
    click.echo(str(write_data(found, data_path)))
    if of_spectra(what) and found[f"spectrum_{chosen}"].squeeze().ndim == 1:
        _draw(found, what, chosen, figure_path)
        click.echo(str(figure_path))


def _draw(found: Any, what: str, signal: str, path: Path) -> None:
    from postproc.figures.drawing import house_style, new_figure, save
    from postproc.figures.spectrum import draw_spectrum

    shown = found[f"spectrum_{signal}"].squeeze()
    with house_style():
        page, (ax,) = new_figure()
        ax.set_title(f"{what} of {int(found['cases'].max())} cases".capitalize(), fontsize=7)
        draw_spectrum(shown, ax, abscissa="order", limit=min(10.0, float(shown["order"][-1])))
        save(page, path)
