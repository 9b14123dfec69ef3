"""Maps, orbits, waveforms, sections, spectra: what they gather, and what they draw."""

import numpy as np
import pytest
import synthetic_store
import xarray as xr
from matplotlib.colors import to_rgba
from matplotlib.markers import TICKDOWN, TICKRIGHT

from postproc.cases.maps import default_axes, map_data
from postproc.figures.cells import cell_edges, hatch_cells, outline_cells
from postproc.figures.drawing import check_figure_path, house_style, new_figure, save
from postproc.figures.map import draw_maps
from postproc.figures.orbit import draw_orbit, orbit
from postproc.figures.section import draw_section
from postproc.figures.small_multiples import overlaid
from postproc.figures.spectrum import default_limit, draw_spectrum
from postproc.figures.waveform import draw_panels, draw_waveform
from postproc.signals.lines import strongest_lines
from postproc.signals.sections import section_data
from postproc.signals.spectra import check_signal, spectrum_data
from postproc.signals.waveforms import DEFAULT_SIGNALS, orbit_data, waveform_data
from postproc.store.select import select
from rubhpc.errors import InputError
from rubhpc.schema import DONE

ONE = {"speed_ratio": 0.75, "clearance": 84e-6, "friction": 0.3, "stator_youngs_modulus": 3e9}


def rest(*axes):
    """The selection without some axes."""
    return {name: value for name, value in ONE.items() if name not in axes}


@pytest.fixture(scope="module")
def store():
    return synthetic_store.make()


@pytest.fixture(scope="module")
def case(store):
    return select(store, ONE)


@pytest.fixture
def plain_map(store):
    chosen = select(store, {"friction": 0.1, "stator_youngs_modulus": 3e9})
    return lambda value: map_data(chosen, value, ["speed_ratio", "clearance"])


# maps


def bar_names(ax):
    """Names on the colour bar."""
    return [text.get_text() for text in ax.figure.axes[-1].get_yticklabels()]


def test_a_map_takes_the_longest_axes_or_those_named(store):
    assert default_axes(store) == ("speed_ratio", "clearance")
    assert default_axes(store, y="friction") == ("speed_ratio", "friction")
    assert default_axes(store, x="stator.youngs_modulus") == ("stator_youngs_modulus", "speed_ratio")
    with pytest.raises(InputError, match="two axes of several values; there is speed_ratio"):
        default_axes(select(store, {"clearance": 84e-6, "friction": 0.3, "stator_youngs_modulus": 3e9}))
    with pytest.raises(InputError, match="two axes"):
        default_axes(store, "friction", "friction")


def test_a_map_holds_the_value_the_status_and_the_validity(plain_map):
    data = plain_map("peak_contact_force")
    assert data["peak_contact_force"].dims == ("clearance", "speed_ratio")
    assert float(data["peak_contact_force"].sel(speed_ratio=1.5, clearance=84e-6)) == pytest.approx(150.0)
    assert list(data["validity"].sel(clearance=84e-6).values) == [0, 0, 0, 1, 3]
    assert np.isnan(data["peak_contact_force"].sel(speed_ratio=0.75, clearance=70e-6))


def test_one_bad_stator_spoils_the_case():
    store = synthetic_store.make(n_stator=2)
    store["minimum_slip_speed"][..., 1] = -1.0
    chosen = select(store, {"friction": 0.1, "stator_youngs_modulus": 3e9})
    data = map_data(chosen, "peak_torsion", ["speed_ratio", "clearance"])
    assert list(data["validity"].sel(clearance=84e-6).values) == [1, 1, 1, 1, 3]


def test_no_map_of_what_is_no_scalar(plain_map):
    with pytest.raises(InputError, match="vertical: not a measure of a case"):
        plain_map("vertical")
    with pytest.raises(InputError, match="did you mean peak_torsion"):
        plain_map("peak_torsio")


