"""Sensors by the statistics of what they give, and there and back: simulated, sensed, written, measured."""

import data_logger
import numpy as np
import pytest
import xarray as xr
from closed_form import run_up, simulate

import rubhpc
from rubhpc import Sensor, sense
from rubhpc.errors import InputError

N, TURNS, RATE = 128, 40, 50.0  # samples a revolution, revolutions, Hz
AT = np.arange(N * TURNS) / N


def motion(**orders):
    """A case at 50 Hz whose vertical motion has these orders, 1 m each."""
    wave = sum((np.cos(2 * np.pi * order * AT) for order in orders.values()), 0 * AT)
    return xr.Dataset(
        {"vertical": ("sample", wave, {"units": "m"}), "spin_speed": ((), 2 * np.pi * RATE)},
        coords={"revolution": ("sample", AT)},
    )


def seen(rate=10000.0, case=None, seed=1, **sensor):
    return sense(motion() if case is None else case, {"vertical": sensor}, rate=rate, seed=seed)[
        "vertical"
    ].values


def tone(values, frequency, rate=10000.0):
    inside = values[100:-100]
    return 2 * np.mean(
        inside
        * np.hanning(inside.size)
        * 2
        * np.exp(-2j * np.pi * frequency / rate * np.arange(100, values.size - 100))
    )


def test_white_noise_has_its_rms_and_is_flat():
    noise = seen(white=2e-6, rate=50000.0)
    assert noise.std() == pytest.approx(2e-6, rel=0.02)
    power = np.abs(np.fft.rfft(noise)) ** 2
    low, high = np.array_split(power[1:], 2)
    assert low.mean() == pytest.approx(high.mean(), rel=0.05)


def test_pink_noise_has_its_rms_and_equal_power_in_octaves():
    draws = np.array([seen(pink=3.0, rate=10240.0, seed=k) for k in range(60)])
    assert np.sqrt((draws**2).mean()) == pytest.approx(3.0, rel=0.02)
    power = (np.abs(np.fft.rfft(draws, axis=-1)) ** 2).mean(axis=0)
    octaves = [power[2**k : 2 ** (k + 1)].sum() for k in range(4, 12)]
    assert np.array(octaves) / np.mean(octaves) == pytest.approx(np.ones(8), abs=0.15)


def test_a_converter_has_steps_and_limits():
    values = seen(case=motion(x=1.0), step=0.01, full_scale=0.9, rate=20480.0)
    assert values / 0.01 == pytest.approx(np.rint(values / 0.01), abs=1e-9)
    assert values.max() == pytest.approx(0.9)
    assert (values == values.max()).mean() == pytest.approx(np.arccos(0.895) / np.pi, rel=0.05)
    fine = seen(case=motion(x=np.sqrt(2)), rate=20480.0) - seen(
        case=motion(x=np.sqrt(2)), step=1e-3, rate=20480.0
    )
    assert fine.std() == pytest.approx(1e-3 / np.sqrt(12), rel=0.05)


def test_offset_and_slow_roll_are_added():
    values = seen(offset=0.5, run_out=((1.0, 2.0, 0.7),))
    assert values.mean() == pytest.approx(0.5, abs=1e-3)
    assert tone(values, RATE) == pytest.approx(2.0 * np.exp(0.7j), abs=2e-3)


def test_a_band_takes_three_decibels_at_its_end_and_nothing_below():
    low, high = (abs(tone(seen(case=motion(x=order), band=1000.0), order * RATE)) for order in (2.0, 20.0))
    assert low == pytest.approx(1.0, abs=2e-3)
    assert high == pytest.approx(1 / np.sqrt(2), rel=0.01)


def test_what_lies_above_half_the_rate_is_filtered_and_not_folded():
    values = seen(case=motion(x=50.0), rate=4000.0)  # 2500 Hz, of which a clock alone makes 1500 Hz
    assert abs(tone(values, 1500.0, 4000.0)) < 1e-3
    assert abs(tone(seen(case=motion(x=30.0), rate=4000.0), 1500.0, 4000.0)) == pytest.approx(1.0, abs=2e-3)


def test_drop_outs_have_their_share_and_length():
    lost = np.isnan(seen(drop_outs=0.1, drop_out_length=8.0, rate=200000.0))
    first, end = (np.flatnonzero(np.diff(np.pad(lost.astype(int), 1)) == step) for step in (1, -1))
    assert lost.mean() == pytest.approx(0.1, rel=0.15)
    assert (end - first).mean() == pytest.approx(8.0, rel=0.1)


