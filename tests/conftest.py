"""What all tests share: how libraries are set, the kernels compiled once, and two synthetic stores.

Linear algebra has one thread, as under the commands: two would wait for each other on small matrices.
Examples of hypothesis have no deadline, since the first may compile a kernel, and are the same in every run.
Tests in a browser are collected where there is one. Tests in parallel have a cache of kernels each.
"""

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from browsers import find_browser
from hypothesis import settings
from kernel_cache import compile_once, use_own_cache

TESTS = Path(__file__).parent
# Folders, files and tests. Over half a second, or a process of their own, each:
SLOW = (
    "browser/",
    "cases/test_reduction_of_stores.py",
    "cases/test_sensitivity.py::test_intervals_hold_the_indices_of_the_range",
    "commands/test_cli.py",
    "commands/test_modes_command.py",
    "faults/",
    "fem/test_campbell.py::test_critical_speeds_solve_the_synchronous_problem",
    "fem/test_critical_speeds.py",
    "figures/test_accessor.py::test_each_figure_is_drawn",
    "figures/test_cascade.py::test_figures_of_a_cascade",
    "figures/test_catalogue.py",
    "figures/test_figure_commands.py",
    "figures/test_figures.py::test_figures_are_saved_by_their_extension",
    "figures/test_maps.py::test_command_draws",
    "input/test_reading.py::test_pint_stays_away_until_it_is_needed",
    "integrate/test_branch.py",
    "integrate/test_contact_stepping_march.py",
    "integrate/test_curved_march.py",
    "integrate/test_event_driven_march.py::test_dry_whip_diverges_and_says_so",
    "integrate/test_event_driven_march.py::test_endless_events_are_left_to_short_steps",
    "integrate/test_event_driven_march.py::test_shorter_kernel_calls_change_nothing_but_rounding",
    "integrate/test_initial_state.py",
    "integrate/test_knocks.py",
    "integrate/test_periodic.py::test_failure_says_why",
    "integrate/test_periodic.py::test_motion_beside_it_draws_near_by_the_largest_multiplier",
    "integrate/test_regimes_lyapunov.py",
    "integrate/test_retuned_modes.py",
    "integrate/test_driven.py",
    "integrate/test_run_up.py",
    "integrate/test_transient.py::test_laws_without_closed_form_settle_as_with_auto",
    "kernels/test_accumulators.py",
    "kernels/test_coulomb_friction.py",
    "kernels/test_jit.py",
    "mokhtar2017/",
    "mpi/",
    "project/test_dependencies.py::test_every_import_is_a_declared_dependency",
    "project/test_docs.py",
    "project/test_notebook.py",
    "project/test_slurm.py",
    "project/test_wheel.py",
    "report/",
    "rig/test_ring.py::test_a_store_tells_where_the_stators_stand",
    "running/",
    "signals/test_hilbert_huang.py",
    "signals/test_indicators.py::test_the_command_prints",
    "storage/test_growth.py",
    "storage/test_shards.py",
    "storage/test_zarr_store.py::test_damaged_metadata_are_written_anew",
    "store/test_directions.py::test_every_figure_takes_a_store_of_two_directions",
    "store/test_export.py::test_whole_store_comes_back",
    "store/test_live.py",
    "store/test_sample_store.py",
    "study/test_cases.py::test_every_case_lies_in_exactly_one_block",
    "study/test_cases.py::test_growth_keeps_identity_and_ids",
    "study/test_contact_axes.py::test_a_study_of_laws_runs_is_selected_by_name_and_recomputed",
    "study/test_initial.py::test_a_study_of_starts_runs_and_is_recomputed",
    "study/test_sampling.py::test_a_larger_sample_keeps_every_case",
    "study/test_sampling.py::test_a_store_tells_its_sample",
    "study/test_sampling.py::test_another_sample_is_refused_and_told",
    "study/test_sampling.py::test_points_that_a_library_draws_otherwise",
    "study/test_stored_state.py",
    "study/test_study.py::test_a_range_includes_its_stop_whatever_the_rounding",
    "study/test_study.py::test_no_slip_of_the_pen_gets_past_as_a_traceback",
    "study/test_warnings.py::test_unstable_speeds_are_named_once_and_have_no_amplitude",
    "validation/",
)
# Files of more than ten seconds each, begun first: else one of them may be left for the end.
LONGEST = (
    "running/test_parts.py",
    "running/test_workers.py",
    "faults/test_refusals.py",
    "cases/test_reduction_of_stores.py",
    "storage/test_growth.py",
    "faults/test_misplaced.py",
    "validation/test_full_order.py",
    "report/test_report.py",
    "browser/test_report_page.py",
    "validation/test_rub.py",
    "figures/test_figure_commands.py",
    "running/test_driver.py",
    "commands/test_modes_command.py",
    "kernels/test_jit.py",
    "faults/test_many_cases.py",
    "integrate/test_event_driven_march.py",
    "faults/test_fuzz.py",
    "running/test_continuation_runs.py",
    "kernels/test_contact_pairs.py",
    "integrate/test_contact_stepping_march.py",
    "running/test_added_measure.py",
    "storage/test_zarr_store.py",
    "storage/test_shards.py",
)
# These have deadlines, or start ranks that wait for each other busily: nothing else may run at the same time.
# ALONE in the Makefile names their folders.
SERIAL = (
    "faults/test_deaths.py::test_a_case",
    "faults/test_kill_storm.py",
    "faults/test_stops.py",
    "integrate/test_event_driven_march.py::test_signals_are_answered_however_long_a_revolution_lasts",
    "mpi/test_carried_chains.py",
    "mpi/test_ranks.py",
    "mpi/test_survivors.py",
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
    """Mark what is slow, and what must run alone; the longest files come first."""
    rank = {TESTS / name: i for i, name in enumerate(LONGEST)}
    items.sort(key=lambda item: rank.get(item.path, len(rank)))
    for item in items:
        place = f"{item.path.relative_to(TESTS).as_posix()}::{item.name}"
        for name, places in (("slow", SLOW), ("serial", SERIAL)):
            if place.startswith(places):
                item.add_marker(name)


@pytest.fixture(autouse=True)
def no_figures_left() -> Iterator[None]:
    """Close what a test has drawn in pyplot, which complains of more than twenty figures."""
    yield
    if pyplot := sys.modules.get("matplotlib.pyplot"):
        pyplot.close("all")


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
