"""Hilbert-Huang analysis of signals whose frequencies are known at every instant."""

import math
from functools import partial

import numpy as np
import pytest
import synthetic_store
import xarray as xr
from closed_form import simulate
from printing import printed

from postproc.figures.drawing import house_style, new_figure
from postproc.figures.hht import draw_panels, energy_time_frequency, hht
from postproc.signals.hilbert_huang import (
    analytic,
    contact_bandwidth,
    empirical_modes,
    energy_picture,
    hilbert_huang,
    median_frequency,
    span_frequencies,
)
from postproc.store.select import select
from rubhpc.errors import InputError

N = 1024  # samples a revolution
SPIN = 2 * math.pi * 25.0  # one revolution takes 40 ms
DT = 0.04 / N


def case(wave, touches=lambda turn: np.zeros(turn.size, dtype=bool), revolutions=6, name="torsion"):
    """A case with one signal of time, which touches where a mask of the part of a revolution says so."""
    revolution = np.arange(N * revolutions) / N
    force = np.where(touches(revolution % 1), 10.0, 0.0)
    return xr.Dataset(
        {
            name: ("sample", wave(revolution * 0.04), {"units": "rad"}),
            "contact_force": (("stator", "sample"), force[None], {"units": "N"}),
            "spin_speed": ((), SPIN),
        },
        coords={"revolution": ("sample", revolution), "stator": ("stator", [1])},
    )


def middle(values, share=0.1):
    """Without the ends, where a transform of a finite record is not exact."""
    n = round(share * values.size)
    return values[n:-n]


def test_two_tones_part_into_their_modes():
    t = np.arange(4096) * DT
    fast, slow = np.sin(2 * math.pi * 410 * t), 2 * np.sin(2 * math.pi * 60 * t + 1)
    first, second = empirical_modes(fast + slow, 2)
    assert middle(first) == pytest.approx(middle(fast), abs=0.03)
    assert middle(second) == pytest.approx(middle(slow), abs=0.05)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e6])
def test_modes_do_not_depend_on_the_unit(size):
    t = np.arange(2048) * DT
    signal = np.sin(2 * math.pi * 410 * t) + 2 * np.sin(2 * math.pi * 60 * t)
    assert empirical_modes(size * signal, 2) == pytest.approx(size * empirical_modes(signal, 2), rel=1e-6)


@pytest.mark.parametrize("values", [np.zeros(100), np.linspace(0, 1, 100), np.ones(4)])
def test_what_does_not_oscillate_has_no_mode(values):
    assert not empirical_modes(values).any()
    assert np.isnan(analytic(values + 1.0, DT)).all()


def test_a_chirp_has_its_frequency_at_every_instant():
    t = np.arange(8192) * DT
    mode = np.cos(2 * math.pi * (80 * t + 0.5 * 900 * t**2))
    amplitude, frequency = analytic(mode, DT)
    assert middle(frequency) == pytest.approx(middle(80 + 900 * t), rel=0.02)
    assert middle(amplitude) == pytest.approx(1.0, rel=0.02)


def test_amplitude_and_frequency_modulation_are_distinguished():
    t = np.arange(8192) * DT
    envelope = 1 + 0.3 * np.cos(2 * math.pi * 20 * t)
    swing = 300 + 40 * np.cos(2 * math.pi * 15 * t)
    phase = 2 * math.pi * (300 * t + 40 / (2 * math.pi * 15) * np.sin(2 * math.pi * 15 * t))
    amplitude, frequency = analytic(envelope * np.cos(phase), DT)
    assert middle(amplitude) == pytest.approx(middle(envelope), rel=0.02)
    assert middle(frequency) == pytest.approx(middle(swing), rel=0.02)


@pytest.mark.parametrize("phase", np.linspace(0, 2 * math.pi, 9)[:-1])
def test_a_decaying_tone_keeps_its_frequency_whatever_its_phase(phase):
    t = np.arange(1024) * DT
    amplitude, frequency = analytic(np.exp(-250 * t) * np.cos(2 * math.pi * 802 * t + phase), DT)
    early = np.isfinite(frequency) & (t < 5 / 802)
    assert np.median(frequency[early]) == pytest.approx(802, rel=0.01)
    late = np.isfinite(frequency) & (t > 5 / 802) & (t < 15 / 802)
    assert amplitude[late] == pytest.approx(np.exp(-250 * t[late]), rel=0.15)


