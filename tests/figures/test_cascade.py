"""Cascades: gathering, peak holding, and the figures drawn from them."""

import itertools
import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import synthetic_store
import xarray as xr

from postproc.figures.cascade import cascade as cascade_figure
from postproc.figures.cascade import default_limit, intensity, waterfall
from postproc.figures.cascade_lines import draw_frequencies, draw_orders
from postproc.signals.cascade import below, cascade, hold_peaks, hold_rows
from postproc.store.rig_of_case import natural_frequencies, stator_places
from postproc.store.select import select
from rubhpc.errors import InputError
from rubhpc.rig.reading import read_rig, with_keys
from rubhpc.study.axis_reading import make_axis
from rubhpc.study.study import Study

CHOICE = {"clearance": 100e-6, "friction": 0.3, "stator_youngs_modulus": 3e9}


@pytest.fixture(scope="module")
def cases():
    return select(synthetic_store.make(), CHOICE)


@pytest.fixture
def spectra(cases):
    return cascade(cases)


def made(amplitude, speeds, spacing=0.25):
    """A cascade with given lines at given spin rates (Hz)."""
    spin = xr.DataArray(2 * math.pi * np.asarray(speeds, float), dims="speed_ratio")
    order = spacing * np.arange(np.shape(amplitude)[1])
    data = xr.DataArray(
        amplitude,
        dims=("speed_ratio", "order"),
        coords={"speed_ratio": np.asarray(speeds, float), "order": order, "spin_speed": spin},
        name="spectrum_torsion",
        attrs={"units": "rad"},
    )
    return data.assign_coords(frequency=data["spin_speed"] / (2 * math.pi) * data["order"])


def test_a_cascade_is_speed_by_order(spectra):
    assert spectra.dims == ("speed_ratio", "order")
    top = spectra.isel(speed_ratio=-1)
    strongest = top.isel(order=int(top.argmax("order")))
    assert float(strongest) == pytest.approx(0.3 * synthetic_store.TORSION_PEAK, rel=1e-5)
    assert float(strongest["frequency"]) == pytest.approx(2 * 1.7 * synthetic_store.FIRST_LATERAL)


def test_a_cascade_spreads_over_any_axis():
    rest = {"speed_ratio": 1.5, "clearance": 84e-6, "stator.youngs_modulus": 3e9}
    spectra = cascade(select(synthetic_store.make(), rest), along="friction")
    peaks = spectra.max("order").values
    assert peaks[1] / peaks[0] == pytest.approx(3.0, rel=1e-4)


def test_what_is_left_must_be_selected():
    with pytest.raises(InputError, match="stator_youngs_modulus"):
        cascade(select(synthetic_store.make(), {"clearance": 84e-6, "friction": 0.3}))


def test_one_case_is_no_cascade(cases):
    with pytest.raises(InputError, match="one case"):
        cascade(select(cases, {"speed_ratio": 1.0}))


def test_periods_that_do_not_divide_the_record_are_respected(cases):
    # 8 revolutions: three cases of period 3 ask for 6 of them
    period = cases["period"].copy(data=[3, 3, 3, 1, 1])
    spectra = cascade(cases.assign(period=period))
    assert float(spectra["order"][1]) == pytest.approx(1 / 6)
    assert float(spectra.isel(speed_ratio=3).sel(order=2.0)) == pytest.approx(
        0.3 * synthetic_store.TORSION_PEAK
    )


def test_only_lines_up_to_the_limit_are_kept():
    spectra = made(np.ones((2, 41)), speeds=[10.0, 20.0])
    kept = below(spectra, limit=50.0)
    assert float(kept["order"][-1]) >= 5.0  # 50 Hz of the slower
    assert kept.sizes["order"] < 25


