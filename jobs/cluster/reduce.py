"""Reduce the spectra of a store of any size: a mean or an envelope over axes, as data and as a figure.

    python jobs/cluster/reduce.py map.zarr --what envelope --over friction
    python jobs/cluster/reduce.py map.zarr --on processes --workers 8
    python jobs/cluster/reduce.py map.zarr --on slurm --workers 64 --cores 16 --memory "32 GB" --queue short
    mpirun -n 18 python jobs/cluster/reduce.py map.zarr --on mpi

`threads` are of this process; `processes` are of this machine; `slurm` has dask-jobqueue submit jobs of
--cores workers each, and is itself to be run where jobs may be submitted and the workers can reach it; `mpi`
has dask-mpi make the ranks of one job a scheduler, this script and, all but these two, workers. The last
three need `pip install '.[scale]'`. All see the store by the path given, on a file system that they share.
"""

from __future__ import annotations

import argparse
import contextlib
import logging
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from postproc.cases.reduction import computed, envelope, mean_spectrum, open_in_pieces
from postproc.figures.spectrum_figure import spectrum
from postproc.figures.style import check_figure_path, house_style, new_figure, save
from postproc.store.export import check_data_path, write_data
from postproc.store.select import select
from rubhpc.commands.drawing import pairs
from rubhpc.errors import InputError, RubError

if TYPE_CHECKING:
    from collections.abc import Iterator

REDUCTIONS = {"mean": mean_spectrum, "envelope": envelope}


def arguments() -> argparse.Namespace:
    """Return what the command line asks for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("store", help="the store of a finished study")
    parser.add_argument("--what", choices=REDUCTIONS, default="mean")
    parser.add_argument("--signal", default="torsion")
    parser.add_argument("--over", action="append", default=[], metavar="AXIS", help="may be repeated [all]")
    parser.add_argument(
        "--select", action="append", default=[], metavar="AXIS=VALUE", help="as in rubhpc map"
    )
    parser.add_argument("--data", metavar="FILE", help=".csv, .json, .zarr or .nc [STORE_WHAT.nc here]")
    parser.add_argument("--figure", metavar="FILE", help="where one spectrum is left [STORE_WHAT.png here]")
    parser.add_argument("--on", choices=("threads", "processes", "slurm", "mpi"), default="threads")
    parser.add_argument("--workers", type=int, default=2, help="processes in all [%(default)s]")
    parser.add_argument("--cores", type=int, default=1, help="of a Slurm job, one worker each [%(default)s]")
    parser.add_argument("--memory", default="4 GB", help="of a Slurm job [%(default)s]")
    parser.add_argument("--queue", help="Slurm's partition")
    parser.add_argument("--walltime", default="01:00:00", help="of a Slurm job [%(default)s]")
    return parser.parse_args()


@contextlib.contextmanager
def workers(given: argparse.Namespace) -> Iterator[None]:
    """Hold what dask computes on."""
    if given.on == "threads":
        yield
        return
    from distributed import Client, LocalCluster

    if given.on == "mpi":  # the scheduler is known since `become_worker`
        with Client() as client:
            client.wait_for_workers(1)
            yield
        return
    cluster: Any
    if given.on == "processes":
        cluster = LocalCluster(n_workers=given.workers, threads_per_worker=1, dashboard_address=None)
    else:
        from dask_jobqueue import SLURMCluster

        cluster = SLURMCluster(
            cores=given.cores,
            processes=given.cores,
            memory=given.memory,
            queue=given.queue,
            walltime=given.walltime,
            job_name="rubhpc-reduce",
        )
        cluster.scale(n=given.workers)
    with cluster, Client(cluster) as client:
        client.wait_for_workers(1)  # others join as their jobs start
        yield


def become_worker() -> None:
    """Make the scheduler of rank 0 and workers of all others but rank 1, which alone comes back."""
    from dask_mpi import WorldTooSmallException, initialize

    logging.getLogger("distributed").setLevel(logging.WARNING)  # each rank would tell of every connection
    try:
        initialize(dashboard=False)
    except WorldTooSmallException as error:
        raise InputError(
            "--on mpi: needs a rank for the scheduler, one for this script and one for each worker; "
            "start it with mpirun -n 3 or more"
        ) from error


def main() -> int:
    """Reduce, write and draw."""
    given = arguments()
    if given.on == "mpi":
        become_worker()
    stem = f"{Path(given.store).resolve().stem}_{given.what}"
    data = check_data_path(given.data or f"{stem}.nc")
    figure = check_figure_path(given.figure or f"{stem}.png")
    store = select(open_in_pieces(given.store), dict(pairs(tuple(given.select), "--select")))
    lazy = REDUCTIONS[given.what](store, given.signal, given.over)
    with workers(given):
        found = computed(lazy)
    print(f"\n{write_data(found, data)}")
    shown = found[f"spectrum_{given.signal}"].squeeze()
    if shown.ndim == 1:
        with house_style():
            page, (ax,) = new_figure()
            ax.set_title(f"{given.what} of {int(found['cases'].max())} cases".capitalize(), fontsize=7)
            spectrum(shown, ax, abscissa="order", limit=min(10.0, float(shown["order"][-1])))
            save(page, figure)
        print(figure)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except RubError as error:
        print(f"reduce.py: {error}", file=sys.stderr)
        sys.exit(error.exit_code)
