"""Rub indicators of signals with known content, and rates of verdicts that statistics predict."""

import math

import numpy as np
import pytest
import xarray as xr
from closed_form import read_rig, simulate
from printing import printed
from scipy.stats import norm

from postproc.cases.detection import TOGETHER, area_under_curve, judge
from postproc.figures.drawing import house_style, new_figure
from postproc.figures.indicators import NAMES, draw_panels
from postproc.signals.indicators import CHANNELS, INDICATORS, indicator_scores
from rubhpc.errors import InputError
from rubhpc.schema import DONE

N, TURNS = 128, 12  # samples a revolution, revolutions
RATE = 25.0  # Hz
SPACING = RATE / TURNS  # of spectrum lines, Hz
TORSION, STATOR = 128.05, 803.15  # natural frequencies of the packaged rig, Hz
QUIET = 1e-9  # a level of noise that changes nothing


def store(waves, rub):
    """Cases at one speed along the clearance: waves[channel] has one row a case, rub one flag a case."""
    n_case = len(rub)
    rows = {n: np.broadcast_to(waves.get(n, np.zeros(N * TURNS)), (n_case, N * TURNS)) for n in CHANNELS}
    data = {n: (("clearance", "sample"), w, {"units": "m"}) for n, w in rows.items() if n != "stator_lateral"}
    data["stator_lateral"] = (("clearance", "stator", "sample"), rows["stator_lateral"][:, None])
    data["regime"] = ("clearance", np.where(rub, 1, 0).astype(np.int8))
    data["status"] = ("clearance", np.full(n_case, DONE, dtype=np.int8))
    data["spin_speed"] = ((), 2 * math.pi * RATE)
    coords = {
        "clearance": ("clearance", 1e-6 * np.arange(1, n_case + 1), {"units": "m"}),
        "revolution": ("sample", np.arange(N * TURNS) / N),
        "stator": ("stator", [1]),
    }
    attrs = {"rig": read_rig("mokhtar2017").as_dict(), "study": {"grid": {"clearance": {}}}}
    return xr.Dataset(data, coords=coords, attrs=attrs)


TURN = 2 * math.pi * np.arange(N * TURNS) / N


def tone(order, amplitude=1.0, phase=0.0):
    return amplitude * np.cos(order * TURN + phase)


def bursts(every, natural=STATOR / RATE):
    """A ringing stator struck once in so many revolutions."""
    since = np.arange(N * TURNS) / N % every / RATE
    return np.exp(-250 * since) * np.cos(2 * math.pi * natural * RATE * since)


def levels_of(waves, rub=(True, False), **arguments):
    """Mean levels of the first case, dB."""
    scores = indicator_scores(store(waves, np.array(rub)), **({"levels": [QUIET]} | arguments))
    return {name: float(scores[name].isel(clearance=0).mean()) for name in INDICATORS}


def decibels(power):
    return 10 * math.log10(power)


@pytest.mark.parametrize("order", [4.5, 5, 16 / 3, 6])
def test_torsion_counts_at_fractions_of_the_spin_near_its_natural_frequency(order):
    found = levels_of({"torsion": tone(order, 2e-4, 0.7)})
    assert found["torsion_harmonics"] == pytest.approx(decibels((2e-4) ** 2 / 2 / SPACING))


def test_half_and_third_orders_fall_on_lines_whatever_was_recorded():
    cases = store(
        {"vertical": tone(1 / 3, 3e-5), "horizontal": tone(1 / 3, 3e-5, -math.pi / 2)}, [True, False]
    )
    scores = indicator_scores(cases.isel(sample=slice(None, 10 * N)), levels=[QUIET])
    level = float(scores["lateral_subharmonics"].isel(clearance=0).mean())
    assert level == pytest.approx(decibels((3e-5) ** 2 / (RATE / 6)))


@pytest.mark.parametrize("order", [1, 3, 5 + 1 / 12, 7])  # far from 128 Hz (5.1X), or between the multiples
def test_other_torsion_does_not_count(order):
    waves = {"torsion": np.array([tone(order, 2e-4), tone(5, 2e-4)])}
    assert levels_of(waves)["torsion_harmonics"] < -200


@pytest.mark.parametrize(
    ("order", "counts"), [(0.5, True), (1 / 3, True), (2 / 3, True), (1, False), (0.25, False)]
)
def test_whirl_counts_at_its_subharmonics(order, counts):
    for sense in (1, -1):
        found = levels_of(
            {"vertical": tone(order, 3e-5), "horizontal": tone(order, sense * 3e-5, -math.pi / 2)}
        )
        expected = decibels((3e-5) ** 2 / SPACING)
        assert (found["lateral_subharmonics"] == pytest.approx(expected)) == counts


