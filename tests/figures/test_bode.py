"""Bode plots: what an order is over the speed, of a study and of a run-up."""

import math

import numpy as np
import pytest
import synthetic_store
import xarray as xr

from postproc.figures.bode import bode, peaks_of
from postproc.signals.orders import order_over_speed, written_lag
from rubhpc.errors import InputError

N = 32  # samples a revolution


def study(turns=6, lag=0.0):
    """Two frictions, three speeds: amplitude 1 um per rad/s and friction, lagging by 0.01 rad per rad/s."""
    angle = 2 * math.pi * np.arange(N * turns) / N
    speed, friction = np.array([300.0, 100.0, 200.0]), np.array([1.0, 2.0])
    size = 1e-6 * speed[:, None, None] * friction[:, None]
    signal = size * np.cos(angle - lag - 0.01 * speed[:, None, None]) + 1e-4 * np.cos(0.5 * angle + 0.7)
    return xr.Dataset(
        {
            "vertical": (("speed", "friction", "sample"), signal, {"units": "m"}),
            "status": (("speed", "friction"), np.ones((3, 2), dtype=np.int8)),
            "spin_speed": ("speed", speed, {"units": "rad s-1"}),
        },
        coords={"speed": speed, "friction": friction, "revolution": ("sample", np.arange(N * turns) / N)},
    )


def test_amplitude_and_phase_are_those_of_the_order():
    found = order_over_speed(study().isel(friction=0), ["vertical"])
    assert found["speed"].values == pytest.approx([100.0, 200.0, 300.0])
    assert found["amplitude_vertical"].values == pytest.approx([1e-4, 2e-4, 3e-4])
    assert found["phase_vertical"].values == pytest.approx([-1.0, -2.0, -3.0])
    half = order_over_speed(study().isel(friction=0), ["vertical"], order=0.5)
    assert half["amplitude_vertical"].values == pytest.approx([1e-4] * 3)
    assert half["phase_vertical"].values == pytest.approx([0.7] * 3)


def test_a_diverged_case_leaves_the_phases_of_the_others():
    data = study().isel(friction=0)
    data["vertical"] = data["vertical"].where(data["speed"] != 200.0)
    found = order_over_speed(data, ["vertical"])
    assert found["phase_vertical"].values[[0, 2]] == pytest.approx([-1.0, -3.0])
    assert np.isnan(found["phase_vertical"].values[1])


def test_cases_lie_over_one_another():
    axes = bode(study(), over="friction").show()
    assert [len(ax.lines) for ax in axes] == [2, 2]
    assert axes[0].get_title(loc="left") == "Vertical displacement, 1X"
    assert axes[0].get_ylabel() == "Amplitude, 0\N{EN DASH}peak (µm)"
    assert axes[1].get_xlabel() == "Spin speed (rpm)"


def test_a_lag_begins_in_the_first_turn():
    """At 5 rad, where its mean is nearer to a whole turn."""
    lines = bode(study(lag=4.0), over="friction").show()[1].lines
    assert [line.get_ydata() for line in lines] == [pytest.approx(np.degrees([5.0, 6.0, 7.0]))] * 2


def run_ups():
    lines = np.array([[1.0, 2.0], [3.0, 4.0]]) * 1e-6
    return xr.Dataset(
        {
            "speed": ("revolution", [100.0, 90.0]),
            "amplitude_probe_a": (("revolution", "order"), lines, {"units": "m", "long_name": "amplitude"}),
            "phase_probe_a": (("revolution", "order"), lines * 1e6),
        },
        coords={"order": [0.5, 1.0], "revolution": [0, 1]},
    )


def test_a_run_up_is_drawn_by_revolution():
    run_up = run_ups()
    found = order_over_speed(run_up, ["probe_a"], order=1.0)
    assert found["amplitude_probe_a"].values == pytest.approx([2e-6, 4e-6])
    assert found["speed"].values == pytest.approx([100.0, 90.0])
    assert bode(run_up, "probe_a", order=0.5).show()[0].lines[0].get_ydata() == pytest.approx([1.0, 3.0])
    with pytest.raises(InputError, match=r"order: 3 is not followed in this run-up; choose one of 0\.5, 1"):
        order_over_speed(run_up, ["probe_a"], order=3.0)
    with pytest.raises(InputError, match=r"vertical: no order of it is followed; choose one of probe_a"):
        order_over_speed(run_up, ["vertical"])


def test_what_has_no_bode_plot_is_refused():
    with pytest.raises(InputError, match=r"5 revolutions hold no whole number of periods of order 0\.5"):
        order_over_speed(study(turns=5).isel(friction=0), ["vertical"], order=0.5)
    with pytest.raises(InputError, match="needs an axis of several speeds"):
        order_over_speed(study().isel(speed=0, friction=0), ["vertical"])
    with pytest.raises(InputError, match="select one value of friction"):
        bode(study())
    with pytest.raises(InputError, match="torsoin: no such signal"):
        bode(synthetic_store.make(), "torsoin")


def test_a_resonance_has_the_amplification_factor_of_its_damping():
    """1 / (2 D) for little damping; a force of constant size, up and down."""
    speed, damping = np.linspace(50.0, 150.0, 401), 0.05
    response = 1.0 / (1.0 - (speed / 100.0) ** 2 + 2j * damping * speed / 100.0)
    lag = -np.degrees(np.unwrap(np.angle(response)))
    for way in (1, -1):
        (peak,) = peaks_of(speed[::way], np.abs(response)[::way], lag[::way])
        assert peak.speed == pytest.approx(100.0, rel=5e-3)
        assert peak.amplification_factor == pytest.approx(1.0 / (2.0 * damping), rel=0.02)
        assert not peaks_of(speed[::way], np.abs(response)[::way], 0.3 * lag[::way])  # no resonance
    assert not peaks_of(speed[speed < 104.0], np.abs(response)[speed < 104.0], lag[speed < 104.0])
    assert not peaks_of(np.r_[speed, speed[::-1]], np.r_[response, response].real, np.r_[lag, lag])


