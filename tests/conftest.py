"""What all tests share: how libraries are set, the kernels compiled once, and two synthetic stores.

Linear algebra has one thread, as under the commands: two would wait for each other on small matrices.
Examples of hypothesis have no deadline, since the first may compile a kernel, and are the same in every run.
Tests in a browser are collected where there is one.
"""

import os
from pathlib import Path

import pytest
from browsers import find_browser
from hypothesis import settings

for library in ("OMP", "OPENBLAS", "MKL", "BLIS"):
    os.environ[f"{library}_NUM_THREADS"] = "1"

settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.load_profile("repeatable")

collect_ignore = [] if find_browser() else ["browser"]


def pytest_report_header() -> str:
    """Tell which browser there is."""
    return f"browser: {find_browser() or 'no Chromium with playwright, tests/browser is left out'}"


@pytest.fixture(scope="session")
def synthetic_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A synthetic store on disk, which no test may change."""
    return _written(tmp_path_factory.mktemp("stores"))


@pytest.fixture(scope="session")
def two_stator_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same of two stators."""
    return _written(tmp_path_factory.mktemp("stores"), n_stator=2)


def _written(folder: Path, **given: int) -> Path:
    import synthetic_store  # not before libraries are held to one thread

    synthetic_store.write(folder / "study.zarr", synthetic_store.make(**given))
    return folder / "study.zarr"