def pushed_tone(t):
    """A free decay at 128 Hz from 4 ms in each revolution on; a push of another shape before that."""
    part = t % 0.04
    free = np.exp(-16 * part) * np.cos(2 * math.pi * 128 * part)
    return 1e-4 * np.where(part < 0.004, 3 * np.sin(math.pi * part / 0.004), free)


def test_masked_contact_leaves_the_free_frequency():
    hht = hilbert_huang(case(pushed_tone, lambda turn: turn < 0.1))
    assert hht.attrs["contact"] == "masked"
    assert float(median_frequency(hht)) == pytest.approx(128, rel=0.01)
    assert span_frequencies(hht).values == pytest.approx(np.full(6, 128), rel=0.01)
    assert not np.isfinite(hht["frequency"].values[:, hht["contact"].values]).any()
    assert not np.isfinite(hht["imf"].values[:, hht["contact"].values]).any()
    assert hht["span"].values.max() == 5


def test_two_cycles_between_contacts_are_enough_and_without_contact_there_is_one_span():
    hht = hilbert_huang(case(lambda t: np.cos(2 * math.pi * 25 * t)))
    assert span_frequencies(hht).values == pytest.approx([25.0], rel=0.01)
    hht = hilbert_huang(case(lambda t: np.exp(-16 * (t % 0.0159)) * np.cos(804 * t), lambda turn: turn < 0.6))
    assert float(median_frequency(hht)) == pytest.approx(804 / (2 * math.pi), rel=0.03)


def test_kept_contact_is_broad_and_the_ringing_after_it_sharp():
    def ringing(t):
        part = t % 0.04
        ring = np.exp(-250 * (part - 0.004)) * np.cos(2 * math.pi * 802 * (part - 0.004))
        sweep = 2 * np.sin(math.pi * part / 0.004) + 0.5 * np.sin(2 * math.pi * (500 + 1e5 * part) * part)
        return 1e-4 * np.where(part < 0.004, sweep, ring)

    hht = hilbert_huang(case(ringing, lambda turn: turn < 0.1, name="stator_lateral"), "stator_lateral")
    assert hht.attrs["contact"] == "kept"
    assert span_frequencies(hht, cycles=5).values == pytest.approx(np.full(6, 802), rel=0.02)
    width = contact_bandwidth(hht)
    assert float(width["contact"]) > 10 * float(width["free"])


def test_noise_moves_the_median_frequency_little():
    rng = np.random.default_rng(5)
    noisy = case(lambda t: pushed_tone(t) + 1e-7 * rng.normal(size=t.size), lambda turn: turn < 0.1)
    modes = hilbert_huang(noisy, n_mode=8)
    strongest = int(np.argmax(modes["energy"].sum("sample").values)) + 1  # the noise takes the first ones
    assert float(median_frequency(modes, strongest)) == pytest.approx(128, rel=0.03)


def test_the_picture_holds_the_energy():
    hht = hilbert_huang(case(lambda t: 0.2 * np.cos(2 * math.pi * 100 * t)), contact="kept")
    picture = energy_picture(hht, 200.0, n_frequency=20, n_time=50)
    strongest = picture.isel(time=slice(5, -5)).sum("time")
    # 100 Hz lies on the edge of two bins
    assert picture.isel(time=slice(5, -5)).sum("frequency").values == pytest.approx(
        np.full(40, 0.04), rel=0.01
    )
    assert set(picture["frequency"].values[np.argsort(strongest.values)[-2:]]) == {95.0, 105.0}


def test_the_last_revolutions_are_those_of_the_record():
    hht = hilbert_huang(case(pushed_tone, lambda turn: turn < 0.1), revolutions=2)
    assert hht.sizes["sample"] == 2 * N
    assert float(hht["revolution"][0]) == 4.0
    assert float(hht["time"][0]) == 0.0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"signal": "twist"}, "no such signal"),
        ({"contact": "cut"}, "masked or kept"),
        ({"n_mode": 0}, "at least 1"),
        ({"stator": 2}, "choose one from 1 to 1"),
    ],
)
def test_bad_arguments_are_refused(arguments, said):
    with pytest.raises(InputError, match=said):
        hilbert_huang(case(pushed_tone), **arguments)


