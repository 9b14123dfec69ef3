"""Spans of contact, jumps and decays of signals made to have them, and of the packaged rig."""

import math

import numpy as np
import pytest
import xarray as xr
from closed_form import read_rig, simulate

from postproc.signals.contacts import (
    contact_spans,
    event_jumps,
    events_in_signal,
    free_decay,
    free_spans,
    peak_after_contact,
    sample_time,
    signal_of,
    touching,
)
from postproc.signals.decay import decaying_sine
from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble
from rubhpc.fem.modes import modes
from rubhpc.rig.reading import with_keys

N = 512  # samples a revolution
TURN = 0.04  # s
DT = TURN / N


def case(signals, forces, revolutions=4):
    """A case of some signals over time, and the force of each stator over the part of a revolution."""
    revolution = np.arange(N * revolutions) / N
    force = np.array([f(revolution % 1) for f in forces])
    waves = {n: ("sample", w(revolution * TURN), {"units": "rad s-2"}) for n, w in signals.items()}
    return xr.Dataset(
        {
            **waves,
            "contact_force": (("stator", "sample"), force, {"units": "N"}),
            "spin_speed": ((), 2 * math.pi / TURN),
        },
        coords={
            "revolution": ("sample", revolution),
            "stator": ("stator", np.arange(1, len(forces) + 1)),
        },
    )


def bump(start, end, peak):
    return lambda part: np.where(
        (part >= start) & (part < end), peak * np.sin(math.pi * (part - start) / (end - start)) + 1e-9, 0.0
    )


def test_spans_have_their_times_and_peaks():
    spans = contact_spans(case({}, [bump(0.25, 0.375, 30.0)]))
    assert spans["first"].values == pytest.approx(N * (0.25 + np.arange(4)))
    assert spans["start"].values == pytest.approx(TURN * (0.25 + np.arange(4)))
    assert spans["duration"].values == pytest.approx(np.full(4, TURN / 8))
    assert spans["revolution"].values == pytest.approx(0.25 + np.arange(4))
    assert spans["peak_force"].values == pytest.approx(np.full(4, 30.0))


def test_spans_cut_by_the_record_are_left_out_unless_wanted():
    cut = case({}, [bump(0.0, 0.25, 1.0)])
    assert contact_spans(cut).sizes["span"] == 3
    assert contact_spans(cut, whole=False).sizes["span"] == 4
    assert free_spans(cut).sizes["span"] == 3
    assert free_spans(cut, whole=False)["duration"].values == pytest.approx(np.full(4, 0.75 * TURN))


def test_spans_in_and_out_of_contact_fill_the_record():
    one = case({}, [bump(0.3, 0.4, 1.0)])
    both = [spans(one, whole=False)["duration"].sum() for spans in (contact_spans, free_spans)]
    assert float(sum(both)) == pytest.approx(4 * TURN)
    free = case({}, [lambda part: 0 * part])
    assert contact_spans(free).sizes["span"] == 0
    assert free_spans(free)["duration"].values == pytest.approx([4 * TURN])


def test_several_stators_count_together_or_alone():
    two = case({}, [bump(0.25, 0.375, 1.0), bump(0.5, 0.625, 2.0)])
    assert contact_spans(two).sizes["span"] == 8
    assert contact_spans(two, stator=2)["peak_force"].values == pytest.approx(np.full(4, 2.0))
    assert float(touching(two, stator=1).mean()) == pytest.approx(0.125)
    assert float(touching(two.isel(stator=0)).mean()) == pytest.approx(0.125)
    with pytest.raises(InputError, match="choose one from 1 to 2"):
        touching(two, stator=3)


def test_peaks_after_each_contact():
    one = case(
        {"torsion": lambda t: np.floor(t / TURN) * np.cos(2 * math.pi * t / TURN)}, [bump(0.25, 0.3, 1)]
    )
    # between the touches at 1/4 of turns k and k + 1 lies the crest at the beginning of turn k + 1
    assert peak_after_contact(one).values == pytest.approx([1.0, 2.0, 3.0], rel=1e-3)


def pushed(t):
    """A sine that a contact lifts by 3 and lets down evenly until it ends: a step, then a change of slope."""
    part = t / TURN % 1
    touch, release = 0.25 + 0.5 / N, 0.375 - 0.5 / N
    push = np.where((part > touch) & (part < release), 3 * (release - part) / (release - touch), 0.0)
    return 0.2 * np.sin(2 * math.pi * 50 * t) + push


def test_jumps_have_their_sizes():
    one = case({"torsion_acceleration": pushed}, [bump(0.25, 0.375, 1.0)])
    jumps = event_jumps(one)
    touch, release = (jumps.where(jumps["kind"] == kind, drop=True) for kind in ("touch", "release"))
    slope = 3 / (0.125 * TURN - DT)
    assert touch["step"].values == pytest.approx(np.full(4, 3.0), rel=0.02)
    assert release["step"].values == pytest.approx(np.zeros(4), abs=0.02)
    assert touch["slope_change"].values == pytest.approx(np.full(4, -slope), rel=0.02)
    assert release["slope_change"].values == pytest.approx(np.full(4, slope), rel=0.02)
    assert touch["time"].values % TURN == pytest.approx((0.25 + 0.5 / N) * TURN)
    assert release["time"].values % TURN == pytest.approx((0.375 - 0.5 / N) * TURN)
    assert (jumps["ratio"].values > 50).all()


def test_what_is_smooth_does_not_jump():
    smooth = case({"torsion_acceleration": lambda t: np.sin(2 * math.pi * 50 * t)}, [bump(0.25, 0.375, 1.0)])
    ratio = event_jumps(smooth)["ratio"].values
    assert ratio.size == 8
    assert (ratio < 2).all()


