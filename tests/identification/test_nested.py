"""Nested sampling on likelihoods whose evidence is known."""

import math

import numpy as np
import pytest

from rubhpc.errors import InputError
from rubhpc.identification.nested import MOST, Alone, sample

MEAN, STD = np.array([0.4, 0.6]), np.array([0.02, 0.05])


def gaussian(values):
    return float(-0.5 * (((values - MEAN) / STD) ** 2).sum())


class TwoAtATime(Alone):
    size = 2

    def map(self, function, items):
        listed = list(items)
        half = [[function(item) for item in listed[i::2]] for i in range(2)]
        return [half[i % 2][i // 2] for i in range(len(listed))]


def found(mapper, likelihood=gaussian, most=MOST):
    return sample(likelihood, lambda shares: shares, 2, mapper=mapper, live=100, seed=3, most=most)


def test_evidence_and_posterior_of_a_gaussian():
    one = found(Alone())
    truth = math.log(2 * math.pi * STD.prod())
    assert one.log_evidence == pytest.approx(truth, abs=3 * one.error)
    assert 0.05 < one.error < 0.5
    drawn = one.values[one.draws(4000, 1)]
    assert drawn.mean(axis=0) == pytest.approx(MEAN, abs=0.01)
    assert drawn.std(axis=0) == pytest.approx(STD, rel=0.25)
    assert np.exp(one.log_volumes).sum() == pytest.approx(1)
    volume = float(np.exp(one.log_volumes) @ one.values[:, 0])
    assert volume == pytest.approx(0.5, abs=0.1)  # the points weighted by their volumes are the prior


def test_a_likelihood_without_end_is_left():
    one = found(Alone(), lambda values: 1e3 * math.sin(1e6 * values.sum()), most=6)
    assert 600 < one.n_call < 2000
    assert not one.is_whole
    assert np.exp(one.log_weights).sum() == pytest.approx(1)


def test_processes_change_nothing():
    one, two = found(Alone()), found(TwoAtATime())
    assert (one.values == two.values).all()
    assert one.log_evidence == two.log_evidence


def test_impossible_cases_are_avoided_and_a_prior_of_none_is_refused():
    half = found(Alone(), lambda values: gaussian(values) if values[0] > 0.4 else -math.inf)
    assert half.values[half.draws(100, 1)][:, 0].min() > 0.4
    truth = math.log(0.5 * 2 * math.pi * STD.prod())
    assert half.log_evidence == pytest.approx(truth, abs=3 * half.error)
    with pytest.raises(InputError, match="narrow the priors"):
        found(Alone(), lambda values: -math.inf)


def test_nothing_open_is_one_case():
    one = sample(lambda values: -3.0, lambda shares: shares, 0, mapper=Alone(), live=10, seed=1)
    assert (one.log_evidence, one.error, one.n_call, one.draws(3, 1).tolist()) == (-3.0, 0.0, 1, [0, 0, 0])