@pytest.mark.parametrize(("touched", "words"), [(100.0, "955 rpm, rub"), (140.0, "955 rpm, AF 9.93")])
def test_peaks_of_1x_are_named_and_have_no_amplification_factor_where_the_rotor_rubs(touched, words):
    speed = np.linspace(50.0, 150.0, 101)
    response = 1e-5 / (1.0 - (speed / 100.0) ** 2 + 0.1j * speed / 100.0)
    angle = 2 * math.pi * np.arange(6 * N) / N
    signal = (response[:, None] * np.exp(1j * angle)).real
    data = study().isel(friction=0, speed=[0] * 101, drop=True).assign(vertical=(("speed", "sample"), signal))
    share = np.stack([0.2 * (speed == touched), 0.0 * speed])  # of two stators
    data = data.assign(
        vertical=data["vertical"].assign_attrs(units="m"),
        contact_fraction=(("stator", "speed"), share),
        spin_speed=("speed", speed, {"units": "rad s-1"}),
    )
    data = data.assign_coords(speed=speed)
    assert [text.get_text() for text in bode(data).show()[0].texts] == [words]
    unknown = bode(data.drop_vars("contact_fraction")).show()[0]
    assert [text.get_text() for text in unknown.texts] == ["955 rpm, AF 9.93"]
    assert not bode(data, order=2.0).show()[0].texts


def test_stretches_of_a_lag_lie_by_the_curve_drawn_before():
    """Whole turns are unknown across a gap; a coast-down is drawn as the run-up that it repeats."""
    speed = np.linspace(100.0, 200.0, 11)
    lag = np.linspace(-130.0, 50.0, 11)
    first = written_lag(-np.radians(lag), speed)
    assert first == pytest.approx(lag + 360.0)
    wound = lag + np.where(speed > 150.0, 720.0, 0.0)
    wound[5] = np.nan
    expected = np.where(np.isnan(wound), np.nan, first)
    assert written_lag(-np.radians(wound), speed, (speed, first)) == pytest.approx(expected, nan_ok=True)
    down = written_lag(-np.radians(lag[::-1]), speed[::-1])
    assert down == pytest.approx(first[::-1])
    assert np.isnan(written_lag(np.full(11, np.nan), speed, (speed, first))).all()


def test_beats_behind_a_resonance_are_no_peaks():
    """An oscillator with little damping, its speed raised by 2 Hz/s through 20 Hz: it rings on and beats."""
    rate, natural, damping, step = 2.0 * math.pi * 2.0, 2.0 * math.pi * 20.0, 0.004, 2e-4
    time = step * np.arange(round(15.0 / step))
    start = 2.0 * math.pi * 10.0
    angle = start * time + 0.5 * rate * time**2
    pole = natural * (1j * math.sqrt(1.0 - damping**2) - damping)
    ringing = np.exp(pole * time) * np.cumsum(np.exp(1j * angle - pole * time)) * step  # of the near pole
    turn = np.interp(2.0 * math.pi * np.arange(int(angle[-1] / (2.0 * math.pi))), angle, time)
    response = np.interp(turn, time, ringing * np.exp(-1j * angle))
    seen = start + rate * turn, abs(response), -np.degrees(np.unwrap(np.angle(response)))
    assert len(peaks_of(*seen)) > 1
    (peak,) = peaks_of(*seen, is_swept=True)
    assert 1.0 < peak.speed / natural < 1.08


def test_both_ways_of_a_speed_are_drawn_and_named():
    """Up through a resonance, held for ten revolutions, and down."""
    up = np.linspace(50.0, 150.0, 401)
    speed = np.r_[up, np.full(10, 150.0), up[::-1]]
    response = 1e-6 / (1.0 - (speed / 100.0) ** 2 + 0.1j * speed / 100.0)
    lines = {"amplitude_vertical": abs(response), "phase_vertical": np.unwrap(np.angle(response))}
    data = xr.Dataset(
        {name: (("revolution", "order"), values[:, None]) for name, values in lines.items()}
        | {"speed": ("revolution", speed)},
        coords={"order": [1.0], "revolution": np.arange(speed.size)},
    )
    top, _ = bode(data).show()
    rising, back = (np.flatnonzero(np.isfinite(line.get_ydata())) for line in top.lines[:2])
    assert rising[-1] <= back[0] == pytest.approx(411, abs=1)
    (named,) = top.texts  # where there is room
    assert named.get_text() == "953 rpm, AF 9.95"


def test_signals_of_different_units_share_no_ordinate():
    data = study().isel(friction=0)
    data = data.assign(torsion=data["vertical"].assign_attrs(units="rad"))
    with pytest.raises(InputError, match=r"vertical \(m\), torsion \(rad\): have different units"):
        bode(data, ["vertical", "torsion"])


def test_an_order_that_is_not_there_has_no_phase():
    """A case without contact has no torsion but rounding."""
    data = study().isel(friction=0)
    few = data.assign(torsion=(1e-18 * data["vertical"]).assign_attrs(units="rad"))
    axes = bode(few, "torsion").show()
    assert not np.isfinite(axes[1].lines[0].get_ydata()).any()
    assert axes[1].texts[0].get_text() == "1X is none, or lost in other motion: no phase"