def test_a_map_is_drawn_with_units_hatching_and_ticks(plain_map, ax):
    assert draw_maps(plain_map("peak_contact_force"), "peak_contact_force", [ax]) == [ax]
    assert ax.get_xlabel() == "Speed ratio $r$"
    assert ax.get_ylabel() == "Clearance (µm)"
    assert ax.figure.axes[1].get_ylabel() == "Peak contact force (N)"
    labels = [text.get_text() for text in ax.figure.legends[0].get_texts()]
    assert labels == [
        "missing",
        "failed",
        "diverged",
        "out of range in 6 of 12 cases: slip (6), Euler load (3)",
    ]
    ax.figure.canvas.draw()
    assert ax.get_yticks() == pytest.approx([70, 84, 100])  # few values: each has its tick
    assert ax.get_xticks() == pytest.approx([0.75, 1.0, 1.25, 1.5, 1.7])
    assert [text.get_text() for text in ax.get_xticklabels()] == ["0.75", "1", "1.25", "1.5", "1.7"]


def test_regimes_have_colours_of_their_own(plain_map, ax):
    draw_maps(plain_map("regime"), "regime", [ax])
    assert bar_names(ax) == ["no contact", "periodic", "quasi-periodic", "chaotic"]
    mesh = ax.collections[0]
    colors = mesh.to_rgba(mesh.get_array()).reshape(3, 5, 4)  # (clearance, speed)
    assert colors[1, 0] == pytest.approx(to_rgba("#009E73"))  # periodic
    assert colors[1, 3] == pytest.approx(to_rgba("#D55E00"))  # chaotic
    assert colors[0, 0][3] == 0  # diverged: nothing but its hatch


@pytest.mark.parametrize(
    ("value", "names"),
    [
        ("period", ["none", "P1", "P2"]),
        ("status", ["missing", "done", "failed", "diverged"]),
        ("settled", ["settled"]),
    ],
)
def test_flags_are_named(plain_map, ax, value, names):
    draw_maps(plain_map(value), value, [ax])
    assert bar_names(ax) == names
    assert bool(ax.figure.legends) == (value != "status")


def test_a_map_of_settings_needs_no_result(store, ax):
    chosen = select(store, {"friction": 0.1, "stator_youngs_modulus": 3e9})
    data = map_data(chosen, "spin_speed", ["speed_ratio", "clearance"])
    draw_maps(data, "spin_speed", [ax])
    assert np.ma.count_masked(ax.collections[0].get_array()) == 0


def test_a_finished_case_may_have_no_value(plain_map, ax):
    data = plain_map("contact_duration")
    data["contact_duration"][1, 2] = np.nan  # it never touched
    draw_maps(data, "contact_duration", [ax])
    labels = [text.get_text() for text in ax.figure.legends[0].get_texts()]
    assert "no value" in labels


def test_a_logarithmic_map_needs_positive_values(plain_map, ax):
    draw_maps(plain_map("peak_contact_force"), "peak_contact_force", [ax], log=True)
    data = plain_map("peak_contact_force")
    data["peak_contact_force"] = 0 * data["peak_contact_force"]
    with pytest.raises(InputError, match="nowhere positive"):
        draw_maps(data, "peak_contact_force", [ax], log=True)


def test_cells_meet_half_way_also_on_a_log_scale():
    assert cell_edges(np.array([1.0, 2.0, 4.5])) == pytest.approx([0.5, 1.5, 3.25, 5.75])
    assert cell_edges(np.array([1.0, 10.0, 100.0])) == pytest.approx(10 ** np.array([-0.5, 0.5, 1.5, 2.5]))
    assert cell_edges(np.array([0.3])) == pytest.approx([0.15, 0.45])
    assert cell_edges(np.array([0.1, 0.4])) == pytest.approx([0.0, 0.25, 0.55])  # none below 0
    assert cell_edges(np.array([0.0, 0.2])) == pytest.approx([-0.1, 0.1, 0.3])


def test_hatched_cells_are_one_patch_of_their_area(ax):
    mask = np.array([[True, True, False], [False, False, False], [True, False, True]])
    edges = np.arange(4.0), np.arange(4.0)
    (patch,) = hatch_cells(ax, edges, mask, "gone", "//")
    boxes = patch.get_path().to_polygons(closed_only=False)
    assert len(boxes) == 3  # runs of a row are one box
    assert sum(np.ptp(b[:, 0]) * np.ptp(b[:, 1]) for b in boxes) == pytest.approx(4.0)
    assert hatch_cells(ax, edges, np.zeros((3, 3), bool), "none", "//") == []


# orbits


