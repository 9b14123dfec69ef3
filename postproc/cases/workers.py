"""What a reduction runs on: threads, or a dask cluster of processes, Slurm jobs or MPI ranks."""

from __future__ import annotations

import contextlib
import logging
import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

from rubhpc.children import SAFE_PATH
from rubhpc.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr


@contextlib.contextmanager
def workers(
    scheduler: str = "threads",
    n_worker: int = 2,
    *,
    cores: int = 1,
    memory: str = "4 GB",
    queue: str | None = None,
    walltime: str = "01:00:00",
) -> Iterator[None]:
    """Run the `computed` of the block on some workers; all of them must see the store by the same path.

    Parameters
    ----------
    scheduler : str
        "threads" of this process, "processes" of this machine, "slurm" for jobs that dask-jobqueue submits,
        or "mpi" for the ranks of this job, after `become_rank_of_cluster`.
    n_worker : int
        Processes in total; no meaning for threads and ranks.
    cores, memory, queue, walltime
        Of one Slurm job, which runs one worker a core; `queue` is Slurm's partition.

    Raises
    ------
    InputError
        A package of the extra `scale` is not installed.
    """
    if scheduler == "threads":
        yield
        return
    with _packages_of_scale(scheduler):
        distributed: Any = import_module("distributed")
        jobqueue: Any = import_module("dask_jobqueue") if scheduler == "slurm" else None
    cluster: Any
    if scheduler == "mpi":
        cluster = contextlib.nullcontext()  # the client finds the scheduler of rank 0
    elif scheduler == "processes":
        cluster = distributed.LocalCluster(n_workers=n_worker, threads_per_worker=1, dashboard_address=None)
    else:
        cluster = jobqueue.SLURMCluster(
            cores=cores,
            processes=cores,
            memory=memory,
            queue=queue,
            walltime=walltime,
            job_name="rubhpc-reduce",
            job_script_prologue=[f"export {SAFE_PATH}=1"],
        )
        cluster.scale(n=n_worker)
    with cluster as address, distributed.Client(address) as client:
        client.wait_for_workers(1)  # others join as their jobs start
        yield


def become_rank_of_cluster() -> None:
    """Make this MPI rank the scheduler (rank 0), or a worker (from rank 2); only rank 1 returns.

    InputError where there are fewer than three ranks, or dask-mpi is not installed.
    """
    with _packages_of_scale("mpi"):
        from dask_mpi import WorldTooSmallException, initialize

    logging.getLogger("distributed").setLevel(logging.WARNING)  # each rank would log every connection
    try:
        initialize(dashboard=False)
    except WorldTooSmallException as error:
        raise InputError(
            "--on mpi: needs one rank for the scheduler, one for the command and one for each worker; "
            "start it with mpirun -n 3 or more"
        ) from error


@contextlib.contextmanager
def _packages_of_scale(scheduler: str) -> Iterator[None]:
    try:
        yield
    except ImportError as error:
        raise InputError(
            f"--on {scheduler}: needs the package {error.name}; install it with pip install 'rubhpc[scale]'"
        ) from error


def computed(lazy: xr.Dataset, *, show_progress: bool = True) -> xr.Dataset:
    """Return the loaded dataset; computed by the current `distributed` client, or else by threads."""
    client = _client()
    if client is not None:
        lazy = lazy.persist()
        if show_progress:
            sys.modules["distributed"].progress(lazy, notebook=False)
            print()  # its bar ends within a line
    elif show_progress and sys.stdout.isatty():
        from dask.diagnostics.progress import ProgressBar

        with ProgressBar():  # type: ignore[no-untyped-call]  # dask leaves it untyped
            return lazy.compute()
    return lazy.compute()


def _client() -> Any:
    """Return the current `distributed` client; None without one, or where the package is not loaded."""
    distributed = sys.modules.get("distributed")
    try:
        return distributed.default_client() if distributed else None
    except ValueError:
        return None