def test_peaks_survive_in_the_bin_of_their_frequency():
    rng = np.random.default_rng(1)
    amplitude = rng.uniform(size=(3, 4001))
    spectra = made(amplitude, speeds=[1.0, 1.3, 2.1], spacing=0.01)
    held = hold_peaks(spectra, limit=20.0, n_bin=50)
    assert held.sizes == {"speed_ratio": 3, "frequency": 50}
    for i, rate in enumerate([1.0, 1.3, 2.1]):
        frequency = rate * spectra["order"].values
        for j in range(50):
            low, high = 0.4 * j, 0.4 * (j + 1)
            inside = amplitude[i, (frequency >= low - 1e-9) & (frequency < high - 1e-9)]
            assert held.values[i, j] == inside.max()


def test_bins_between_lines_take_the_nearer_line():
    spectra = made([[0.0, 1.0, 2.0, 3.0]], speeds=[4.0])  # lines at 0, 1, 2, 3 Hz
    held = hold_peaks(spectra, limit=4.0, n_bin=20).values[0]
    at = (np.arange(20) + 0.5) * 0.2
    near = np.rint(at)
    assert held[near <= 3] == pytest.approx(near[near <= 3])
    assert np.isnan(held[near > 3]).all()  # beyond the last line


def test_missing_cases_stay_missing():
    amplitude = np.ones((2, 9))
    amplitude[1] = np.nan
    held = hold_peaks(made(amplitude, speeds=[1.0, 2.0]), limit=2.0, n_bin=5)
    assert np.isfinite(held.values[0]).all()
    assert np.isnan(held.values[1]).all()


def test_peaks_are_held_chunk_by_chunk():
    spectra = made(np.random.default_rng(2).uniform(size=(6, 100)), speeds=np.arange(1, 7.0))
    lazy = hold_peaks(spectra.chunk(speed_ratio=2), limit=10.0, n_bin=30)
    assert lazy.chunks is not None
    assert len(lazy.chunks[0]) == 3
    assert np.array_equal(lazy.values, hold_peaks(spectra, limit=10.0, n_bin=30).values, equal_nan=True)


def test_rows_are_held_together_when_there_are_too_many():
    amplitude = np.zeros((10, 5))
    amplitude[3, 2] = 4.0
    amplitude[4:6] = np.nan
    held = hold_rows(made(amplitude, speeds=np.arange(1, 11.0)), n_row=5)
    assert held.sizes["speed_ratio"] == 5
    assert float(held.values[1, 2]) == 4.0
    assert np.isnan(held.values[2]).all()
    assert held["speed_ratio"].values == pytest.approx([1.5, 3.5, 5.5, 7.5, 9.5])


def test_natural_frequencies_are_those_of_the_rig(cases):
    found = natural_frequencies(cases)
    assert float(found["lateral"]) == pytest.approx(31.5596, rel=1e-4)
    assert float(found["torsional"]) == pytest.approx(128.0471, rel=1e-4)
    with pytest.raises(InputError, match="contains no rig"):
        natural_frequencies(xr.Dataset())


def test_natural_frequencies_follow_an_axis_of_the_rig(cases):
    bearing = cases.expand_dims(rotor_bearing_stiffness=[1e5, 1e6])
    axis = {"rotor.bearing.stiffness": {"unit": "N m-1", "values": [1e5, 1e6]}}
    bearing.attrs["study"] = {"grid": axis}
    lateral = natural_frequencies(bearing, "rotor_bearing_stiffness")["lateral"]
    assert lateral.dims == ("rotor_bearing_stiffness",)
    assert float(lateral[1]) == pytest.approx(31.5596, rel=1e-4)
    assert float(lateral[0]) < 0.9 * float(lateral[1])
    assert float(natural_frequencies(bearing.isel(rotor_bearing_stiffness=0))["lateral"]) == float(lateral[0])


def test_stators_follow_the_axes_of_a_real_study(cases):
    rig = read_rig("mokhtar2017")
    axes = ("speed", [100.0]), ("clearance", [1e-4]), ("friction", [0.3]), ("stator.1.angle", [0.0, 1.2])
    study = Study(
        title="as a store states it",
        rig=rig,
        axes=tuple(make_axis(name, values, rig) for name, values in axes),
        output=Path("none.zarr"),
    )
    case = cases.assign_attrs(rig=rig.as_dict(), study=study.as_dict()).assign_coords(stator_1_angle=1.2)
    assert stator_places(case) == [(1.2, 0.0, 0.0, 0.0)]


