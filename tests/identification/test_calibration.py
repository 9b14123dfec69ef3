"""Calibration: truths in their posteriors, whose records another code than the program's has computed."""

import numpy as np
import pytest
from independent_contact import run
from scipy.stats import binom, kstest

from rubhpc.identification import calibration, interpolated
from rubhpc.identification.calibration import COVERED, Trial, calibrate_on, in_table
from rubhpc.identification.interpolated import Interpolated
from rubhpc.identification.problem import read_known, read_problem
from rubhpc.rig.reading import read_rig
from rubhpc.running.pool import Pool

STUDY = "jobs/identification/calibration.toml"
SIGNALS = ("vertical", "horizontal", "torsion")
STEP = 2e-6  # s, of the independent code
DRAWS = 10  # a truth of it takes ten seconds


def trials(count, noises, **given):
    values = {
        "study": STUDY,
        "signals": SIGNALS,
        "method": "modal",
        "transient": 1,
        "revolutions": 32,
        "live": 50,
        "seed": 1,
        "output": None,
        "trust_rig": False,
    }
    return [Trial(**values | given, noise=noise, draw=draw) for draw in range(count) for noise in noises]


def independent(simulated, transient):
    """A simulation of a truth whose signals are those of `independent_contact` after a transient."""

    def of(study, tables, settings, samples):
        record = simulated(study, tables, settings, samples)
        length = record.vertical.size // samples
        case = {
            "speed": float(record.settings["spin_speed"]),
            "clearance": settings["clearance"],
            "friction": settings["friction"],
            "revolutions": transient + length,
            "samples_per_revolution": samples,
            "normal": "fixed",
            "friction_law": "sliding",
        }
        found = run(read_rig("mokhtar2017").with_geometry("linear"), case, STEP)
        for name in SIGNALS:
            record.signals[name][:] = found[name][-record.vertical.size :]
        return record

    return of


@pytest.fixture
def few(monkeypatch):
    """Fewer points than usual."""
    monkeypatch.setitem(interpolated._POINTS, 2, 8)


@pytest.mark.usefixtures("few")
def test_interpolated_cases_are_the_cases():
    trial = trials(1, [0.01])[0]
    problem = read_problem(calibration._measured(trial, read_known(STUDY))[1], STUDY)
    found = Interpolated(problem.rub)
    assert found.serves(problem.comparison.measured)
    for shares in np.random.default_rng(2).random((3, 2)):
        values = [prior.at(share) for prior, share in zip(problem.rub.priors, shares, strict=True)]
        known = problem.rub.outcome(values).seen.values
        assert found(shares).values == pytest.approx(known, rel=0, abs=1e-5 * np.abs(known).max())


def test_a_case_that_fails_is_not_interpolated(monkeypatch):
    trial = trials(1, [0.01])[0]
    problem = read_problem(calibration._measured(trial, read_known(STUDY))[1], STUDY)
    monkeypatch.setattr(type(problem.machine), "simulate", lambda self, values: 1 / 0)
    assert not Interpolated(problem.rub).serves(problem.comparison.measured)


@pytest.mark.usefixtures("few")
def test_a_posterior_that_is_known_is_not_computed_again(tmp_path, monkeypatch):
    some = trials(1, [0.3], output=str(tmp_path), live=10)
    first = calibrate_on(Pool(), some, report=lambda text: None)
    monkeypatch.setattr(calibration, "sample", None)
    assert calibrate_on(Pool(), some, report=lambda text: None) == first
    assert next(iter(list(in_table(some, first))[2:])).startswith("| 0.3 | 1 | clearance |")


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_truths_of_an_independent_code_lie_in_their_posteriors(monkeypatch, tmp_path):
    monkeypatch.setattr(calibration, "simulated", independent(calibration.simulated, 400))
    calibration._truth.cache_clear()
    some = trials(DRAWS, [0.01, 0.3], output=str(tmp_path))
    found = calibrate_on(Pool(), some, report=lambda text: None)
    calibration._truth.cache_clear()
    print("\n".join(["", *in_table(some, found)]))
    shares = (np.array([one.ranks for one in found]).reshape(DRAWS, 2, 2) + 0.5) / 100
    for level in range(2):
        for key in range(2):
            ranks = shares[:, level, key]
            assert kstest(ranks, "uniform").pvalue > 1e-3
            for share in COVERED:
                inside = np.count_nonzero(np.abs(ranks - 0.5) <= 0.5 * share)
                low, high = binom.interval(0.999, DRAWS, share)
                assert low <= inside <= high, (level, key, share)