def test_the_stator_counts_around_its_natural_frequency():
    order = round(STATOR / RATE)
    inside, outside = (levels_of({"stator_lateral": tone(o, 1e-5)}) for o in (order, 2 * order))
    assert inside["stator_resonance"] == pytest.approx(decibels((1e-5) ** 2 / 2))
    assert outside["stator_resonance"] < inside["stator_resonance"] - 100


@pytest.mark.parametrize("every", [1, 2, 3])
def test_bursts_stand_out_by_their_periodicity(every):
    rng = np.random.default_rng(2)
    struck = levels_of({"stator_lateral": bursts(every)}, levels=[1e-2])
    steady = levels_of({"stator_lateral": rng.normal(size=N * TURNS)}, levels=[1e-2])
    assert struck["contact_periodicity"] > 20
    assert steady["contact_periodicity"] < 12


def test_noise_added_to_lines_is_that_added_in_time():
    """White noise of level 1 in time: rms `reference` in 1 kHz, of the 1600 Hz that are sampled."""
    rng = np.random.default_rng(7)
    size, repeats = 2e-4, 400
    strength = size * math.sqrt(N * RATE / 2 / 1000)
    in_time = {n: strength * rng.normal(size=(repeats, N * TURNS)) for n in CHANNELS}
    measured = indicator_scores(store(in_time, np.arange(repeats) < repeats / 2), levels=[QUIET], n_draw=1)
    still = {n: np.zeros((2, N * TURNS)) for n in CHANNELS}
    for wave in still.values():  # the first case touches, and sets what level 1 stands for
        wave[0] = math.sqrt(2) * size * np.cos(40 * TURN)
    drawn = indicator_scores(store(still, np.array([True, False])), levels=[1.0], n_draw=repeats)
    assert drawn["reference"].values == pytest.approx(size)
    # benign harmonics are at 1X to 3X: none of the lines looked at is among them at this speed
    for name in INDICATORS:
        a, b = measured[name].values.ravel(), drawn[name].isel(clearance=1).values.ravel()
        assert a.mean() == pytest.approx(
            b.mean(), abs=4 * math.hypot(a.std(), b.std()) / math.sqrt(repeats)
        ), name
        assert a.std() == pytest.approx(b.std(), rel=0.2), name


def test_benign_harmonics_are_as_strong_as_stated():
    waves = {n: np.array([tone(7, math.sqrt(2)), tone(0, 0.0)]) for n in CHANNELS}
    fast = store(waves, np.array([True, False])).assign(
        spin_speed=2 * math.pi * 64.0
    )  # torsion at 2X, among them
    found = indicator_scores(fast, levels=[0.1], n_draw=2000)["torsion_harmonics"].isel(clearance=1)
    power = 10 ** (found / 10) * 64.0 / TURNS
    white = 0.01 * 64.0 / TURNS / 1000 * 8  # eight lines: 4/3, 3/2, 5/3, 2, 7/3, 5/2, 8/3, 3
    assert float(power.mean()) == pytest.approx(0.01 * 2 / 3 + white, rel=0.1)  # 2X and 3X of the three


def test_scores_do_not_depend_on_chunks_and_are_lazy():
    rng = np.random.default_rng(3)
    cases = store({n: rng.normal(size=(6, N * TURNS)) for n in CHANNELS}, np.arange(6) < 3)
    whole = indicator_scores(cases)
    parts = indicator_scores(cases.chunk(clearance=2, sample=500))
    assert parts["stator_resonance"].chunks is not None
    for name in INDICATORS:
        assert parts[name].values == pytest.approx(whole[name].values, rel=1e-9)
    other = indicator_scores(cases, seed=2)
    assert not np.allclose(other["torsion_harmonics"], whole["torsion_harmonics"])


def test_of_several_stators_the_loudest_counts():
    single = store({"stator_lateral": 1e-5 * bursts(1)}, np.array([True, False]))
    silent = xr.zeros_like(single["stator_lateral"])
    waves = xr.concat([silent, single["stator_lateral"], silent], "stator").transpose(..., "stator", "sample")
    ring = single.drop_dims("stator").assign(stator_lateral=waves).assign_coords(stator=[1, 2, 3])
    table = ring.attrs["rig"]
    ring.attrs["rig"] = {**table, "stator": [{**table["stator"][0], "angle": a} for a in (0.0, 2.0, 4.0)]}
    known, found = (indicator_scores(cases, [QUIET], 1) for cases in (single, ring))
    for name in ("torsion_harmonics", "lateral_subharmonics", "stator_resonance"):
        assert found[name].values == pytest.approx(known[name].values, abs=1e-3), name
    assert found["contact_periodicity"].values.min() > 190  # of a silent stator it would be 0 dB
    assert found["reference"].values == pytest.approx(known["reference"].values)


