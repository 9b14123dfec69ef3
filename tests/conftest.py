"""What all tests share: how libraries are set, the kernels compiled once, and two synthetic stores.

Linear algebra has one thread, as under the commands: two would wait for each other on small matrices.
Examples of hypothesis have no deadline, since the first may compile a kernel, and are the same in every run.
Tests in a browser are collected where there is one, those of ROSS where it is installed. Tests in parallel
have a cache of kernels each.
"""

import gc
import os
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import psutil
import pytest
from browsers import find_browser
from hypothesis import settings
from kernel_cache import compile_once, use_own_cache

TESTS = Path(__file__).parent
# Folders, files and tests. Over half a second, or a process of their own, each:
SLOW = (
    "browser/",
    "cases/test_reduction_of_stores.py::test_command_",
    "cases/test_sensitivity.py::test_intervals_hold_the_indices_of_the_range",
    "commands/test_cli.py",
    "commands/test_modes_command.py",
    "datasets/test_dataset.py::test_equal_arguments_give_equal_bytes_and_a_case_does_not_depend_on_others",
    "datasets/test_dataset.py::test_windows_of_run_ups_have_labels_of_their_own",
    "faults/",
    "fem/test_critical_speeds.py",
    "fem/test_shaft_parts.py::test_schemes_agree",
    "fem/test_linear_design.py::test_tables_set_the_range_and_the_sag",
    "fem/test_speed_dependence.py::test_a_case_is_that_of_constant_bearings[central",
    "figures/test_accessor.py::test_each_figure_is_drawn",
    "figures/test_accessor.py::test_what_run_up_returns_has_figures_though_no_store_was_opened",
    "figures/test_basins.py::test_a_start_and_a_parameter_make_a_plane",
    "figures/test_basins.py::test_cells_have_the_colour_of_their_motion",
    "figures/test_bifurcation.py::test_command",
    "figures/test_cascade.py::test_figures_of_a_cascade",
    "figures/test_cascade.py::test_speeds_in_rpm_are_written_out",
    "figures/test_catalogue.py",
    "figures/test_figure_commands.py",
    "figures/test_figures.py::test_figures_are_saved_by_their_extension",
    "figures/test_linear_design_figures.py::test_a_rotor_of_matrices",
    "figures/test_linear_design_figures.py::test_response",
    "figures/test_maps.py::test_command_draws",
    "figures/test_maps.py::test_names_of_facets_stay_within_their_panels",
    "figures/test_run_up_figures.py::test_a_waterfall_stacks_them_at_their_speeds",
    "identification/test_identify.py",
    "input/test_reading.py::test_pint_stays_away_until_it_is_needed",
    "integrate/branches/test_branch.py",
    "integrate/branches/test_touch_that_vanishes.py",
    "running/test_branch_runs.py::test_plan_predicts_branches_from_how_far_the_first_has_come",
    "integrate/marches/test_collocation_march.py",
    "integrate/changing_speed/test_carried_modes.py",
    "integrate/changing_speed/test_driven.py",
    "integrate/changing_speed/test_unfollowed_modes.py",
    "integrate/marches/test_event_driven_march.py::test_dry_whip_diverges_and_says_so",
    "integrate/marches/test_event_driven_march.py::test_endless_events_are_left_to_collocation",
    "integrate/marches/test_event_driven_march.py::test_shorter_kernel_calls_change_nothing_but_rounding",
    "integrate/test_compilation.py::test_a_first_case_compiles_no_more_than_it_did",
    "integrate/test_independent_contact.py",
    "integrate/test_initial_state.py",
    "integrate/test_knocks.py",
    "integrate/periodic_motions/test_lyapunov_spectrum.py::test_impact_oscillator",
    "integrate/periodic_motions/test_lyapunov_spectrum.py::test_studies_store_them",
    "integrate/reduced_model/test_mode_library.py::test_forms_grow",
    "integrate/reduced_model/test_mode_library.py::test_no_switch_function",
    "integrate/reduced_model/test_truncation.py::test_contacts_that_feel_motion_along_the_rim_need_more_modes",
    "integrate/test_periodic.py::test_failure_says_why",
    "integrate/measuring/test_regimes_lyapunov.py",
    "integrate/changing_speed/test_filled_modes.py",
    "integrate/changing_speed/test_run_up.py",
    "integrate/changing_speed/test_run_up_machines.py",
    "integrate/changing_speed/test_steep_run_ups.py",
    "integrate/test_simulate.py::test_energy_balances[3-",
    "integrate/test_carried_tangent.py::test_columns_are_those_of_the_monodromy_of_each_revolution[ring",
    "integrate/test_transient.py::test_direct_way_is_one_for_every_law",
    "kernels/test_accumulators.py",
    "kernels/test_cache.py",
    "kernels/test_complementarity.py",
    "kernels/test_contact_pairs.py",
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
    "rig/test_ross_elements.py",
    "rig/test_ring.py::test_a_store_shows_where_the_stators_stand",
    "running/",
    "signals/test_hilbert_huang.py",
    "signals/test_indicators.py::test_the_command_prints",
    "storage/test_older_stores.py::test_it_is_read_as_ever",
    "storage/test_growth.py",
    "storage/test_shards.py",
    "storage/test_zarr_store.py::test_damaged_metadata_are_written_anew",
    "store/test_directions.py::test_a_direction_is_selected_by_its_name",
    "store/test_directions.py::test_every_figure_takes_a_store_of_two_directions",
    "store/test_export.py",
    "store/test_live.py",
    "store/test_postproc_store.py::test_a_stator_is_chosen",
    "store/test_sample_store.py",
    "store/test_worst.py",
    "study/test_cases.py::test_every_case_lies_in_exactly_one_block",
    "study/test_cases.py::test_growth_keeps_identity_and_ids",
    "study/test_contact_axes.py::test_a_study_of_laws_runs_is_selected_by_name_and_recomputed",
    "study/test_initial.py::test_a_study_of_starts_runs_and_is_recomputed",
    "study/test_sampling.py::test_a_larger_sample_keeps_every_case",
    "study/test_sampling.py::test_a_store_shows_its_sample",
    "study/test_sampling.py::test_another_sample_is_refused_and_reported",
    "study/test_sampling.py::test_points_that_a_library_draws_otherwise",
    "study/test_stored_state.py",
    "study/test_study.py::test_a_range_includes_its_stop_whatever_the_rounding",
    "study/test_warnings.py::test_unstable_speeds_are_named_once_and_have_no_amplitude",
    "validation/",
)
# `make faults` or `make validation` has these. Of most claims `make test` has another, by other parameters or
# in a shorter form; of these it has none: STOP on ranks, kills of workers in a refined map, dense rings.
LONG = (
    "commands/test_modes_command.py::test_figure_is_written_in_the_format_of_its_name[png]",
    "faults/test_damage.py::test_what_is_no_case_is_written_anew_without_computing[period]",
    "faults/test_damage.py::test_what_is_no_case_is_written_anew_without_computing[revolution]",
    "faults/test_damage.py::test_what_is_no_case_is_written_anew_without_computing[status]",
    "faults/test_small_disk.py",
    "faults/test_stops.py::test_a_signal_stops_a_run[2-0-",
    "faults/test_stops.py::test_the_file_stop_stops_all_ranks",
    "integrate/marches/test_collocation_march.py::test_bent_stator_moves_as_all_degrees_do[updated]",
    "integrate/marches/test_collocation_march.py::test_central_differences_come_to_it_as_steps_are_halved[3-",
    "integrate/marches/test_event_driven_march.py::test_shorter_kernel_calls_change_nothing_but_rounding[updated-3]",
    "integrate/test_initial_state.py::test_a_wall_that_moves_in_pushes_as_it_would_slowly[updated]",
    "integrate/changing_speed/test_run_up.py::test_rub_in_a_passage_meets_full_order_stepping[150.0-",
    "integrate/changing_speed/test_steep_run_ups.py::test_accelerations_of_a_steep_passage[down]",
    "integrate/changing_speed/test_steep_run_ups.py::test_rigid_rub_in_a_steep_passage",
    "mpi/test_launchers.py::test_the_wrong_launcher_is_refused[Open MPI]",
    "mpi/test_launchers.py::test_the_wrong_launcher_is_refused[srun",
    "mpi/test_ranks.py::test_any_number_of_ranks_stores_equal_bytes",
    "report/test_report.py::test_a_store_that_keeps_less_has_a_page_too[keep1]",
    "report/test_report.py::test_a_store_that_keeps_less_has_a_page_too[keep2]",
    "report/test_report.py::test_the_size_is_kept_and_what_is_left_out_is_said[300000-False]",
    "running/test_added_measure.py::test_a_store_without_a_measure_is_resumed_and_grown[True]",
    "running/test_continuation_runs.py::test_a_chain_goes_on_where_a_kill_has_cut_it[0]",
    "running/test_continuation_runs.py::test_a_chain_goes_on_where_a_kill_has_cut_it[1]",
    "running/test_continuation_runs.py::test_a_chain_goes_on_where_a_kill_has_cut_it[7]",
    "running/test_driver.py::test_a_signal_drops_the_case_in_hand_and_keeps_the_finished_ones[10]",
    "running/test_driver.py::test_a_signal_drops_the_case_in_hand_and_keeps_the_finished_ones[2]",
    "running/test_parts.py::test_parts_killed_at_every_step_lose_nothing",
    "running/test_refined_runs.py::test_kills_on_any_level_change_nothing[moments1]",
    "running/test_refined_runs.py::test_kills_on_any_level_change_nothing[moments2]",
    "storage/test_growth.py::test_a_kill_at_any_step_of_a_growth_loses_nothing[shards",
    "storage/test_shards.py::test_a_changed_byte_costs_the_cases_that_verify_names[-1]",
    "storage/test_shards.py::test_a_changed_byte_costs_the_cases_that_verify_names[3]",
    "storage/test_shards.py::test_blocks_that_are_not_packed_are_read_all_the_same[2]",
    "validation/test_annular.py::test_denser_rings_come_to_the_closed_form",
    "validation/test_bent_stator.py::test_peak_forces_of_the_packaged_rig_are_those_of_all_degrees[keys1",
    "validation/test_carrier.py::test_the_modal_scheme_agrees_with_the_central_difference[{'restitution'",
    "validation/test_carrier.py::test_the_modal_scheme_agrees_with_the_central_difference[{}]",
    "validation/test_rub.py::test_rub_is_the_same_at_every_angle_around_the_rim[central-difference-updated]",
    "validation/test_rub.py::test_rub_is_the_same_at_every_angle_around_the_rim[modal-updated]",
    "storage/test_shards.py::test_blocks_that_are_not_packed_are_read_all_the_same[1]",
    "validation/test_carrier.py::test_the_modal_scheme_agrees_with_the_central_difference[{'law'",
    "validation/test_rub.py::test_rub_is_the_same_at_every_angle_around_the_rim[central-difference-fixed]",
)
# Files of more than ten seconds each, begun first: else one of them may be left for the end.
LONGEST = (
    "running/test_parts.py",
    "running/test_workers.py",
    "faults/test_refusals.py",
    "cases/test_reduction_of_stores.py",
    "storage/test_growth.py",
    "faults/test_misplaced.py",
    "report/test_report.py",
    "browser/test_report_page.py",
    "validation/test_rub.py",
    "figures/test_figure_commands.py",
    "running/test_driver.py",
    "commands/test_modes_command.py",
    "kernels/test_jit.py",
    "faults/test_many_cases.py",
    "integrate/marches/test_event_driven_march.py",
    "faults/test_fuzz.py",
    "running/test_continuation_runs.py",
    "kernels/test_contact_pairs.py",
    "running/test_added_measure.py",
    "storage/test_zarr_store.py",
    "storage/test_shards.py",
)
# These have deadlines, or start ranks that wait for each other busily: nothing else may run at the same time.
# ALONE in the Makefile names their folders.
SERIAL = (
    "faults/test_deaths.py::test_a_case_that_never_comes_back",
    "faults/test_deaths.py::test_a_case_whose_rank_is_killed",
    "faults/test_kill_storm.py",
    "faults/test_kills_of_studies.py",
    "faults/test_stops.py",
    "integrate/marches/test_event_driven_march.py::test_signals_are_answered_however_long_a_revolution_lasts",
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
if find_spec("ross") is None:
    collect_ignore.append("rig/test_ross_elements.py")


def pytest_report_header() -> list[str]:
    """State which browser there is, and whether ROSS is."""
    ross = "installed" if find_spec("ross") else "not installed, tests/rig/test_ross_elements.py is left out"
    browser = find_browser() or "no Chromium with playwright, tests/browser is left out"
    return [f"browser: {browser}", f"ROSS: {ross}"]


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile the kernels before workers start."""
    is_controller = not hasattr(session.config, "workerinput")
    if is_controller and session.config.getoption("numprocesses", None):
        compile_once()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what is slow or long, and what must run alone; the longest files come first."""
    rank = {TESTS / name: i for i, name in enumerate(LONGEST)}
    items.sort(key=lambda item: rank.get(item.path, len(rank)))
    for item in items:
        place = f"{item.path.relative_to(TESTS).as_posix()}::{item.name}"
        for name, places in (("slow", SLOW), ("serial", SERIAL), ("long", LONG)):
            if place.startswith(places):
                item.add_marker(name)


@pytest.fixture(autouse=True, scope="session")
def no_power_cut() -> Iterator[None]:
    """Do not wait for the disk, half of the time that a run in this process takes: no test cuts the power."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda handle: None)
        yield


@pytest.fixture(autouse=True)
def no_figures_left() -> Iterator[None]:
    """Close what a test has drawn in pyplot, which complains of more than twenty figures."""
    yield
    if pyplot := sys.modules.get("matplotlib.pyplot"):
        pyplot.close("all")


@pytest.fixture(autouse=True)
def nothing_recent() -> None:
    """Forget what calls of tests before have made: a test may change what goes into it.

    Parts of a run-up refer to one another: they are looked for once the process has grown by 0.1 GB.
    """
    if recent := sys.modules.get("rubhpc.recent"):
        recent.forget()
        if resident() > HELD[-1] + 1e8:
            gc.collect()
            HELD[:] = [resident()]


HELD = [0]  # bytes of this process after the last search


def resident() -> int:
    """Bytes of memory that this process holds."""
    return int(psutil.Process().memory_info().rss)


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