@pytest.mark.parametrize(
    ("speed_ratio", "clearance", "modulus", "band"),
    [
        (0.75, "84 um", "3 GPa", (125, 131)),
        (3.0, "76 um", "3 GPa", (122, 134)),
        (2.0, "70 um", "30 GPa", (124, 132)),
    ],
)
def test_the_packaged_rig_twists_freely_at_its_natural_frequency(speed_ratio, clearance, modulus, band):
    """The paper's Figs. 8b, 12b, 14c and 16c."""
    record = simulate(
        "mokhtar2017",
        speed_ratio=speed_ratio,
        clearance=clearance,
        friction=0.3,
        overrides={"stator.youngs_modulus": modulus},
        revolutions=8,
        samples_per_revolution=1024,
        keep="waveform",
    ).to_dataset()
    twist = hilbert_huang(record)
    assert band[0] < float(median_frequency(twist)) < band[1]
    if modulus == "3 GPa":  # Figs. 8c and 14d
        ring = hilbert_huang(record, "stator_lateral")
        assert span_frequencies(ring, cycles=5).dropna("span").values == pytest.approx(803, rel=0.02)
        width = contact_bandwidth(ring)
        assert float(width["contact"]) > 5 * float(width["free"])


def test_figures_show_the_energy_at_its_frequency():
    hht = hilbert_huang(case(pushed_tone, lambda turn: turn < 0.1))
    with house_style():
        _, (ax,) = new_figure()
        energy_time_frequency(hht, ax, limit=300.0, natural={"torsional": 128.0})
        mesh = ax.collections[0].get_array().filled(-np.inf)
        rows = np.flatnonzero(mesh.max(axis=1) == mesh.max())
        assert (rows + 0.5) * 300 / mesh.shape[0] == pytest.approx(128, abs=3)
        assert [t.get_text() for t in ax.get_legend().get_texts()] == ["torsional 128 Hz"]
        assert ax.get_ylim() == (0.0, 300.0)
        _, axes = new_figure(2)
        draw_panels(hht, axes)
        assert axes[1].get_ylim()[1] == pytest.approx(256, rel=0.01)


def test_a_figure_without_oscillation_is_refused():
    hht = hilbert_huang(case(lambda t: t))
    with house_style():
        _, (ax,) = new_figure()
    with pytest.raises(InputError, match="does not oscillate between contacts"):
        energy_time_frequency(hht, ax)


@pytest.fixture
def record():
    choice = {"speed_ratio": 1.5, "clearance": 84e-6, "friction": 0.3, "stator_youngs_modulus": 3e9}
    return select(synthetic_store.make(), choice)


def test_a_motion_that_is_always_in_contact_is_shown_in_contact(record):
    assert hht(record, mode=7).lines == ()  # no median of nothing
    record["contact_force"] = 1.0 + record["contact_force"]
    record["torsion"] = record["torsion"].copy(data=np.sin(8 * math.pi * record["revolution"].values))
    with pytest.raises(InputError, match=r"torsion is in contact throughout .*\(--contact kept\)"):
        hht(record).show()
    drawing = hht(record, contact="kept")
    (line,) = drawing.lines
    assert line.startswith("median frequency in contact ")
    assert float(line.split()[4]) == pytest.approx(4 * 1.5 * synthetic_store.FIRST_LATERAL, rel=0.03)
    drawing.show()


def test_a_wall_has_no_natural_frequency_and_does_not_oscillate(record):
    record["stator_lateral"] = 0.0 * record["stator_lateral"]
    record.attrs["rig"] = record.attrs["rig"] | {"stator": [{"node": 8, "rigid": True, "radius": 0.06}]}
    del record.attrs["study"]
    drawing = hht(record, "stator_lateral")
    assert drawing.lines == ()
    with pytest.raises(InputError, match="stator_lateral is zero throughout; select another stator"):
        drawing.show()


ONE = ["speed_ratio=1.5", "clearance=84 um", "friction=0.3", "stator.youngs_modulus=3 GPa"]


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    made = synthetic_store.make()
    twist = np.sin(8 * math.pi * made["revolution"])  # 4X: three cycles between contacts
    made["torsion"] = made["torsion"].copy(data=np.broadcast_to(twist, made["torsion"].shape))
    path = tmp_path_factory.mktemp("stores") / "study.zarr"
    synthetic_store.write(path, made)
    return str(path)


@pytest.fixture
def run(store, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = [word for choice in ONE for word in ("--select", choice)]
    return partial(printed, "hht", store, *words)


def test_the_command_shows_the_frequency_and_writes_what_it_draws(run):
    said = run("--data", "hht.nc").splitlines()
    assert said[-2:] == ["study_hht.png", "hht.nc"]
    median = float(said[0].split()[5])
    assert median == pytest.approx(4 * 1.5 * synthetic_store.FIRST_LATERAL, rel=0.03)
    with xr.open_dataset("hht.nc") as hht:
        assert set(hht.data_vars) == {"signal", "imf", "amplitude", "frequency", "energy"}
        assert hht["frequency"].attrs["units"] == "Hz"
