"""A store of 100 000 cases, its chunks written as the product lays them out but without the physics.

Run as a script it reduces such a store in a process of its own and prints, as JSON, what that took.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import zarr
from closed_form import Contact, read_rig

from rubhpc.schema import DIVERGED, DONE, VARIABLES
from rubhpc.storage.block_files import BlockFiles
from rubhpc.storage.layout import build, encode
from rubhpc.storage.manifest import Manifest
from rubhpc.study.axes import Axis
from rubhpc.study.cases import CaseGrid
from rubhpc.study.study import Recording, Run, Study

if TYPE_CHECKING:
    from numpy.typing import NDArray

SHAPE = (100, 50, 20)  # speed, clearance, friction
NAME = "spectrum_torsion"
LINE = 1.0  # order; of amplitude 1 + the case's friction, over a floor
FLOOR = 1e-3
LOST = 7  # one case in so many, along the clearance, has diverged


def axis(name: str, first: float, last: float, n: int) -> Axis:
    values = tuple(np.linspace(first, last, n).tolist())
    return Axis(name=name, dimension=name, unit="1", values=values, long_name=name.replace("_", " "))


def case_grid_of(shape: tuple[int, int, int], revolutions: int, folder: Path) -> CaseGrid:
    axes = (
        axis("speed_ratio", 0.9, 6, shape[0]),
        axis("clearance_ratio", 0.5, 0.9, shape[1]),
        axis("friction", 0.1, 0.5, shape[2]),
    )
    recording = Recording(revolutions=revolutions, keep=("spectrum",))
    study = Study(
        title="many",
        rig=read_rig("mokhtar2017"),
        axes=axes,
        contact=Contact(),
        recording=recording,
        run=Run(block=16),
        output=folder,
    )
    return CaseGrid(study)


def write(path: Path, shape: tuple[int, int, int] = SHAPE, revolutions: int = 64) -> Path:
    """Make a store whose torsion has one line at 1X, of known height, over noise; return its path."""
    case_grid = case_grid_of(shape, revolutions, path)
    path.mkdir()
    build(path, case_grid)
    files = BlockFiles(path, Manifest.read(path))
    group = zarr.open_group(path, mode="r+")
    is_done = np.ones(shape, dtype=bool)
    is_done[:, ::LOST] = False
    group["status"][...] = np.where(is_done, DONE, DIVERGED).astype(np.int8)
    group["peak_torsion"][...] = np.where(is_done, peak(shape), np.nan)
    order = group["order"][...]
    spectrum = FLOOR * np.random.default_rng(1).random(order.size, dtype=np.float32)
    friction = np.array(case_grid.study.axes[2].values)
    for block in case_grid.blocks():
        box = tuple(slice(s, s + n) for s, n in zip(block.start, block.shape, strict=True))
        chunk = np.full((*case_grid.chunk, order.size), np.nan, dtype=np.float32)
        inside = tuple(slice(n) for n in block.shape)
        chunk[inside] = np.where(is_done[box][..., None], spectrum, np.nan)
        chunk[(*inside, order == LINE)] = np.where(is_done[box], 1 + friction[box[2]], np.nan)[..., None]
        at = tuple(s // c for s, c in zip(block.start, case_grid.chunk, strict=True))
        file = files.own_file(VARIABLES[NAME], at)
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(encode(chunk))
    files.pack()
    return path


def peak(shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Peak torsion of the cases: 0 to 1, rising with their number."""
    return np.linspace(0, 1, int(np.prod(shape))).reshape(shape)


def reduce_all(path: Path) -> dict[str, float]:
    from postproc.cases.reduction import (
        computed,
        envelope,
        histogram,
        mean_spectrum,
        open_in_pieces,
        quantiles,
    )

    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    began = time.perf_counter()
    store = open_in_pieces(path)
    mean = computed(mean_spectrum(store, "torsion"))
    worst = computed(envelope(store, "torsion", ["clearance_ratio", "friction"]), show_progress=False)
    middle = quantiles(store, "peak_torsion", [0.5])
    counts = histogram(store, "peak_torsion", 10)
    at = {"order": int(np.argmin(np.abs(store["order"].values - LINE)))}
    return {
        "bytes": float(store[NAME].nbytes),
        "seconds": time.perf_counter() - began,
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3,
        "memory_before": before,
        "mean": float(mean[NAME].isel(at)),
        "worst": float(worst[NAME].isel(at).max()),
        "cases": int(mean["cases"]),
        "median": float(middle["peak_torsion"][0]),
        "counted": int(counts["count"].sum()),
    }


if __name__ == "__main__":
    print(json.dumps(reduce_all(Path(sys.argv[1]))))
