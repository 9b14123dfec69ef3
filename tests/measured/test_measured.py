"""Measured files: every format, order tracking, and what a record says of its own faults."""

import data_logger
import numpy as np
import pytest
from data_logger import LINES, SIGNALS, SPEED, SPEED_TABLE, TIME

import rubhpc
from postproc.measured.clock import clipped
from rubhpc.errors import InputError


def line(values, order, n=256):
    """Complex amplitude of an order over an even number of revolutions."""
    values = values[: values.size // (2 * n) * 2 * n]
    return 2 * np.mean(values * np.exp(-2j * np.pi * order * np.arange(values.size) / n))


def read(path, **keys):
    return rubhpc.measured(path, **{"time": TIME, "speed": SPEED_TABLE, "signals": SIGNALS, **keys})


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("kind", ["csv", "parquet", "h5", "mat", "uff", "wav"])
def test_amplitudes_and_phases_come_back_from_every_format(folder, kind):
    path = data_logger.write(folder / f"probe.{kind}", data_logger.steady())
    keys = {"time": None} if kind in ("uff", "wav") else {}
    if kind == "wav":  # channels have numbers, and volts that a sensitivity scales
        volts = {"sensitivity": "1 V/um", "gap": 0.0}
        keys["signals"] = {"vertical": {"column": "1", **volts}, "horizontal": {"column": "2", **volts}}
        keys |= {"speed": {"column": "3", "level": 2.5}, "full_scale": data_logger.FULL_SCALE}
    found = read(path, **keys)
    assert float(found["spin_speed"]) == pytest.approx(2 * np.pi * SPEED, rel=1e-5)
    for order, (amplitude, phase) in LINES.items():
        seen = line(found["vertical"].values, order)
        assert abs(seen) == pytest.approx(amplitude, rel=2e-3)
        assert np.angle(seen) == pytest.approx(phase, abs=5e-3)
    assert int(found["period"]) == 2
    assert found["vertical"].attrs["units"] == "m"
    assert found.attrs["note"] == ""


def test_a_file_describes_its_data_and_paths_are_relative_to_it(folder):
    data_logger.write(folder / "probe.csv", data_logger.steady(duration=0.5))
    text = '[time]\ncolumn = "t"\n[speed]\ncolumn = "kp"\nlevel = 2.5\n[signal.vertical]\ncolumn = "y"\n'
    text += 'unit = "um"\n'
    (folder / "probe.toml").write_text(text)
    by_toml, by_data = rubhpc.measured(folder / "probe.toml"), rubhpc.measured(folder / "probe.csv")
    assert by_toml.equals(by_data)
    assert list(by_toml.data_vars) == ["vertical", "spin_speed", "period"]


@pytest.mark.parametrize(
    ("heading", "separator", "decimal"),
    [
        ("# logger 7\n# 2 channels\nt;y;z;kp\ns;um;um;V\n", ";", ","),
        ("t (s)\ty (um)\tz (um)\tkp (V)\n", "\t", "."),
        ("t, y, z, kp\n", ", ", "."),
        ("", " ", "."),
    ],
)
def test_csv_of_any_dialect(folder, heading, separator, decimal):
    columns = data_logger.steady(duration=0.3)
    rows = ["".join(separator.join(f"{x:.7f}" for x in row)) for row in zip(*columns.values(), strict=True)]
    text = "\n".join(rows)
    (folder / "probe.csv").write_text(heading + (text.replace(".", ",") if decimal == "," else text) + "\n")
    names = {"t": "1", "y": "2", "z": "3", "kp": "4"} if not heading else {name: name for name in columns}
    signals = {"vertical": {"column": names["y"], "unit": "um"}}
    speed = {"column": names["kp"], "level": 2.5}
    found = read(folder / "probe.csv", time={"column": names["t"]}, speed=speed, signals=signals)
    assert abs(line(found["vertical"].values, 1)) == pytest.approx(100e-6, rel=5e-3)


def test_matrices_and_groups_of_hdf5_and_structures_of_matlab(folder):
    import h5py
    from scipy.io import savemat

    columns = data_logger.steady(duration=0.3)
    block = np.column_stack([columns["y"], columns["z"]])
    with h5py.File(folder / "probe.h5", "w") as file:
        file["run/signals"], file["run/kp"] = block, columns["kp"]
    savemat(folder / "probe.mat", {"run": {"signals": block.T, "kp": columns["kp"]}})
    signals = {"vertical": {"column": "run.signals[1]", "unit": "um"}}
    for kind in ("h5", "mat"):
        keys = {"time": {"rate": "12.8 kHz"}, "speed": {"column": "run/kp", "level": 2.5}, "signals": signals}
        found = read(folder / f"probe.{kind}", **keys)
        assert abs(line(found["vertical"].values, 1)) == pytest.approx(100e-6, rel=5e-3)
        keys["signals"] = {"vertical": {"column": "run/signals", "unit": "um"}}
        with pytest.raises(
            InputError, match=r"matrix of 2 columns; name one of its columns, run/signals\[1\]"
        ):
            read(folder / f"probe.{kind}", **keys)


def test_a_run_up_is_tracked_and_its_run_out_subtracted(folder):
    columns, (time, vector) = data_logger.run_up(run_out=10e-6)
    path = data_logger.write(folder / "up.csv", columns)
    with_run_out, without = read(path), read(path, slow_roll={"below": "660 rpm"})
    assert "spin_speed" not in without
    slow = vector[time < 0.2].mean()
    begins = without["time"].values
    turns = np.interp(np.arange(0, begins.size, 0.1), np.arange(begins.size), begins)
    # The mean over six revolutions, from three before to three after.
    true = np.convolve(np.interp(turns, time, vector), np.full(60, 1 / 60), mode="same")[::10] - slow
    seen = without["amplitude_vertical"].sel(order=1) * np.exp(1j * without["phase_vertical"].sel(order=1))
    seen = seen.values
    # A logic pulse is placed to a third of a sample, 1 % of the phase at 30 Hz.
    assert np.abs(seen - true)[6:-6].max() < 0.02 * np.abs(true).max()
    (folder / "slow.csv").write_text(path.read_text())
    of_file = read(path, slow_roll={"data": "slow.csv"})  # the mean of all revolutions, resonance included
    assert float(abs(of_file["amplitude_vertical"] - without["amplitude_vertical"]).max()) > 1e-5
    early = with_run_out["amplitude_vertical"].sel(order=1).values[2]
    assert early > 12e-6 > abs(seen[2])


@pytest.mark.parametrize(
    ("table", "unit"), [({"value": f"{60 * SPEED} rpm"}, None), ({"unit": "rpm"}, "speed")]
)
def test_a_speed_without_key_phasor_gives_relative_phases(folder, table, unit):
    columns = data_logger.steady()
    columns["kp"] = np.full(columns["t"].size, 60 * SPEED)
    speed = {"column": "kp", **table} if unit else table
    found = read(data_logger.write(folder / "probe.csv", columns), speed=speed)
    assert "phases are relative" in found.attrs["note"]
    vertical, horizontal = (line(found[name].values, 1) for name in ("vertical", "horizontal"))
    assert abs(vertical) == pytest.approx(100e-6, rel=3e-3)
    assert np.angle(horizontal / vertical) == pytest.approx(-np.pi / 2, abs=5e-3)


def test_phases_count_from_the_mark_or_from_the_pulse(folder):
    path = data_logger.write(folder / "probe.csv", data_logger.steady())
    of_pulse = read(path, speed={**SPEED_TABLE, "angle": "90 deg", "zero": "pulse"})
    of_mark = read(path, speed={**SPEED_TABLE, "angle": "90 deg"})
    assert np.angle(line(of_pulse["vertical"].values, 1)) == pytest.approx(-0.5, abs=5e-3)
    assert np.angle(line(of_mark["vertical"].values, 1)) == pytest.approx(-0.5 - np.pi / 2, abs=5e-3)


def test_sixty_pulses_per_revolution_give_the_speed(folder):
    columns = data_logger.steady(rate=51200.0, duration=0.3)
    columns["kp"] = np.where(60 * SPEED * columns["t"] % 1.0 < 0.5, 5.0, 0.0)
    found = read(
        data_logger.write(folder / "probe.csv", columns), speed={**SPEED_TABLE, "per_revolution": 60}
    )
    assert float(found["spin_speed"]) == pytest.approx(2 * np.pi * SPEED, rel=1e-4)


def test_two_probes_give_the_orbit_and_accelerations_in_g(folder):
    columns = data_logger.steady(half=0.0, noise=0.0)
    y, z = columns["y"], columns["z"]
    columns |= {
        "l": 0.00787 * (y - z) / np.sqrt(2) - 9.0,
        "r": 0.00787 * (y + z) / np.sqrt(2) - 9.5,
        "a": 0.01 * y,
    }
    probe = {"sensitivity": "7.87 V/mm", "node": 3}
    signals = {
        "left": {"column": "l", "angle": "-45 deg", "gap": "-9 V", **probe},
        "right": {"column": "r", "angle": "45 deg", "sensitivity": "200 mV/mil", "gap": "-9.5 V", "node": 3},
        "casing": {"column": "a", "sensitivity": "100 mV/g", "quantity": "acceleration"},
    }
    found = read(data_logger.write(folder / "probe.csv", columns), signals=signals)
    assert abs(line(found["vertical"].values, 1)) == pytest.approx(100e-6, rel=2e-3)  # 200 mV/mil: 7.874 V/mm
    assert abs(line(found["horizontal"].values, 1)) == pytest.approx(90e-6, rel=2e-3)
    assert abs(line(found["probe_casing"].values, 1)) == pytest.approx(0.01 * 100 / 0.1 * 9.80665, rel=1e-3)
    assert found.attrs["node"] == 3


def test_several_records_make_an_axis_of_the_speed(folder):
    for i, rate in enumerate((12800.0, 6400.0)):  # at half the rate the clock says half the speed
        columns = data_logger.steady(duration=1.0 if i == 0 else 2.0)
        columns["t"] = columns["t"] * 12800.0 / rate
        data_logger.write(folder / f"p{i}.csv", columns)
    found = read(folder / "p0.csv", data=["p0.csv", "p1.csv"])
    assert found.sizes["speed"] == 2
    assert found["speed"].values / (np.pi * SPEED) == pytest.approx([1.0, 2.0], rel=1e-4)


def spoilt(**changes):
    columns = data_logger.steady()
    return columns | {name: change(columns[name].copy()) for name, change in changes.items()}


def without(values, *spans):
    for span in spans:
        values[span] = np.nan
    return values


@pytest.mark.parametrize(
    ("columns", "note"),
    [
        (
            spoilt(y=lambda y: without(y, slice(500, 503))),
            "column y: 0.023 % of the samples are missing, up to",
        ),
        (spoilt(y=lambda y: without(y, slice(6000, 7000))), "only the longest part without them is used"),
        (spoilt(y=lambda y: np.clip(y, -90, 200)), "column y: 13 % of the samples are clipped, at -90; am"),
        (spoilt(y=lambda y: 0 * y + 3), "column y: is 3 throughout"),
        (
            spoilt(kp=lambda kp: np.where(np.arange(kp.size) // 800 == 5, 0, kp)),
            "3 pulses are missing, up to 3",
        ),
        (
            spoilt(kp=lambda kp: np.where(np.isin(np.arange(kp.size), [5000, 7100]), 5, kp)),
            "2 of 4. pulses are sp",
        ),
        (spoilt(t=lambda t: t + 1.5e-5 * np.sin(1e4 * t)), "steps are not uniform"),
    ],
    ids=["missing", "drop-out", "clipped", "dead", "pulses missing", "pulses spurious", "not uniform"],
)
def test_what_is_wrong_is_found_and_said(folder, columns, note):
    import re

    found = read(data_logger.write(folder / "probe.csv", columns))
    assert re.search(note, found.attrs["note"])
    assert all(text.startswith("probe.csv: ") for text in found.attrs["note"].splitlines())
    assert float(found["spin_speed"]) == pytest.approx(2 * np.pi * SPEED, rel=1e-3)
    assert abs(line(found["horizontal"].values, 1)) == pytest.approx(90e-6, rel=0.01)


def test_rows_that_are_missing_are_found_and_rounded_times_are_uniform(folder):
    columns = data_logger.steady()
    kept = np.ones(columns["t"].size, dtype=bool)
    kept[3000:3600], kept[9000:9003] = False, False
    gaps = read(data_logger.write(folder / "gaps.csv", {name: x[kept] for name, x in columns.items()}))
    assert "time: 603 samples are missing in 2 gaps, up to 0.0469 s in a row" in gaps.attrs["note"]
    rounded = read(data_logger.write(folder / "r.csv", columns | {"t": np.round(columns["t"], 5)}))
    assert rounded.attrs["note"] == ""


def test_a_sine_in_steps_is_not_clipped():
    sine = 100 * np.sin(np.arange(20000) * 0.013)
    for step in (0.01, 1.0, 7.0, 30.0):
        assert clipped(step * np.rint(sine / step)) == (0.0, [])
    share, levels = clipped(np.clip(np.rint(sine), -88.0, 95.0))
    assert share == pytest.approx((np.arccos(0.88) + np.arccos(0.95)) / np.pi, rel=0.05)
    assert levels == [95.0, -88.0]


@pytest.mark.parametrize(
    ("columns", "keys", "message"),
    [
        (
            {},
            {"signals": {"vertical": {"column": "yy", "unit": "um"}}},
            "probe.csv: no column yy; did you mean y?",
        ),
        ({}, {"signals": {"vertical": {"column": "y"}}}, r'its unit is missing; add unit = "um" or sens'),
        ({}, {"signals": {"vertical": {"column": "y", "unit": "umm"}}}, '"umm" is not a unit of m'),
        (
            {},
            {"signals": {"vertical": {"column": "y", "unit": "um", "angle": "45 deg"}}},
            "that of vertical is 0 deg",
        ),
        ({}, {"signals": {"a b": {"column": "y", "unit": "um"}}}, "not a valid name"),
        ({}, {"speed": {"column": "kp"}}, "neither pulses nor a speed; give level = 2.5"),
        ({}, {"speed": {"column": "kp", "level": 9}}, "go.* from 0 to 5; set level = 2.5"),
        ({}, {"speed": None}, r"\[speed\]: missing; add \[speed\] with value"),
        ({}, {"time": None}, "states no sampling rate; add"),
        ({}, {"slow_roll": {"below": "10 rpm"}}, "the lowest speed is 2838 rpm"),
        (
            {},
            {"slow_roll": {"below": "10 rpm"}, "speed": 297.0},
            "needs the angle of the shaft; give a key-phasor",
        ),
        ({"y": "nan"}, {}, "column y contains no number"),
        ({"kp": "zero"}, {}, "no key-phasor: 0 pulses cross 2.5"),
        ({"t": "zero"}, {}, r"\[time\] column t: does not increase at 12799 samples"),
        ({}, {"samples_per_revolution": 255}, "255 is odd; add 1"),
    ],
)
def test_bad_input_is_refused_in_one_line(folder, columns, keys, message):
    own = data_logger.steady()
    fill = {"nan": np.nan, "zero": 0.0}
    own |= {name: np.full(own[name].size, fill[what]) for name, what in columns.items()}
    with pytest.raises(InputError, match=message) as refused:
        read(data_logger.write(folder / "probe.csv", own), **keys)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.csv", b"", "no line of numbers"),
        ("a.csv", b"hello\nworld\n", "no line of numbers"),
        ("a.parquet", b"junk", "cannot be read as .parquet"),
        ("a.mat", b"junk" * 99, "cannot be read as .mat"),
        ("a.h5", b"junk" * 99, "cannot be read as .h5"),
        ("a.uff", b"junk" * 99, "contains no data set 58"),
        ("a.wav", b"junk" * 99, "cannot be read as .wav"),
        ("a.xlsx", b"junk", "is no measured file; give a .toml, or convert it to one of .csv"),
        ("b.csv", None, "no such file; check the path"),
    ],
)
def test_files_that_are_none(folder, name, content, message):
    if content is not None:
        (folder / name).write_bytes(content)
    with pytest.raises(InputError, match=message) as refused:
        read(folder / name)
    assert "\n" not in str(refused.value)


def test_a_study_is_no_measured_file(folder):
    (folder / "study.toml").write_text('rig = "mokhtar2017"\n[grid]\nspeed_ratio = 1.5\n')
    with pytest.raises(InputError, match="this is a study; give the store"):
        rubhpc.measured(folder / "study.toml")
