"""What the report's page carries of a case: rounded, packed, and unpacked as the browser does it."""

from dataclasses import replace

import numpy as np
import pytest
import synthetic_store
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from unpacking import unbent, unpacked_floats, unpacked_record

from postproc.report.cases import Cases, spread
from postproc.report.packing import (
    FULL,
    LEVELS,
    RATIOS,
    WAVE_STEPS,
    bends,
    pack_floats,
    quantised,
    quantised_spectrum,
)
from postproc.store.open import open_store


@given(arrays(np.float32, st.integers(0, 40), elements=st.floats(width=32)))
def test_floats_keep_four_digits(values):
    values = np.where(np.abs(values) > 1e38, 0, values)  # rounding may not carry into infinity
    back = unpacked_floats(pack_floats(values))
    assert np.array_equal(np.isnan(back), np.isnan(values))
    usual = np.abs(values) > 1e-37
    assert back[usual] == pytest.approx(values[usual], rel=2**-13 * (1 + 1e-9))


def test_codes_of_a_flag_are_kept_exactly():
    codes = np.array([np.nan, -1, 0, 1, 2, 3, 16, 4095])
    assert np.array_equal(unpacked_floats(pack_floats(codes)), codes.astype(np.float32), equal_nan=True)


def test_a_waveform_is_kept_to_a_step_of_its_range():
    wave = 3.0 + np.sin(np.linspace(0, 20, 700))
    reported, codes = quantised(wave)
    assert reported["low"] + codes * reported["step"] == pytest.approx(wave, abs=0.51 * np.ptp(wave) / 65535)
    reported, codes = quantised(np.full(5, 7.0))
    assert (reported["low"] + codes * reported["step"] == 7.0).all()


@given(arrays(np.uint16, st.integers(1, 60), elements=st.integers(0, WAVE_STEPS)))
def test_second_differences_are_undone(codes):
    assert np.array_equal(unbent(bends(codes).astype(int)), codes)


def test_a_spectrum_is_kept_within_a_pixel_over_five_decades():
    amplitude = np.array([0.0, 1e-9, 2e-5, 3.3e-3, 0.5, 1.0]) * 42
    reported, codes = quantised_spectrum(amplitude)
    back = np.where(codes > 0, reported["top"] * 10 ** (5 * (codes / RATIOS - 1)), 0)
    assert back[2:] == pytest.approx(amplitude[2:], rel=3e-3)
    assert (back[:2] == 0).all()


@pytest.mark.parametrize("detail", [FULL, *LEVELS])
def test_a_record_holds_what_the_store_does(two_stator_path, detail):
    cases = Cases(open_store(two_stator_path))
    flat = int(np.ravel_multi_index((0, 1, 1, 0), (5, 3, 2, 2)))  # of period 2
    record = unpacked_record(cases.record(flat, detail))
    waves = {(w["name"], w["stator"]): w for w in record["waves"]}
    vertical = waves["vertical", 0]
    turn = 2 * np.pi * np.arange(vertical["n"]) / record["samples"]
    wanted = sum(a * np.cos(o * turn) for o, a in synthetic_store.AMPLITUDES.items())
    assert vertical["n"] == 2 * record["samples"]  # one period
    assert vertical["values"] == pytest.approx(wanted, abs=0.51 * np.ptp(wanted) / WAVE_STEPS)
    spectra = {(s["name"], s["stator"]): s for s in record["spectra"]}
    lines = spectra["vertical", 0]["values"]
    for order, amplitude in synthetic_store.AMPLITUDES.items():
        line = round(order / record["spacing"]) - 1
        assert lines[line] == pytest.approx(amplitude, rel=3e-3)
    if "contact_force" in detail.signals:
        assert {stator for name, stator in waves if name == "contact_force"} == {1, 2}
        assert waves["contact_force", 2]["values"].max() == pytest.approx(5.0, rel=1e-4)
        assert waves["contact_force", 2]["values"].min() == 0.0
    assert len(record["section"]) == 3


def test_of_forces_the_highest_samples_are_kept(two_stator_path):
    dataset = open_store(two_stator_path).load()
    dataset["contact_force"][...] = 0.0
    dataset["contact_force"][..., 3::8] = 5.0
    dataset["period"][...] = 1
    few = replace(LEVELS[0], samples=4, revolutions=2, lines=8, signals=("contact_force",))
    dataset = dataset.chunk()
    record = unpacked_record(Cases(dataset).record(50, few))
    assert record["samples"] == 4
    assert record["waves"][0]["values"] == pytest.approx(np.full(8, 5.0))


def test_a_motion_without_a_period_keeps_more_of_its_orbit_than_of_the_rest(two_stator_path):
    dataset = open_store(two_stator_path).load()
    dataset["period"][...] = 0
    few = replace(LEVELS[0], samples=8, revolutions=3, shown=2)
    cases = Cases(dataset.chunk())
    record = unpacked_record(cases.record(int(cases.done[0]), few))
    n = {w["name"]: w["n"] // record["samples"] for w in record["waves"]}
    assert n["vertical"] == n["horizontal"] == 3
    assert n["torsion"] == n["contact_force"] == record["shown"] == 2


def test_cases_come_block_by_block_as_they_come_alone(two_stator_path):
    cases = Cases(open_store(two_stator_path))
    some = [int(i) for i in cases.done[::7]]
    found = dict(cases.records(some, LEVELS[1]))
    assert sorted(found) == some
    assert all(found[i] == cases.record(i, LEVELS[1]) for i in some[:4])


@given(st.integers(1, 60), st.integers(0, 70))
def test_cases_are_spread_evenly(n, wanted):
    chosen = spread(list(range(n)), wanted)
    assert len(chosen) == len(set(chosen)) == min(n, wanted)
    assert max(np.diff([-1, *chosen, n]), default=0) <= n / max(wanted, 1) + 2