def test_an_orbit_is_drawn_in_micrometres_with_its_stator(case, ax):
    data = orbit_data(case)
    assert draw_orbit(data, ax) is ax
    assert ax.get_xlabel() == "Horizontal displacement (µm)"
    assert ax.get_ylabel() == "Vertical displacement (µm)"
    assert ax.get_aspect() == 1.0
    circle = next(p for p in ax.patches if hasattr(p, "get_radius"))
    assert circle.get_radius() == pytest.approx(84.0)
    face = next(line for line in ax.lines if len(line.get_xdata()) == 2)
    assert face.get_ydata() == pytest.approx([84.0, 84.0])  # straight above, across the gap
    curve = max(ax.lines, key=lambda line: len(line.get_xdata()))
    assert max(curve.get_xdata()) == pytest.approx(100.0, rel=1e-3)
    ax.figure.canvas.draw()


def test_poincare_points_are_one_a_revolution(case, ax):
    draw_orbit(orbit_data(case, revolutions=4), ax)
    dots = next(line for line in ax.lines if line.get_marker() == ".")
    assert len(dots.get_xdata()) == 4
    # half orders: every second point coincides
    assert dots.get_ydata()[:2] == pytest.approx(dots.get_ydata()[2:], rel=1e-5)
    assert abs(dots.get_ydata()[0] - dots.get_ydata()[1]) > 10


def test_orbits_along_an_axis_have_a_legend(store, ax):
    draw_orbit(orbit_data(select(store, rest("friction")), over="friction"), ax)
    labels = ax.get_legend_handles_labels()[1]
    assert labels == [r"$\mu$ = 0.1", r"$\mu$ = 0.3"]


def test_too_many_curves_are_refused(store):
    wave = store["vertical"].isel(clearance=0, friction=0, stator_youngs_modulus=0)
    many = wave.isel(speed_ratio=[0, 1, 2, 3, 4, 0, 1, 2])
    with pytest.raises(InputError, match="speed_ratio: 8 curves"):
        overlaid("sample", many)


def test_a_case_that_is_not_done_has_no_orbit(store, ax):
    missing = {"speed_ratio": 0.75, "clearance": 70e-6, "friction": 0.1, "stator_youngs_modulus": 3e9}
    with pytest.raises(InputError, match="no selected case is done"):
        draw_orbit(orbit_data(select(store, missing)), ax)


# waveforms


def test_waveforms_start_at_zero_and_last_their_revolutions(case):
    data = waveform_data(case, revolutions=2)
    turn = 1 / (0.75 * synthetic_store.FIRST_LATERAL)
    assert float(data["time"][0]) == 0.0
    assert float(data["time"][-1]) == pytest.approx(2 * turn * (1 - 1 / (2 * synthetic_store.SAMPLES)))


def test_panels_have_units_and_shade_the_contact(case):
    data = waveform_data(case)
    with house_style():
        _, axes = new_figure(len(DEFAULT_SIGNALS))
        assert draw_panels(data, axes) == axes
    labels = [" ".join(ax.get_ylabel().split()) for ax in axes]
    assert labels == [
        "Vertical displacement (µm)",
        "Horizontal displacement (µm)",
        "Torsion (µrad)",
        "Contact force (N)",
    ]
    assert axes[-1].get_xlabel() == "Time (ms)"
    # 4 revolutions that begin and end within a contact: 5 shaded spans, with force inside and none between
    assert [len(ax.patches) for ax in axes] == [5] * 4


def test_a_force_that_is_zero_throughout_has_no_negative_scale(case, ax):
    force = waveform_data(case)["contact_force"]
    draw_waveform(0.0 * force if force.ndim == 1 else 0.0 * force.isel(stator=0), ax)
    assert ax.get_ylim()[0] == 0.0 < ax.get_ylim()[1]


def test_waveforms_of_several_speeds_run_over_revolutions(store, ax):
    data = waveform_data(select(store, rest("speed_ratio")), ["torsion"], over="speed_ratio")
    draw_waveform(data["torsion"].isel(speed_ratio=slice(0, 3)), ax)
    assert ax.get_xlabel() == "Revolution"
    assert len(ax.lines) == 3


# sections