def test_stators_stand_where_the_rig_says_and_about_the_shaft_that_they_are_set_about(cases):
    assert stator_places(cases) == [(0.0, 0.0, 0.0, 0.0)]
    keys = {"rotor.gravity": 9.81, "rotor.clearance_from": "standstill"}
    rig = with_keys(read_rig("mokhtar2017"), keys)
    ((_, _, across, up),) = stator_places(cases.assign_attrs(rig=rig.as_dict()))
    assert (across, up) == (0.0, pytest.approx(-2.6855e-4, rel=1e-4))


def test_a_stator_over_another_disc_is_not_at_this_one(cases):
    rig = read_rig("mokhtar2017").as_dict()
    rig["stator"] += [rig["stator"][0] | {"node": 4, "radius": 0.05, "angle": 1.0}]
    rig["stator"] += [rig["stator"][0] | {"angle": 2.0, "clearance_offset": 1e-5}]
    assert stator_places(cases.assign_attrs(rig=rig)) == [(0.0, 0.0, 0.0, 0.0), (2.0, 1e-5, 0.0, 0.0)]


def test_the_default_limit_shows_modes_and_the_fastest_1x(spectra, cases):
    assert default_limit(spectra, natural_frequencies(cases)) == 260.0
    fastest = 1.7 * synthetic_store.FIRST_LATERAL
    assert default_limit(spectra, {}) >= 4 * fastest


@pytest.mark.parametrize("draw", [waterfall, intensity])
@pytest.mark.parametrize(
    ("abscissa", "label"), [("frequency", "Frequency (Hz)"), ("order", "Order (multiples of spin speed)")]
)
def test_figures_of_a_cascade(draw, abscissa, label, spectra, cases, ax):
    limit = 260.0 if abscissa == "frequency" else 6.0
    assert draw(spectra, ax, limit, abscissa) is ax
    assert draw_orders(ax, spectra, abscissa=abscissa) is ax
    assert draw_frequencies(ax, spectra, natural_frequencies(cases), abscissa) is ax
    assert ax.get_xlabel() == label
    assert ax.get_ylabel() == "Speed ratio $r$"
    texts = [text.get_text() for text in ax.texts]
    assert {"1X", "2X", "3X"} <= set(texts)
    assert any(text.startswith("torsional 128") for text in texts)
    ax.figure.canvas.draw()


def test_an_order_line_runs_through_its_lines(spectra, ax):
    waterfall(spectra, ax, 260.0)
    n_line = len(ax.lines)
    draw_orders(ax, spectra, [Fraction(2)])
    x, y = ax.lines[n_line].get_data()
    assert x == pytest.approx(2 * synthetic_store.FIRST_LATERAL * y)


def test_names_of_orders_stand_above_the_spectra(spectra, ax):
    """The highest line, at twice the highest speed, would lie under its own name."""
    waterfall(spectra, ax, 260.0)
    highest = max(line.get_ydata().max() for line in ax.lines[:-1])  # the last is the bar of the scale
    bar = ax.lines[-1].get_ydata()
    draw_orders(ax, spectra, [Fraction(1)])
    ax.figure.canvas.draw()
    (name,) = [text for text in ax.texts if text.get_text() == "1X"]
    lowest = ax.transData.inverted().transform(name.get_window_extent())[0, 1]
    assert lowest > max(highest, *bar)


