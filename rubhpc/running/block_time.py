"""How long a block takes to be encoded and written."""

from __future__ import annotations

import math
import tempfile
import time
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.storage import layout
from rubhpc.storage.block_files import BlockFiles
from rubhpc.storage.disk import flush_to_disk, write_whole
from rubhpc.storage.store import case_checksum

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.storage.manifest import Manifest

_MOST, _LONGEST = 8, 0.5  # of the first blocks, that are written, and s after which no more are


def time_block(manifest: Manifest, arrays: dict[str, NDArray[Any]]) -> float:
    """Processor seconds of a block full of a case's arrays, written to a temporary folder; 0 without one.

    It has the files and folders of a store: a block of one short case takes longer to write than to compute.
    """
    n_case = math.prod(manifest.chunk)
    data: dict[str, NDArray[Any]] = {}
    for variable in manifest.variables:
        extent = manifest.extent(variable)
        case = np.resize(arrays.get(variable.name, np.zeros(1)), extent).astype(variable.dtype)
        data[variable.name] = np.broadcast_to(case, (n_case, *extent)).copy()
    taken, end = [], time.monotonic() + _LONGEST
    try:
        with tempfile.TemporaryDirectory() as folder:
            files = BlockFiles(Path(folder), manifest)
            n_block = [-(-n // k) for n, k in zip(manifest.shape, manifest.chunk, strict=True)]
            for place in islice(np.ndindex(*n_block), _MOST):  # they share folders as in a run
                began = time.process_time()
                for i in range(n_case):
                    case_checksum(data, i)
                for variable in manifest.variables:
                    values = data[variable.name].reshape(*manifest.chunk, *manifest.extent(variable))
                    path = files.own_file(variable, place)
                    write_whole(path, layout.encode(values), is_synced=False)
                    flush_to_disk(path)
                taken.append(time.process_time() - began)
                if time.monotonic() > end:
                    break
    except OSError:  # the disk is full, or there is no folder
        return 0.0
    return float(np.mean(taken))
