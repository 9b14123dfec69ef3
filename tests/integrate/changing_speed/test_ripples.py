"""What pieces of constant speed leave of the unbalance force, and what is left of changes that are spread."""

import math
import re

import numpy as np
import pytest
from closed_form import run_up
from set_ups import prepared
from test_steep_run_ups import PROBES, machine

from rubhpc.integrate.changing_speed import ripples
from rubhpc.integrate.changing_speed.case import record_run_up
from rubhpc.integrate.changing_speed.ripples import Linear, Ripples
from rubhpc.study.initial import CONTACT_FREE, Initial
from rubhpc.study.speed_law import LAG, SpeedLaw, cut
from rubhpc.study.study import Recording

NATURAL, DAMPING = 200.0, 0.02  # rad/s, of critical


def one_mass(_speed):
    seen = np.array([0.0, 0.0, 1.0]).reshape(3, 1, 1)
    return Linear(np.array([[NATURAL**2]]), np.array([[2 * DAMPING * NATURAL]]), np.ones(1, complex), seen)


@pytest.mark.parametrize("turns", [0.5, 1.0, 4.0])
def test_error_is_that_of_the_parabola(turns):
    """The periodic response to a force whose phase repeats a parabola, line by line."""
    speed, lag, accuracy = math.exp(round(math.log(0.5 * NATURAL) / 0.02) * 0.02), 1e-4, 1e-3
    n = 256 * round(max(turns, 1.0))
    angle = 2.0 * math.pi * max(turns, 1.0) * np.arange(n) / n
    within = (angle / (2.0 * math.pi * turns)) % 1.0
    force = np.exp(1j * (angle + lag * (6.0 * within * (1.0 - within) - 1.0)))
    order = np.fft.fftfreq(n, 1.0 / n) / max(turns, 1.0)
    s = (1j * order + 0.01) * speed  # as a passage meets a resonance
    lines = np.fft.fft(force) / n * s**2 / (NATURAL**2 + 2.0 * DAMPING * NATURAL * s + s**2)
    at = np.isclose(order, 1.0)
    error = np.linalg.norm(lines[~at]) / abs(lines[at][0])
    found = Ripples(one_mass, accuracy).allowed(speed, turns)
    # Three lines on both sides count, or those up to three times the speed.
    assert 0.75 * accuracy / found * lag == pytest.approx(error, rel=0.2)


def test_pieces_are_shorter_where_twice_the_speed_is_a_resonance():
    law = SpeedLaw(time=(0.0, 2.0), speed=(80.0, 120.0))
    allowed = Ripples(one_mass, 1e-3).allowed
    assert allowed(100.0, 1.0) < 0.5 * allowed(70.0, 1.0)
    assert allowed(100.0, 1.0) < 0.1 * LAG
    cuts = cut(law, 64, None, allowed)
    _, speed, _ = law.at_angle(2.0 * math.pi * cuts[:-1] / 64)
    near = np.abs(speed - 100.0) < 3.0
    assert np.diff(cuts)[near].mean() < np.diff(cuts)[speed > 115.0].mean()


def test_pieces_go_with_the_accuracy():
    """A fifth of the accuracy allows a fifth of the lag, down to a 64th of the greatest."""
    coarse, fine = (Ripples(one_mass, accuracy).allowed(120.0, 0.125) for accuracy in (1e-3, 2e-4))
    assert fine == pytest.approx(0.2 * coarse)
    assert Ripples(one_mass, 1e-9).allowed(120.0, 0.125) == pytest.approx(LAG / 64.0)


def test_pieces_that_are_too_long_are_named():
    """The error of the worst signal, where it is more than 0.5 %; what is allowed errs by 0.075 %."""
    judged, one, speed = Ripples(one_mass, 1e-3), np.ones(1), 120.0
    most = judged.allowed(speed, 0.125)
    assert judged.advice(speed * one, 0.125 * one, 6.0 * most * one, ["left"]) == ""
    lags = -most * np.array([1.0, 8.0])
    assert "left may err by 0.6 %" in judged.advice(np.full(2, speed), np.full(2, 0.125), lags, ["left"])


def test_a_run_up_in_too_few_pieces_says_so():
    """The bearing that errs most, and by how much, but for a factor of two: it is an estimate."""
    case = {"start": 300.0, "stop": 318.0, "time": 0.2, "clearance": 1.0, "friction": 0.0}
    case |= {"probes": PROBES, "samples_per_revolution": 64}
    coarse, fine = run_up(machine(), **case, pieces_per_revolution=1), run_up(machine(), **case)
    assert fine.note == ""
    found = re.search(r"probe at_1 may err by ([0-9.]+) %", coarse.note)
    off = np.linalg.norm(coarse.probe_at_1 - fine.probe_at_1) / np.linalg.norm(fine.probe_at_1)
    assert 0.5 < 0.01 * float(found[1]) / off < 2.0


def test_a_case_of_a_study_says_so(monkeypatch):
    """36 samples a revolution can be cut into four pieces at most."""
    law = SpeedLaw(time=(0.0, 0.1), speed=(300.0, 345.0))
    setup = prepared(machine(), 345.0, samples=36, probes=PROBES)
    recording = Recording(transient=0, revolutions=law.n_revolution, samples_per_revolution=36)
    case = {"clearance": 1.0, "friction": 0.0, "initial": Initial(from_=CONTACT_FREE)}
    monkeypatch.setattr(ripples, "PROMISED", 1e-3)
    assert "take more samples_per_revolution" in record_run_up(setup, law, recording=recording, **case).remark