def test_sections_are_stored_or_every_whole_revolution():
    waves = select(synthetic_store.make(keep=("waveform",)), ONE)
    stored = select(synthetic_store.make(keep=("section",)), ONE)
    found = section_data(waves, ["vertical"])["section_vertical"]
    assert found.values == pytest.approx(
        section_data(stored, ["vertical"])["section_vertical"].values, rel=1e-6
    )
    with pytest.raises(InputError, match='"section" in'):
        section_data(synthetic_store.make(keep=()), ["vertical"])


def test_the_section_plane_has_a_point_a_revolution(case, ax):
    assert draw_section(section_data(case, ["horizontal", "vertical"]), "horizontal", "vertical", ax) is ax
    assert len(ax.collections[0].get_offsets()) == synthetic_store.REVOLUTIONS
    assert ax.get_ylabel() == "Vertical displacement (µm)"


# spectra


@pytest.mark.parametrize(("abscissa", "label"), [("frequency", "Frequency (Hz)"), ("order", "Order")])
def test_a_spectrum_names_its_lines(case, ax, abscissa, label):
    amplitude = spectrum_data(case, "vertical")
    assert (
        draw_spectrum(amplitude, ax, strongest_lines(amplitude), abscissa, default_limit(amplitude, abscissa))
        is ax
    )
    assert ax.get_xlabel().startswith(label)
    assert ax.get_ylabel() == "Vertical displacement amplitude (µm)"
    assert {text.get_text() for text in ax.texts} == {"1/2X", "1X", "2X"}
    assert max(ax.lines[0].get_ydata()) == pytest.approx(100.0, rel=1e-4)


def test_the_whirl_spectrum_has_two_sides(case, ax):
    amplitude = spectrum_data(case, "whirl")
    draw_spectrum(amplitude, ax, strongest_lines(amplitude), "order", 3.0)
    assert ax.get_xlim() == (-3.0, 3.0)
    assert {"forward", "backward", "1X"} <= {text.get_text() for text in ax.texts}


def test_a_spectrum_on_a_log_scale_shows_five_decades(case, ax):
    draw_spectrum(spectrum_data(case, "vertical"), ax, log=True)
    low, high = ax.get_ylim()
    assert low == pytest.approx(100e-5, rel=1e-3)
    assert high > 100


# files


def test_figures_are_saved_by_their_extension(tmp_path, case):
    with house_style():
        for suffix in (".png", ".pdf", ".svg"):
            figure, (ax,) = new_figure()
            assert 85 <= figure.get_figwidth() * 25.4 <= 90  # one column
            draw_orbit(orbit_data(case), ax)
            path = save(figure, tmp_path / f"orbit{suffix}")
            assert path.stat().st_size > 1000
    assert (tmp_path / "orbit.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize(
    ("name", "said"), [("orbit.jpeg2", "a figure is one of"), ("no/where.png", "no directory")]
)
def test_a_figure_that_cannot_be_saved_is_bad_input(tmp_path, name, said):
    with pytest.raises(InputError, match=said):
        check_figure_path(tmp_path / name)


def test_velocities_are_those_of_the_sines(case):
    rate = float(case["spin_speed"])
    found = section_data(case, ["horizontal_velocity", "torsion_velocity"])
    for name, known in (
        ("horizontal", 1e-4 * rate),
        ("torsion", 2 * 0.3 * synthetic_store.TORSION_PEAK * rate),
    ):
        velocity = found[f"section_{name}_velocity"]
        assert np.isnan(velocity.values[0])  # nothing was recorded before it
        assert velocity.values[1:] == pytest.approx(known, rel=1e-5)  # single precision is differentiated
    assert velocity.attrs["units"] == "rad s-1"


def test_velocities_need_waveforms_and_are_no_signals(case, ax):
    stored = select(synthetic_store.make(keep=("section",)), ONE)
    with pytest.raises(InputError, match='"waveform" in'):
        section_data(stored, ["vertical_velocity"])
    with pytest.raises(InputError, match="a velocity has a section alone"):
        check_signal("vertical_velocity")
    plane = section_data(case, ["vertical", "horizontal_velocity"])
    draw_section(plane, "vertical", "horizontal_velocity", ax)
    assert ax.get_ylabel() == "Horizontal velocity (mm s⁻¹)"


