"""Reductions of 100 000 cases against a plain loop over zarr's chunks and against reading the files."""

from __future__ import annotations

import itertools
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
import zarr
from distributed import Client, LocalCluster

from postproc.reduce import computed, envelope, mean_spectrum, open_in_pieces

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

sys.path.append(str(Path(__file__).parents[1] / "unit"))
import many_cases

pytestmark = pytest.mark.bench


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return many_cases.write(tmp_path_factory.mktemp("stores") / "many.zarr")


def chunks(path: Path) -> list[Path]:
    return [file for file in (path / many_cases.NAME / "c").rglob("*") if file.is_file()]


def read_files(path: Path) -> int:
    return sum(len(file.read_bytes()) for file in chunks(path))


def loop(path: Path) -> NDArray[np.float64]:
    """The mean as one would write it by hand: chunk by chunk, a sum and a count."""
    array = zarr.open_group(path, mode="r")[many_cases.NAME]
    total, count = np.zeros(array.shape[-1]), np.zeros(array.shape[-1])
    steps = [range(0, n, c) for n, c in zip(array.shape[:-1], array.chunks[:-1], strict=True)]
    for corner in itertools.product(*steps):
        box = tuple(slice(s, s + c) for s, c in zip(corner, array.chunks[:-1], strict=True))
        values = array[box].reshape(-1, array.shape[-1])
        total += np.nansum(values, axis=0, dtype=np.float64)
        count += np.isfinite(values).sum(axis=0)
    return total / count


def reduced(path: Path, reduction: Callable[..., object] = mean_spectrum) -> NDArray[np.float64]:
    lazy = reduction(open_in_pieces(path), "torsion")
    return computed(lazy, is_told=False)[many_cases.NAME].values


def seconds(action: Callable[[], object]) -> tuple[float, float, object]:
    """Wall and processor time of an action, and what it returned."""
    began, busy = time.perf_counter(), time.process_time()
    result = action()
    return time.perf_counter() - began, time.process_time() - busy, result


def test_reductions_take_less_than_a_loop(path: Path) -> None:
    """One pass of each, in one run; on a shared machine the processor time of this process is what holds."""
    read = seconds(lambda: read_files(path))
    by_hand = seconds(lambda: loop(path))
    threads = seconds(lambda: reduced(path))
    largest = seconds(lambda: reduced(path, envelope))
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster),
    ):
        processes = seconds(lambda: reduced(path))
    size = open_in_pieces(path)[many_cases.NAME].nbytes
    print(f"\n{size / 1e9:.2f} GB of spectra, {read[2] / 1e9:.3f} GB in files")
    for name, (wall, busy, _) in (
        ("files read from the page cache", read),
        ("mean, loop over zarr's chunks", by_hand),
        ("mean, threads", threads),
        ("envelope, threads", largest),
        ("mean, two processes", processes),
    ):
        rate, share = size / wall / 1e9, read[0] / wall
        print(f"{name:<32} {wall:7.2f} s, {busy:6.2f} s busy {rate:7.2f} GB/s {share:7.1%} of reading")
    np.testing.assert_allclose(threads[2], by_hand[2], rtol=1e-9)
    np.testing.assert_allclose(processes[2], by_hand[2], rtol=1e-9)
    assert threads[1] < by_hand[1]
