"""Spectra of signals whose lines are known."""

import numpy as np
import pytest
import synthetic_store
import xarray as xr

from postproc.signals.lines import order_name, spikes, strongest_lines
from postproc.signals.spectra import (
    amplitude_spectrum,
    full_spectrum,
    last_revolutions,
    samples_per_revolution,
    spectrum_data,
    spectrum_of,
    with_frequency,
)
from postproc.store.select import select
from rubhpc.errors import InputError

N = 64


def wave(function, revolutions=12, name="vertical"):
    """Samples of a function of the angle over whole revolutions."""
    revolution = np.arange(N * revolutions) / N
    return xr.DataArray(
        function(2 * np.pi * revolution),
        dims="sample",
        coords={"revolution": ("sample", revolution)},
        name=name,
        attrs={"units": "m"},
    )


def line(spectrum, order):
    return float(spectrum.sel(order=order, method="nearest", tolerance=1e-9))


def test_amplitudes_of_a_sum_of_sines_are_exact():
    signal = wave(lambda a: 7 + 3 * np.cos(a) + 2 * np.sin(a / 2 + 1) + 0.5 * np.cos(1.5 * a - 2))
    spectrum = amplitude_spectrum(signal)
    assert line(spectrum, 1.0) == pytest.approx(3.0, rel=1e-12)
    assert line(spectrum, 0.5) == pytest.approx(2.0, rel=1e-12)
    assert line(spectrum, 1.5) == pytest.approx(0.5, rel=1e-12)
    assert line(spectrum, 0.0) == pytest.approx(7.0, rel=1e-12)
    others = spectrum.where(~spectrum["order"].isin([0.0, 0.5, 1.0, 1.5]), drop=True)
    assert float(others.max()) < 1e-12
    highest = amplitude_spectrum(wave(lambda a: 0.3 * np.cos(N / 2 * a)))
    assert line(highest, N / 2) == pytest.approx(0.3, rel=1e-9)  # is not counted twice


def test_power_is_kept():
    rng = np.random.default_rng(3)
    signal = wave(lambda a: rng.normal(size=a.size))
    spectrum = amplitude_spectrum(signal).values
    # Parseval: a sine carries half its squared amplitude, the mean and the last line all of theirs
    power = np.sum(spectrum[1:-1] ** 2) / 2 + spectrum[0] ** 2 + spectrum[-1] ** 2
    assert power == pytest.approx(float((signal**2).mean()), rel=1e-12)


def test_an_orbit_of_two_lobes_has_half_orders():
    v = wave(lambda a: np.cos(a) + 0.4 * np.cos(a / 2))
    w = wave(lambda a: np.sin(a) + 0.4 * np.sin(a / 2))
    lines = strongest_lines(full_spectrum(v, w).assign_coords(period=2))
    assert list(lines["name"].values) == ["1X", "1/2X"]
    assert lines["amplitude"].values == pytest.approx([1.0, 0.4])


def test_frequencies_are_orders_of_the_spin_rate():
    spectrum = amplitude_spectrum(wave(lambda a: np.cos(a)))
    placed = with_frequency(spectrum, xr.DataArray(2 * np.pi * 25.0))
    assert float(placed["frequency"].sel(order=1.5)) == pytest.approx(37.5)
    assert placed["frequency"].attrs["units"] == "Hz"


def test_lazy_waveforms_have_lazy_spectra():
    signal = wave(lambda a: np.cos(a)).expand_dims(case=3).chunk(case=1)
    spectrum = amplitude_spectrum(signal)
    assert spectrum.chunks is not None
    assert spectrum.sel(order=1.0).values == pytest.approx(np.ones(3))


@pytest.mark.parametrize(
    ("order", "period", "name"),
    [
        (0.5, 1, "0.500X"),
        (5.5, 4, "11/2X"),
        (-1 / 3, 3, "-1/3X"),
        (0.7123, 16, "0.712X"),
    ],
)
def test_lines_are_named_as_fractions(order, period, name):
    assert order_name(order, period=period) == name


def test_lines_beside_their_order_keep_its_name():
    # 16 revolutions hold 5 1/3 periods of a third order: its line falls on 5/16
    signal = wave(lambda a: np.cos(a / 3), revolutions=16)
    lines = strongest_lines(amplitude_spectrum(signal).assign_coords(period=3), n_line=1)
    assert float(lines["order"][0]) == pytest.approx(5 / 16)
    assert str(lines["name"].values[0]) == "1/3X"


@pytest.mark.parametrize(
    ("order", "period", "name"),
    [
        (2 / 3, 3, "2/3X"),
        (2 / 3, 2, "0.667X"),
        (2 / 3, 0, "0.667X"),
        (21 / 32, 3, "0.656X"),
        (0.647, 3, "0.647X"),
        (1.0, 0, "1X"),
        (2.0, 3, "2X"),
    ],
)
def test_a_line_is_a_fraction_only_where_the_period_proves_it(order, period, name):
    # a line at 21/32 alone is no 2/3: of one at 2/3 the next line would have half the height
    signal = wave(lambda a: np.cos(order * a), revolutions=32)
    lines = strongest_lines(amplitude_spectrum(signal).assign_coords(period=period), n_line=1)
    assert str(lines["name"].values[0]) == name