def test_an_orbit_names_what_it_marks(case):
    figure = orbit(case).show().figure
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    marked = {"once a revolution", "first sample", "clearance", "stator", "centre without loads"}
    assert set(names) == marked
    assert "rotation" in [text.get_text() for text in figure.axes[0].texts]


@pytest.fixture
def sagging(case):
    """An orbit of 50 um about a sag of 1 mm, in a clearance of 1.2 mm."""
    turn = np.linspace(0.0, 2 * np.pi, case.sizes["sample"], endpoint=False)
    units = {"units": "m"}
    return case.assign(
        vertical=("sample", -1e-3 + 50e-6 * np.cos(turn), units),
        horizontal=("sample", 50e-6 * np.sin(turn), units),
        clearance=((), 1.2e-3, units),
    )


def test_the_view_follows_an_orbit_that_sags_in_a_large_clearance(sagging, ax):
    draw_orbit(orbit_data(sagging), ax)
    assert ax.get_ylim()[1] == pytest.approx(-0.95 * 1e3, abs=20)
    assert ax.get_ylim()[0] < -1200 < ax.get_ylim()[0] + 50  # with the clearance below, which is near
    assert ax.get_title(loc="left") == "mean -1000 µm vertical, 0 µm horizontal"
    labels = ax.get_legend_handles_labels()[1]
    assert "clearance" in labels
    assert "centre without loads" not in labels


@pytest.mark.parametrize(("frame", "low", "high"), [("clearance", -1380, 1380), ("mean", -260, 60)])
def test_all_of_the_clearance_or_the_motion_about_its_mean_is_drawn(sagging, ax, frame, low, high):
    draw_orbit(orbit_data(sagging), ax, frame)
    assert ax.get_ylim() == pytest.approx((low, high), abs=40)
    assert ("mean" in ax.get_ylabel()) == (frame == "mean")


def test_what_had_not_settled_is_hatched(store, ax):
    settled = xr.where(store["status"] == DONE, 1, -1).astype("int8")
    settled[{"speed_ratio": 2}] = 0
    chosen = select(store.assign(settled=settled), {"friction": 0.1, "stator_youngs_modulus": 3e9})
    draw_maps(map_data(chosen, "peak_torsion", ["speed_ratio", "clearance"]), "peak_torsion", [ax])
    patch = next(p for p in ax.patches if p.get_label() == "not settled")
    corners = patch.get_path().vertices
    assert (corners[:, 0].min(), corners[:, 0].max()) == pytest.approx((1.125, 1.375))


def test_a_line_surrounds_what_is_out_of_range_where_that_is_most(plain_map, ax):
    """Hatched all over, a map shows neither its colours nor where the model holds."""
    shown = plain_map("peak_contact_force")
    shown["validity"] = shown["validity"].where(shown["validity"] > 0, 4)
    draw_maps(shown, "peak_contact_force", [ax])
    labels = [text.get_text().replace("\n", " ") for text in ax.figure.legends[0].get_texts()]
    n = int((shown["status"] == 1).sum())
    assert labels[-1].startswith(f"out of range in all {n} cases: slip (6), Euler load (3), foreshortening (")
    assert not [patch for patch in ax.patches if patch.get_label().startswith("out of range")]
    ax.figure.canvas.draw()


def test_an_outline_is_the_edge_of_its_cells(ax):
    edges = np.arange(4.0), np.arange(3.0)
    mask = np.array([[True, True, False], [False, True, False]])
    (named,) = outline_cells(ax, edges, mask, "beyond")
    assert named.get_label() == "beyond"
    segments = np.array(ax.collections[0].get_segments())
    assert np.ptp(segments, axis=1).sum() == pytest.approx(8.0)  # of three cells in an L
    assert not np.isclose(segments.mean(axis=1), [1.0, 0.5]).all(axis=1).any()  # between two of them
    assert outline_cells(ax, edges, np.zeros((2, 3), bool), "none") == []
    ticks = {line.get_marker(): np.column_stack(line.get_data()).tolist() for line in ax.lines}
    assert ticks[TICKRIGHT] == [[0.0, 0.5], [1.0, 1.5]]  # on the side of the cells
    assert ticks[TICKDOWN] == [[0.5, 1.0], [1.5, 2.0]]