def test_what_is_not_done_has_no_score():
    cases = store({n: np.ones((3, N * TURNS)) for n in CHANNELS}, np.array([True, False, False]))
    is_done = xr.DataArray([True, True, False], dims="clearance")
    cases = cases.assign(torsion=cases["torsion"].where(is_done), status=cases["status"].where(is_done, 0))
    scores = indicator_scores(cases)
    assert np.isnan(scores["stator_resonance"].values[2]).all()
    assert np.isfinite(scores["stator_resonance"].values[:2]).all()


def test_a_rub_scores_higher_than_free_whirl_by_every_indicator():
    """At r = 0.75 and 100 um the orbit repeats every other revolution; at 130 um the disc swings free."""
    gaps = {1e-4: "100 um", 1.3e-4: "130 um"}
    case = {"speed_ratio": 0.75, "revolutions": 12, "keep": "waveform"}
    records = [simulate("mokhtar2017", clearance=gap, **case).to_dataset() for gap in gaps.values()]
    cases = xr.concat([r.drop_vars("clearance") for r in records], "clearance", data_vars="all")
    cases = cases.assign_coords(clearance=list(gaps))
    cases = cases.assign(status=("clearance", np.full(2, DONE, dtype=np.int8)))
    cases.attrs = {"rig": read_rig("mokhtar2017").as_dict(), "study": {"grid": {"clearance": {}}}}
    scores = indicator_scores(cases.drop_vars("contact_force"), levels=[0.03], n_draw=20)
    assert scores["rub"].values.tolist() == [True, False]
    for name in INDICATORS:
        rub, free = scores[name].values.reshape(2, 20)
        assert rub.min() > free.max(), name


@pytest.mark.parametrize(
    ("rub", "arguments", "said"),
    [
        ([False, False], {}, "no selected case touches; take smaller clearances"),
        ([True, True], {}, "stays free of contact; take clearances above"),
        ([True, False], {"levels": [0.0]}, "levels above 0"),
        ([True, False], {"levels": []}, "levels above 0"),
        ([True, False], {"n_draw": 0}, "one draw"),
    ],
)
def test_bad_input_is_refused(rub, arguments, said):
    with pytest.raises(InputError, match=said):
        indicator_scores(store({}, np.array(rub)), **arguments)


def test_sampling_too_coarse_for_the_stator_is_refused():
    slow = store({}, np.array([True, False])).assign(spin_speed=2 * math.pi * 12.0)
    with pytest.raises(InputError, match="use at least 176"):
        indicator_scores(slow)


def test_areas_under_curves():
    assert area_under_curve(np.array([3.0, 4.0]), np.array([1.0, 2.0])) == 1.0
    assert area_under_curve(np.array([1.0, 2.0]), np.array([3.0, 4.0])) == 0.0
    assert area_under_curve(np.array([1.0, 1.0]), np.array([1.0, 1.0])) == 0.5
    assert area_under_curve(np.array([1.0, 3.0]), np.array([2.0])) == 0.5
    rng = np.random.default_rng(1)
    a, b = rng.normal(1.0, 1, 20_000), rng.normal(0.0, 1, 20_000)
    assert area_under_curve(a, b) == pytest.approx(norm.cdf(1 / math.sqrt(2)), abs=0.01)


def made_scores(shifts, n_case=2000, n_draw=2):
    """Normal scores: the first half of the cases touches, which raises each indicator by its shift."""
    rng = np.random.default_rng(9)
    rub = np.arange(n_case) < n_case // 2
    dims = ("case", "level", "draw")
    return xr.Dataset(
        {
            name: (dims, -50 + 3 * (rng.normal(size=(n_case, 1, n_draw)) + shift * rub[:, None, None]))
            for name, shift in zip(INDICATORS, shifts, strict=True)
        }
        | {"rub": ("case", rub)},
        coords={"level": [0.1]},
    )


