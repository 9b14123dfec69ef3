"""Entries of [grid] as prior distributions."""

import numpy as np
import pytest
from scipy.stats import kstest, norm

from rubhpc.errors import InputError
from rubhpc.identification.priors import at_shares, is_prior, read_prior
from rubhpc.rig.reading import read_rig

RIG = read_rig("mokhtar2017")


def drawn(prior, n=2000):
    return np.array([prior.at(share) for share in np.random.default_rng(1).random(n).tolist()])


def test_a_range_is_uniform_or_log_uniform():
    flat = read_prior("clearance", {"start": "40 um", "stop": "140 um"}, RIG, "")
    assert kstest(drawn(flat), "uniform", args=(40e-6, 100e-6)).pvalue > 0.01
    log = read_prior("friction", {"start": 0.01, "stop": 1.0, "scale": "log"}, RIG, "")
    assert kstest(np.log10(drawn(log)), "uniform", args=(-2, 2)).pvalue > 0.01
    assert flat.spread == pytest.approx(100e-6 / np.sqrt(12), rel=0.01)


def test_mean_and_std_are_normal_within_what_is_valid():
    prior = read_prior("rotor.unbalance.mass", {"mean": "8 g", "std": "1 g"}, RIG, "")
    assert kstest(drawn(prior), norm(8e-3, 1e-3).cdf).pvalue > 0.01
    wide = read_prior("rotor.unbalance.mass", {"mean": "1 g", "std": "1 g"}, RIG, "")
    assert drawn(wide).min() >= 0.0
    assert wide.at(0.5) == pytest.approx(1e-3 + 1e-3 * norm.ppf(0.5 * (norm.cdf(-1) + 1)))


def test_values_of_a_list_and_whole_numbers_are_equally_likely():
    listed = read_prior("stator.angle", ["0 deg", "90 deg"], RIG, "")
    assert [listed.at(share) for share in (0.0, 0.49, 0.51, 1.0)] == pytest.approx(
        [0, 0, np.pi / 2, np.pi / 2]
    )
    node = read_prior("stator.1.node", {"start": 5, "stop": 8}, RIG, "")
    assert sorted(set(drawn(node))) == [5, 6, 7, 8]
    assert at_shares((listed, node), np.array([0.6, 0.3])) == pytest.approx([np.pi / 2, 6])


def test_a_single_value_is_known():
    assert not is_prior(0.3)
    assert not is_prior([0.3])
    assert is_prior([0.1, 0.3])
    assert is_prior({"mean": 0.3, "std": 0.1})


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("friction", {"mean": 0.3}, "write { mean, std }"),
        ("friction", {"mean": 0.3, "std": 0.0}, "must be above 0"),
        ("friction", {"mean": 0.3, "std": 0.1, "stop": 1}, "write { mean, std }"),
        ("frictoin", {"mean": 0.3, "std": 0.1}, "frictoin"),
    ],
)
def test_what_is_no_distribution_is_refused_in_a_line(name, value, text):
    with pytest.raises(InputError, match=text) as caught:
        read_prior(name, value, RIG, "study.toml")
    assert "\n" not in str(caught.value)
