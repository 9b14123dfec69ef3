"""A mean spectrum of 100 000 cases, each way in a process of its own: time, rate, memory, the disk's rate.

    python tests/bench/reductions.py [--cases 100000] [--workers 2] [--table bench-scale.md] [--folder .]

Each way reads the store once from the disk, its pages dropped before, and once more from the page cache. On a
folder in memory (tmpfs) the two are the same.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import zarr

sys.path.append(str(Path(__file__).parents[2]))
sys.path.append(str(Path(__file__).parents[1] / "support"))
import many_cases

from postproc.cases.reduction import computed, envelope, mean_spectrum, open_in_pieces

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

HEAD = ("way", "from disk, s", "GB/s", "of the disk's rate", "from cache, s", "GB/s", "memory, MB")
_SHAPE = many_cases.SHAPE[1:]  # of the cases at one speed


def files(path: Path) -> list[Path]:
    """Return the chunks that hold the spectra."""
    return [file for file in (path / many_cases.NAME / "c").rglob("*") if file.is_file()]


def drop(path: Path) -> None:
    """Have the system forget the pages of the store."""
    os.sync()
    for file in files(path):
        handle = os.open(file, os.O_RDONLY)
        os.posix_fadvise(handle, 0, 0, os.POSIX_FADV_DONTNEED)
        os.close(handle)


def read_files(path: Path) -> float:
    """Read, and decode nothing: as fast as the disk goes; returns the bytes read."""
    return float(sum(len(file.read_bytes()) for file in files(path)))


def loop(path: Path) -> NDArray[np.float64]:
    """Return the mean as one would write it by hand: chunk by chunk, a sum and a count."""
    array = zarr.open_group(path, mode="r")[many_cases.NAME]
    total, count = np.zeros(array.shape[-1]), np.zeros(array.shape[-1])
    steps = [range(0, n, c) for n, c in zip(array.shape[:-1], array.chunks[:-1], strict=True)]
    for corner in itertools.product(*steps):
        box = tuple(slice(s, s + c) for s, c in zip(corner, array.chunks[:-1], strict=True))
        values = array[box].reshape(-1, array.shape[-1])
        total += np.nansum(values, axis=0, dtype=np.float64)
        count += np.isfinite(values).sum(axis=0)
    mean: NDArray[np.float64] = total / count
    return mean


def reduced(path: Path, reduction: Callable[..., Any] = mean_spectrum) -> NDArray[np.float64]:
    """Return the mean, or another reduction, as the product takes it."""
    found = computed(reduction(open_in_pieces(path), "torsion"), show_progress=False)
    values: NDArray[np.float64] = found[many_cases.NAME].values
    return values


WAYS: dict[str, Callable[[Path], Any]] = {
    "files read, nothing decoded": read_files,
    "mean, plain loop over zarr's chunks": loop,
    "mean, dask threads": reduced,
    "envelope, dask threads": lambda path: reduced(path, envelope),
    "mean, distributed processes": reduced,
    "mean, ranks by dask-mpi": reduced,
}


def measured(way: str, path: Path, workers: int) -> dict[str, Any]:
    """Return wall times from disk and from cache, s, most memory of all processes, MB, and the result."""
    if way.endswith("processes"):
        from distributed import Client, LocalCluster

        with (
            LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster,
            Client(cluster) as client,
        ):
            return _timed(way, path, client)
    if way.endswith("dask-mpi"):
        from dask_mpi import initialize
        from distributed import Client

        initialize(dashboard=False)
        with Client() as client:
            client.wait_for_workers(workers)
            return _timed(way, path, client)
    return _timed(way, path, None)


def _timed(way: str, path: Path, client: Any) -> dict[str, Any]:
    seconds = []
    drop(path)
    for _ in range(2):
        began = time.perf_counter()
        result = WAYS[way](path)
        seconds.append(time.perf_counter() - began)
    memory = _most_memory() + (sum(client.run(_most_memory).values()) if client else 0.0)
    line = float(np.asarray(result)[_line(path)]) if np.ndim(result) else float(result)
    return {"seconds": seconds, "memory": memory, "result": line}


def _most_memory() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def _line(path: Path) -> int:
    return int(np.argmin(np.abs(zarr.open_group(path, mode="r")["order"][...] - many_cases.LINE)))


def run(way: str, path: Path, workers: int) -> dict[str, Any]:
    """Measure one way in a process of its own, or under mpirun."""
    command = [sys.executable, __file__, "--way", way, "--store", str(path), "--workers", str(workers)]
    if way.endswith("dask-mpi"):
        mpirun = str(Path(sys.executable).with_name("mpirun"))
        command = [mpirun, "-n", str(workers + 2), *command]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=170)
    if done.returncode:
        raise SystemExit(f"{way}: {done.stderr[-2000:]}")
    reported: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return reported


def compare(path: Path, workers: int) -> dict[str, dict[str, Any]]:
    """Measure every way that can be taken here."""
    has_mpi = Path(sys.executable).with_name("mpirun").exists()
    return {way: run(way, path, workers) for way in WAYS if has_mpi or not way.endswith("dask-mpi")}


def table(found: dict[str, dict[str, Any]], size: float, workers: int) -> str:
    """Return what was measured as a table of Markdown; `size` is that of the spectra, bytes."""
    disk = found["files read, nothing decoded"]["seconds"][0]
    rows = [HEAD, ("---",) * len(HEAD)]
    for way, reported in found.items():
        cold, warm = reported["seconds"]
        name = f"{way} ({workers})" if way.endswith(("processes", "dask-mpi")) else way
        rates = f"{size / cold / 1e9:.2f}", f"{disk / cold:.0%}", f"{warm:.2f}", f"{size / warm / 1e9:.2f}"
        rows.append((name, f"{cold:.2f}", *rates, f"{reported['memory']:.0f}"))
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def main() -> None:
    """Make the store, measure, and print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=100_000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--table", type=Path)
    parser.add_argument("--folder", type=Path, default=Path(), help="on the disk to be measured")
    parser.add_argument("--way", choices=WAYS, help=argparse.SUPPRESS)
    parser.add_argument("--store", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.way:
        reported = measured(given.way, given.store, given.workers)
        print(json.dumps(reported))
        return
    folder = Path(tempfile.mkdtemp(prefix="reductions", dir=given.folder))
    try:
        shape = (max(given.cases // (_SHAPE[0] * _SHAPE[1]), 1), *_SHAPE)
        path = many_cases.write(folder / "many.zarr", shape)
        size = float(open_in_pieces(path)[many_cases.NAME].nbytes)
        found = compare(path, given.workers)
    finally:
        shutil.rmtree(folder)
    stored = found["files read, nothing decoded"]["result"]
    about = f"{np.prod(shape)} cases, {size / 1e9:.2f} GB of spectra, {stored / 1e9:.2f} GB in files"
    text = f"{about}, {os.cpu_count()} cores\n\n{table(found, size, given.workers)}\n"
    print(text)
    if given.table:
        given.table.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
