"""What all tests share: how libraries are set, the kernels compiled once, and two synthetic stores.

Linear algebra has one thread, as under the commands: two would wait for each other on small matrices.
Examples of hypothesis have no deadline, since the first may compile a kernel, and are the same in every run.
Tests in a browser are collected where there is one. Tests in parallel have a cache of kernels each.
"""

import os
from pathlib import Path

import pytest
from browsers import find_browser
from hypothesis import settings
from kernel_cache import compile_once, use_own_cache

TESTS = Path(__file__).parent
# Folders, files and tests. Over half a second, or a process of their own, each:
SLOW = (
    "browser/",
    "commands/test_cli.py",
    "faults/",
    "integrate/test_contact_stepping_march.py",
    "integrate/test_event_driven_march.py::test_dry_whip_diverges_and_says_so",
    "integrate/test_event_driven_march.py::test_endless_events_are_left_to_short_steps",
    "integrate/test_event_driven_march.py::test_shorter_kernel_calls_change_nothing_but_rounding",
    "integrate/test_initial_state.py",
    "integrate/test_periodic.py::test_motion_beside_it_draws_near_by_the_largest_multiplier",
    "integrate/test_periodic.py::test_failure_says_why",
    "integrate/test_regimes_lyapunov.py",
    "kernels/test_coulomb_friction.py",
    "kernels/test_jit.py",
    "mokhtar2017/",
    "mpi/",
    "project/test_docs.py",
    "project/test_notebook.py",
    "project/test_slurm.py",
    "project/test_wheel.py",
    "report/test_report.py",
    "running/",
    "signals/test_hilbert_huang.py",
    "storage/test_growth.py",
    "validation/",
)
# These have deadlines, or start ranks that wait for each other busily: nothing else may run at the same time.
SERIAL = (
    "commands/test_cli.py::test_help_takes_no_time",
    "faults/test_deaths.py::test_a_case",
    "faults/test_kill_storm.py",
    "faults/test_stops.py",
    "integrate/test_event_driven_march.py::test_signals_are_answered_however_long_a_revolution_lasts",
    "mpi/",
)

for library in ("OMP", "OPENBLAS", "MKL", "BLIS"):
    os.environ[f"{library}_NUM_THREADS"] = "1"

settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.load_profile("repeatable")

if "PYTEST_XDIST_WORKER" in os.environ:
    use_own_cache(os.environ["PYTEST_XDIST_WORKER"])

collect_ignore = [] if find_browser() else ["browser"]


def pytest_report_header() -> str:
    """Tell which browser there is."""
    return f"browser: {find_browser() or 'no Chromium with playwright, tests/browser is left out'}"


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile the kernels before workers start."""
    is_controller = not hasattr(session.config, "workerinput")
    if is_controller and session.config.getoption("numprocesses", None):
        compile_once()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what is slow, and what must run alone."""
    for item in items:
        place = f"{item.path.relative_to(TESTS).as_posix()}::{item.name}"
        for name, places in (("slow", SLOW), ("serial", SERIAL)):
            if place.startswith(places):
                item.add_marker(name)


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