def test_draws_depend_on_the_seed_and_the_signal_alone():
    case = motion(x=1.0).assign(horizontal=motion(x=1.0)["vertical"])
    one = sense(case, {"vertical": {"white": 1.0}}, rate=5000.0, seed=4)
    both = sense(case, {"horizontal": {"white": 1.0}, "vertical": {"white": 1.0}}, rate=5000.0, seed=4)
    assert one["vertical"].equals(both["vertical"])
    noise = [both[name].values - seen(case=motion(x=1.0), rate=5000.0) for name in ("vertical", "horizontal")]
    assert abs(np.corrcoef(*noise)[0, 1]) < 0.1
    assert not one["vertical"].equals(sense(case, {"vertical": {"white": 1.0}}, rate=5000.0)["vertical"])


def test_the_key_phasor_pulses_once_a_revolution_where_the_mark_passes():
    found = sense(motion(), {"vertical": {}}, rate=100000.0, key_phasor_angle=np.pi / 2)
    rises = np.flatnonzero(np.diff(found["key_phasor"].values) > 0) + 1
    assert rises.size == TURNS
    assert found["time"].values[rises] * RATE % 1.0 == pytest.approx(np.full(TURNS, 0.25), abs=1e-3)


@pytest.mark.parametrize(
    ("sensors", "keys", "message"),
    [
        ({"vertical": {"whit": 1.0}}, {}, "sensor: whit: unknown argument; choose one of white, pink"),
        ({"vertical": {"white": -1.0}}, {}, "sensor: white: -1.0 is out of range"),
        ({"vertical": {"drop_outs": 0.6}}, {}, "0.6 of the samples cannot be lost 1.0 in a row; give a sm"),
        ({"vertical": {"band": 0.0}}, {}, "sensor: band: 0.0 is out of range; give one above 0"),
        ({"vertical": {}}, {"rate": 10.0}, "rate: 10 Hz gives 8 samples of 0.8 s; raise it"),
        ({"vertcal": {}}, {}, "vertcal: no such signal"),
        ({"vertical": {}}, {"rate": 0.0}, "rate: 0 Hz is out of range"),
    ],
)
def test_bad_sensors_are_refused_in_one_line(sensors, keys, message):
    with pytest.raises(InputError, match=message):
        sense(motion(), sensors, **{"rate": 1000.0, **keys})


@pytest.fixture(scope="module")
def case():
    record = simulate("mokhtar2017", speed_ratio=1.5, clearance_ratio=0.7, friction=0.2, revolutions=24)
    return record.to_dataset()


def test_order_amplitudes_and_phases_come_back(tmp_path, case):
    sensor = Sensor(white=1e-6, step=1e-7, offset=3e-4)
    sensed = sense(case, {"vertical": sensor, "horizontal": sensor}, rate=25600.0, key_phasor_angle=0.8)
    columns = {"t": sensed["time"].values, "y": 1e6 * sensed["vertical"].values}
    columns |= {"z": 1e6 * sensed["horizontal"].values, "kp": sensed["key_phasor"].values}
    found = rubhpc.measured(
        data_logger.write(tmp_path / "probe.csv", columns),
        time=data_logger.TIME,
        speed={"column": "kp", "level": 2.5, "angle": 0.8},
        signals={name: {"column": at, "unit": "um"} for name, at in (("vertical", "y"), ("horizontal", "z"))},
    )
    assert int(found["period"]) == int(case["period"])
    n, turns = 256, 20
    for name in ("vertical", "horizontal"):
        true, back = (np.fft.rfft(one[name].values[-turns * n :]) * 2 / (turns * n) for one in (case, found))
        for order in (1, 2, 3):
            at = order * turns
            assert abs(back[at] - true[at]) < 0.005 * abs(true[at]) + 2e-7, (name, order)
    assert found["vertical"].values.mean() - case["vertical"].values.mean() == pytest.approx(3e-4, abs=5e-6)


def test_a_run_up_is_sensed_at_its_speeds(tmp_path):
    passage = run_up("mokhtar2017", start="1200 rpm", stop="1800 rpm", time="1 s", clearance="5 mm")
    sensed = sense(passage, {"vertical": {"step": 1e-8}, "stator_lateral": {}}, rate=12800.0)
    sensed.to_dataframe().to_csv(tmp_path / "up.csv")
    found = rubhpc.measured(
        tmp_path / "up.csv",
        time={"column": "time"},
        speed={"column": "key_phasor", "level": 2.5},
        signals={"vertical": {"unit": "m"}},
    )
    own = passage["amplitude_vertical"].sel(order=1).values
    back = found["amplitude_vertical"].sel(order=1).values  # from the second pulse on
    assert back[3:-4] == pytest.approx(own[4 : back.size - 3], rel=2e-3)
    assert found["speed"].values[3:-4] == pytest.approx(passage["speed"].values[4 : back.size - 3], rel=2e-3)