def test_a_line_without_a_fraction_is_named_by_the_natural_frequency_nearby():
    signal = wave(lambda a: np.cos(a) + 0.5 * np.cos(0.3394 * a), revolutions=64)
    spectrum = with_frequency(amplitude_spectrum(signal), xr.DataArray(2 * np.pi * 7000 / 60))
    lines = strongest_lines(spectrum, 2, natural={"lateral": [116.6], "torsional": [39.6, 200.0]})
    assert lines["name"].values.tolist() == ["1X", "0.339X"]
    assert lines["near"].values.tolist() == ["", "torsional 39.6 Hz"]


@pytest.mark.parametrize(("settled", "names"), [(1, ["1/3X", "1X"]), (0, ["0.333X", "1X"])])
def test_a_motion_that_has_not_settled_proves_nothing(settled, names):
    case = one_case(3, 15).assign(settled=((), settled))
    lines = strongest_lines(spectrum_data(case, "vertical"))
    assert sorted(lines["name"].values.tolist()) == sorted(names)


def test_the_strongest_lines_come_first_and_weak_ones_not_at_all():
    signal = wave(lambda a: 5 + np.cos(2 * a) + 3 * np.cos(a) + 0.01 * np.cos(4 * a))
    lines = strongest_lines(amplitude_spectrum(signal))
    assert list(lines["name"].values) == ["1X", "2X"]
    assert lines["amplitude"].values == pytest.approx([3.0, 1.0])


def test_the_last_revolutions_are_whole_ones():
    signal = wave(lambda a: np.cos(a))
    assert samples_per_revolution(signal) == N
    kept = last_revolutions(signal, 5)
    assert kept.sizes["sample"] == 5 * N
    assert float(kept["revolution"][0]) == pytest.approx(7.0)


def one_case(period, revolutions=16):
    """A record like those of `simulate`, of a signal with a third order, with its own stored spectrum."""
    signal = wave(lambda a: np.cos(a / 3) + np.cos(a), revolutions)
    return xr.Dataset(
        {
            "vertical": signal,
            "spectrum_vertical": amplitude_spectrum(signal),
            "spin_speed": ((), 100.0),
            "period": ((), period),
        }
    )


def test_a_spectrum_that_splits_a_period_is_taken_anew():
    case = one_case(period=3)
    assert float(case["spectrum_vertical"].sel(order=slice(0.2, 0.5)).max()) < 0.9  # scalloped
    spectrum = spectrum_data(case, "vertical")
    assert line(spectrum, 1 / 3) == pytest.approx(1.0, rel=1e-12)
    assert line(spectrum, 1.0) == pytest.approx(1.0, rel=1e-12)


def test_a_spectrum_of_whole_periods_is_the_stored_one():
    spectrum = spectrum_data(one_case(period=2), "vertical")
    assert spectrum.sizes["order"] == 16 * N // 2 + 1


def test_without_stored_spectra_they_come_from_waveforms():
    whole = synthetic_store.make()
    waves = synthetic_store.make(keep=("waveform",))
    found = spectrum_of(waves, "torsion")
    assert np.allclose(found, whole["spectrum_torsion"], atol=1e-10, equal_nan=True)


def test_what_is_neither_stored_nor_a_signal_is_refused():
    with pytest.raises(InputError, match='"spectrum" in'):
        spectrum_of(synthetic_store.make(keep=()), "torsion")
    with pytest.raises(InputError, match="twist: no such signal"):
        spectrum_data(synthetic_store.make(), "twist")


def test_a_case_of_the_store_has_its_known_lines():
    choice = {"speed_ratio": 1.5, "clearance": 84e-6, "friction": 0.3, "stator_youngs_modulus": 3e9}
    lines = strongest_lines(spectrum_data(select(synthetic_store.make(), choice), "vertical"))
    found = dict(zip(lines["name"].values, lines["amplitude"].values, strict=True))
    assert found == pytest.approx({"1X": 1e-4, "2X": 3e-5, "0.500X": 2e-5}, rel=1e-5)  # of no period
    first = 1.5 * synthetic_store.FIRST_LATERAL
    assert lines["frequency"].values == pytest.approx([first, 2 * first, first / 2])


def test_spikes_reach_the_heights_of_their_lines_and_zero_between():
    x, y = spikes(np.array([0.0, 1.0, 2.0]), np.array([0.0, 3.0, 1.0]), 0.1)
    assert np.interp([0.85, 1.0, 1.15, 2.0], x, y) == pytest.approx([0, 3, 0, 1])
    assert (np.diff(x) >= 0).all()
    close, _ = spikes(np.array([0.0, 0.15, 0.3]), np.zeros(3), 0.1)
    assert (np.diff(close) >= 0).all()