def test_events_are_found_in_the_signal_alone():
    one = case({"torsion_acceleration": pushed}, [bump(0.25, 0.375, 1.0)])
    blind = one.assign(contact_force=one["contact_force"] * math.nan)
    found = events_in_signal(blind)["time"].values
    assert found == pytest.approx(event_jumps(one)["time"].values, abs=4 * DT)
    decay = {"torsion_acceleration": lambda t: np.exp(-5 * t) * np.sin(2 * math.pi * 50 * t)}
    smooth = case(decay, [lambda part: 0 * part])
    assert events_in_signal(smooth).sizes["event"] == 0


def test_a_jump_in_noise_is_reported_by_its_ratio():
    rng = np.random.default_rng(1)
    noisy = case(
        {"torsion_acceleration": lambda t: pushed(t) + 0.1 * rng.normal(size=t.size)}, [bump(0.25, 0.375, 1)]
    )
    jumps = event_jumps(noisy)
    level = jumps["local_rms"].values
    assert level == pytest.approx(np.full(level.size, np.median(level)), rel=0.25)
    assert float(jumps["ratio"].where(jumps["kind"] == "touch").min()) > 5


@pytest.mark.parametrize("per_cycle", [7.5, 40, 300])
@pytest.mark.parametrize(("frequency", "ratio"), [(803, 0.05), (128, 0.02), (2540, 0.16), (50, 0.001)])
def test_a_decaying_sine_has_its_frequency_and_damping(frequency, ratio, per_cycle):
    dt = 1 / (per_cycle * frequency)
    rate = 2 * math.pi * frequency * ratio / math.sqrt(1 - ratio**2)
    t = np.arange(round(12 * per_cycle)) * dt
    found = decaying_sine(0.3 * np.exp(-rate * t) * np.cos(2 * math.pi * frequency * t + 1), dt)
    assert found["frequency"] == pytest.approx(frequency, rel=1e-8)
    assert found["damping_ratio"] == pytest.approx(ratio, rel=1e-6)
    assert found["decay_rate"] == pytest.approx(rate, rel=1e-6)
    assert found["amplitude"] == pytest.approx(0.3, rel=1e-6)
    assert found["residual"] < 1e-8


def test_the_strongest_of_two_decaying_sines_is_reported():
    t = np.arange(2000) * 2e-5
    weak = 0.3 * np.exp(-3000 * t) * np.cos(2 * math.pi * 4500 * t)
    found = decaying_sine(np.exp(-250 * t) * np.sin(2 * math.pi * 802 * t) + weak, 2e-5)
    assert found["frequency"] == pytest.approx(802, rel=1e-4)
    assert found["decay_rate"] == pytest.approx(250, rel=1e-3)


def test_noise_of_a_hundredth_costs_little():
    rng = np.random.default_rng(2)
    t = np.arange(2000) * 2e-5
    clean = np.exp(-250 * t) * np.sin(2 * math.pi * 802 * t)
    fits = [decaying_sine(clean + 0.01 * rng.normal(size=t.size), 2e-5) for _ in range(20)]
    assert [f["frequency"] for f in fits] == pytest.approx([802] * 20, rel=0.005)
    assert [f["damping_ratio"] for f in fits] == pytest.approx([0.0496] * 20, rel=0.1)


@pytest.mark.parametrize("values", [np.zeros(100), np.exp(-np.arange(100) / 20)])
def test_what_does_not_oscillate_has_no_frequency(values):
    assert decaying_sine(values, 1e-4) == {}


@pytest.mark.parametrize(("modulus", "clearance"), [("3 GPa", "100 um"), ("30 GPa", "84 um")])
def test_free_decays_of_the_packaged_rig_are_its_modes(modulus, clearance):
    """Stator and rotor swing freely between contacts: at the frequency and damping that the FEM gives."""
    keys = {"stator.youngs_modulus": modulus}
    model = assemble(with_keys(read_rig("mokhtar2017"), keys))
    case = simulate(
        "mokhtar2017",
        speed_ratio=0.75,
        clearance=clearance,
        overrides=keys,
        revolutions=6,
        samples_per_revolution=1024,
        keep="waveform",
    ).to_dataset()
    bodies = {
        "stator_lateral": (model.stators[0].body, "lateral"),
        "torsion": (model.rotor, "torsional"),
    }
    for signal, (body, kind) in bodies.items():
        mode = next(m for m in modes(body) if m.kind == kind)
        found = free_decay(case, signal)
        damped = mode.frequency * math.sqrt(1 - mode.damping_ratio**2)
        assert found["frequency"].values == pytest.approx(damped, rel=1e-3), signal
        assert found["damping_ratio"].values == pytest.approx(mode.damping_ratio, rel=5e-3), signal
    assert (found["residual"] < 0.01).all()
    ring = free_decay(case)
    assert (ring["remaining"] < 0.2).all()  # the paper, Fig. 14d
    jumps = event_jumps(case)
    assert set(jumps["kind"].values) == {"touch", "release"}
    assert (jumps["ratio"] > 5).all()  # Fig. 6g
    seen = events_in_signal(case)["time"].values
    assert seen == pytest.approx(jumps["time"].values, abs=4 * sample_time(case))  # each one, and no other


def test_signals_come_by_their_name_in_double_precision():
    one = case({"torsion": lambda t: t.astype(np.float32)}, [bump(0.25, 0.3, 1)])
    assert signal_of(one, "torsion").dtype == np.float64
    assert sample_time(one) == pytest.approx(DT)
    with pytest.raises(InputError, match="no such signal"):
        signal_of(one, "twist")
