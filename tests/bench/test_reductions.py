"""Reductions of many cases against a plain loop over zarr's chunks and against reading the files."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "support"))
import many_cases
from reductions import compare, table

from postproc.cases.reduction import open_in_pieces

pytestmark = pytest.mark.bench
MOST_MEMORY = 2000.0  # MB


def test_reductions_take_less_than_a_loop_and_bounded_memory(tmp_path: Path) -> None:
    """Each way in a process of its own, one after the other; from the cache, as one's second look is."""
    path = many_cases.write(tmp_path / "many.zarr", (20, *many_cases.SHAPE[1:]))
    found = compare(path, workers=2)
    print("\n" + table(found, open_in_pieces(path)[many_cases.NAME].nbytes, 2))
    by_hand = found["mean, plain loop over zarr's chunks"]
    for way, reported in found.items():
        assert reported["memory"] < MOST_MEMORY, way
        if way.startswith("mean"):
            assert reported["result"] == pytest.approx(by_hand["result"], rel=1e-9), way
    assert found["mean, dask threads"]["seconds"][1] < by_hand["seconds"][1]