def test_the_name_of_an_order_that_leaves_in_the_corner_is_below_the_bar_of_the_scale(ax):
    spectra = made([[0, 1e-4, 0], [0, 1e-4, 0], [0, 1e-4, 0]], [20.0, 30.0, 40.0], spacing=1.0)
    waterfall(spectra, ax, 45.0)
    draw_orders(ax, spectra, [Fraction(1)])  # at the right edge above the last row, where the bar is
    ax.figure.canvas.draw()
    (name,) = [text for text in ax.texts if text.get_text() == "1X"]
    (scale,) = [text for text in ax.texts if "rad" in text.get_text()]
    assert name.get_window_extent().y1 < scale.get_window_extent().y0
    x, y = name.get_position() if name.get_transform() == ax.transData else name.xy
    assert x == pytest.approx(y)  # on its line


def test_a_cascade_of_whirl_names_no_torsional_frequency(cases):
    named = [text.get_text() for text in cascade_figure(cases, full=True).show().texts]
    assert any(text.startswith("lateral") for text in named)
    assert not any(text.startswith("torsional") for text in named)


def test_the_waterfall_has_a_curve_for_each_finished_case(ax):
    whole = select(
        synthetic_store.make(), {"friction": 0.1, "stator_youngs_modulus": 3e9, "clearance": 70e-6}
    )
    waterfall(cascade(whole), ax, 260.0)
    assert sum(line.get_color() == "C0" for line in ax.lines) == 2  # three of five are not done


def test_rows_without_a_result_are_dotted_and_named(ax):
    spectra = made([[0, 1e-4, 0], [np.nan] * 3, [0, 1e-4, 0], [np.nan] * 3], [10.0, 11.0, 12.0, 13.0])
    waterfall(spectra, ax, 10.0)
    dotted = [line.get_ydata()[0] for line in ax.lines if line.get_color() == "0.6"]
    assert dotted == [13.0, 11.0]
    named = [text for text in ax.texts if text.get_text() == "no result"]
    assert [text.get_position()[1] for text in named] == [13.0]


def test_an_unfinished_cascade_says_so(spectra, ax):
    for draw in (waterfall, intensity):
        with pytest.raises(InputError, match="no selected case is done"):
            draw(spectra * np.nan, ax, 100.0)


def test_names_of_near_frequencies_stand_apart(spectra, ax):
    waterfall(spectra, ax, 260.0)
    draw_frequencies(ax, spectra, {"lateral": 60.0, "torsional": 110.0, "mine": 105.0, "far": 220.0})
    ax.figure.canvas.draw()
    boxes = [text.get_window_extent() for text in ax.texts if text.get_text().endswith("Hz")]
    assert len(boxes) == 4
    for box, other in itertools.combinations(boxes, 2):
        assert not box.overlaps(other)


def test_speeds_in_rpm_are_written_out(spectra, ax):
    speed = spectra["spin_speed"] * 5  # up to 16096 rpm
    over_speed = spectra.assign_coords(spin_speed=speed, speed=speed).swap_dims(speed_ratio="speed")
    waterfall(over_speed, ax, 1300.0)
    ax.figure.canvas.draw()
    assert ax.get_ylabel() == "Spin speed (rpm)"
    assert ax.get_yticklabels()[-1].get_text() == f"{float(speed[-1]) * 30 / np.pi:.0f}"  # 16096, not 1.6e4


@pytest.mark.parametrize("draw", [waterfall, intensity])
def test_rows_of_even_ratios_stand_at_their_logarithm(draw, ax):
    spectra = made(np.ones((21, 13)), np.geomspace(1.0, 100.0, 21))
    draw(spectra, ax, 3.0, "order")
    assert [text.get_text() for text in ax.get_yticklabels()] == ["1", "2", "5", "10", "20", "50", "100"]
    assert ax.get_yticks()[-1] == pytest.approx(2.0)


@pytest.mark.parametrize("draw", [waterfall, intensity])
def test_few_rows_are_ticked_one_by_one(draw, ax):
    draw(made(np.ones((3, 13)), [1.0, 10.0, 100.0]), ax, 3.0, "order")
    assert [text.get_text() for text in ax.get_yticklabels()] == ["1", "10", "100"]
    assert ax.get_yticks() == pytest.approx([0.0, 1.0, 2.0])