def test_rates_are_those_of_normal_scores():
    shifts = (0.0, 1.0, 2.0, 4.0)
    found = judge(made_scores(shifts)).squeeze("level")
    alone = found.sel(indicator=list(INDICATORS))
    assert alone["false_alarm_rate"].values == pytest.approx(0.05, abs=0.015)
    assert alone["detection_rate"].values == pytest.approx(
        norm.sf(norm.isf(0.05) - np.array(shifts)), abs=0.03
    )
    assert alone["area_under_curve"].values == pytest.approx(
        norm.cdf(np.array(shifts) / math.sqrt(2)), abs=0.02
    )


def test_all_together_beat_equal_ones_alone_and_err_as_rarely():
    found = judge(made_scores((1.0, 1.0, 1.0, 1.0))).squeeze("level")
    together, alone = found.sel(indicator=TOGETHER), found.sel(indicator=list(INDICATORS))
    assert float(together["area_under_curve"]) > float(alone["area_under_curve"].max()) + 0.1
    assert float(together["detection_rate"]) > float(alone["detection_rate"].max()) + 0.2
    assert float(together["false_alarm_rate"]) == pytest.approx(0.05, abs=0.015)
    verdict = found["verdict"].sel(indicator=TOGETHER)
    assert float(verdict.where(found["rub"]).mean()) == pytest.approx(float(together["detection_rate"]))


def test_indicators_that_show_nothing_have_the_rate_of_false_alarms():
    found = judge(made_scores((0.0, 0.0, 0.0, 0.0)), false_alarm=0.2).squeeze("level")
    assert found["detection_rate"].values == pytest.approx(0.2, abs=0.04)
    assert found["area_under_curve"].values == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize(
    ("n_case", "false_alarm", "said"), [(20, 0.05, "too few to learn from"), (2000, 1.5, "between 0 and 1")]
)
def test_what_cannot_be_judged_is_refused(n_case, false_alarm, said):
    with pytest.raises(InputError, match=said):
        judge(made_scores((1.0,) * 4, n_case), false_alarm)


def test_the_figure_shows_every_indicator():
    judged = judge(made_scores((0.5, 1.0, 2.0, 3.0)))
    with house_style():
        _, axes = new_figure(2)
        draw_panels(judged, axes)
    for ax in axes:
        assert {line.get_label() for line in ax.lines} >= set(NAMES.values())


@pytest.fixture
def written(tmp_path, monkeypatch):
    """A store of 100 cases: those that touch ring once a revolution, those that do not are still."""
    rub = np.arange(100) < 50
    waves = {n: np.where(rub[:, None], tone(0.5, 1e-5) + tone(5, 1e-5), 0.0) for n in CHANNELS[:3]}
    waves["stator_lateral"] = np.where(rub[:, None], 1e-5 * bursts(1), 0.0)
    store(waves, rub).to_zarr(tmp_path / "made.zarr", zarr_format=3, consolidated=False)
    monkeypatch.chdir(tmp_path)
    return "made.zarr"


def test_the_command_prints_its_table_and_writes_what_is_asked(written):
    arguments = [written, "--noise", "0.01", "--noise", "100", "--data", "rates.csv", "--scores", "scores.nc"]
    said = printed("indicators", *arguments).splitlines()
    assert "of 50 cases with rub and 50 without" in said[0]
    assert said[1].split() == ["noise", *INDICATORS, TOGETHER]
    low, high = ([float(word) for word in line.split()] for line in said[2:4])
    assert low == pytest.approx([0.01, *[1.0, 1.0] * 5])
    assert high[2::2] == pytest.approx([0.5] * 5, abs=0.15)
    assert said[4:] == ["made_indicators.png", "rates.csv", "scores.nc"]
    with xr.open_dataset("scores.nc") as scores:
        assert scores["verdict"].dims == ("indicator", "clearance", "level")
        verdict = scores["verdict"].sel(indicator=TOGETHER, level=0.01)
        assert float(verdict[:50].min()) == 1.0
        assert float(verdict[50:].mean()) < 0.15
    table = np.genfromtxt("rates.csv", delimiter=",", names=True, dtype=None, encoding=None)
    assert set(table["indicator"]) == {*INDICATORS, TOGETHER}


def test_the_command_reads_no_waveform_of_a_store_without_contact(tmp_path, monkeypatch):
    def fail(*_):
        raise AssertionError("waveforms were read")

    monkeypatch.setattr("postproc.figures.indicators.indicator_scores", fail)
    store({}, np.arange(100) < 3).to_zarr(tmp_path / "free.zarr", zarr_format=3, consolidated=False)
    with pytest.raises(InputError, match="97 selected cases without contact and 3 with it are too few"):
        printed("indicators", tmp_path / "free.zarr")
