"""Likelihoods of motions: against integrals done another way, and what counts as a motion that repeats."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp

from rubhpc.identification.channels import Channels
from rubhpc.identification.comparison import DISCREPANCIES, Unknown, log_likelihood, period_of_lines
from rubhpc.identification.lines import LineComparison
from rubhpc.identification.powers import PowerComparison

N, TURNS, NOISE = 32, 48, 0.3
ANGLE = 2 * np.pi * np.arange(N * TURNS) / N


def channels(waves, angle_error=np.inf):
    names = ("vertical", "horizontal")
    return Channels(
        names=names,
        simulated=names,
        units=("m", "m"),
        long_names=names,
        probes=(),
        waves=np.asarray(waves),
        n=N,
        spin=100.0,
        highest_order=0.4 * N,
        angle_error=angle_error,
    )


def motion(turned=0.0, half=0.4):
    angle = ANGLE + turned
    return np.stack(
        [
            np.cos(angle) + half * np.cos(angle / 2 + 0.2) + 0.2 * np.cos(3 * angle),
            np.sin(angle) - half * np.sin(angle / 2) + 0.3 * np.sin(2 * angle),
        ]
    )


def noisy(turned=0.0, seed=1):
    return motion(turned) + NOISE * np.random.default_rng(seed).standard_normal((2, ANGLE.size))


def brute_force(comparison, seen, angles, weights=1.0):
    """The same by the residuals themselves, at every angle."""
    size = DISCREPANCIES[:, None, None, None]
    least = 0.03 * noisy().std(axis=1)[:, None]
    error = size**2 * (np.abs(seen.values) ** 2 + least**2)
    variance = comparison.measured.variance + seen.variance + error
    model = seen.values * np.exp(1j * comparison.orders * angles[:, None, None])
    apart = np.abs(comparison.measured.values - model) ** 2 / variance + np.log(np.pi * variance)
    terms = -apart.sum(axis=(2, 3))
    return logsumexp(terms, b=weights) - np.log(terms.size)


def test_the_likelihood_is_the_integral_over_angles_and_discrepancies():
    lines = LineComparison(channels(noisy()), 2, [])
    angles = 4 * np.pi * np.arange(8000) / 8000
    seen = lines.of(motion(half=0.38))
    assert log_likelihood(lines, seen) == pytest.approx(brute_force(lines, seen, angles), abs=0.02)


@pytest.mark.parametrize("turned", [0.0, 0.03])
@pytest.mark.parametrize("error", [0.001, 0.02])
def test_an_angle_that_is_known_is_integrated_over_its_error(error, turned):
    lines = LineComparison(channels(noisy(turned), error), 2, [])
    apart = error * np.linspace(-6, 6, 2001)
    angles = np.concatenate([apart, apart + 2 * np.pi])
    weights = np.exp(-0.5 * (apart / error) ** 2) * 12 / np.sqrt(2 * np.pi)
    seen = lines.of(motion(half=0.38))
    known = brute_force(lines, seen, angles, np.tile(weights, 2))
    assert log_likelihood(lines, seen) == pytest.approx(known, abs=0.02)


def test_unknown_angles_do_not_matter_known_ones_by_whole_revolutions_alone():
    free, fixed = (LineComparison(channels(noisy(), error), 2, []) for error in (np.inf, 0.01))
    at = {turned: motion(turned) for turned in (0.0, 1.1, 2 * np.pi)}
    assert log_likelihood(free, free.of(at[1.1])) == pytest.approx(
        log_likelihood(free, free.of(at[0.0])), abs=1e-3
    )
    one, other, whole = (log_likelihood(fixed, fixed.of(waves)) for waves in at.values())
    assert whole == pytest.approx(one, abs=1e-6)
    assert other < one - 10.0


def test_a_model_that_does_not_move_has_any_angle():
    free, known = (LineComparison(channels(noisy(), error), 2, []) for error in (np.inf, 0.01))
    still = free.of(np.zeros_like(motion()))
    assert log_likelihood(free, still) == pytest.approx(log_likelihood(known, still))
    assert free.misfit(still) == pytest.approx(known.misfit(still))


def test_noise_is_that_between_the_lines():
    lines = LineComparison(channels(noisy()), 2, [])
    # Of white noise: 4 sigma^2 / n.
    assert lines.measured.variance == pytest.approx(4 * NOISE**2 / ANGLE.size, rel=0.6)
    assert lines.measured.variance.mean() == pytest.approx(4 * NOISE**2 / ANGLE.size, rel=0.1)
    assert lines.misfit(lines.of(motion())) == pytest.approx(1.0, abs=0.5)


def test_unknown_forces_are_integrated_over():
    """By Monte Carlo over forces, their phases and sizes."""
    waves = noisy()
    lines = LineComparison(channels(waves, 1e-6), 1, [])
    shapes = np.array([[1.0 + 0.5j], [0.3 - 1j]])
    unknown = Unknown(2.0, shapes, np.array([0.1, 0.4]))
    without = np.stack(
        [row - 2 * np.real(np.mean(row * np.exp(-2j * ANGLE)) * np.exp(2j * ANGLE)) for row in motion()]
    )
    seen = lines.of(without)
    rng = np.random.default_rng(2)
    sizes = rng.choice(unknown.sizes, 40000)
    forces = sizes * (rng.standard_normal(40000) + 1j * rng.standard_normal(40000)) / np.sqrt(2)
    at = int(np.flatnonzero(lines.orders == 2.0)[0])
    variance = lines.measured.variance[:, at]
    apart = lines.measured.values[:, at, None] - shapes * forces
    alone = -(np.abs(apart) ** 2 / variance[:, None] + np.log(np.pi * variance)[:, None]).sum(axis=0)
    zero = -(np.abs(lines.measured.values[:, at]) ** 2 / variance + np.log(np.pi * variance)).sum()
    gain = logsumexp(alone) - np.log(alone.size) - zero
    found = lines.by_discrepancy(seen, unknown)[0] - lines.by_discrepancy(seen)[0]
    assert found == pytest.approx(gain, abs=0.2)


def test_noise_alone_does_not_make_a_motion_chaotic_and_chaos_does():
    assert period_of_lines(channels(noisy())) == 6  # holds whole periods of 2
    still = np.stack([motion()[0], np.random.default_rng(3).standard_normal(ANGLE.size)])
    assert period_of_lines(channels(still)) == 6
    walk = np.cumsum(np.random.default_rng(4).standard_normal((2, ANGLE.size)), axis=1)
    assert period_of_lines(channels(motion() + 0.05 * walk)) == 0


def test_a_quasi_periodic_motion_repeats_in_no_number_of_revolutions():
    turns = np.arange(N * 160) / N
    whirl = np.exp(2j * np.pi * turns) + 0.3 * np.exp(2j * np.pi * turns * (15 / 26 + 0.003))
    long = replace(channels(motion()), waves=np.stack([whirl.real, whirl.imag]))
    assert period_of_lines(long) == 0
    whirl += 0.3 * np.exp(2j * np.pi * turns * 15 / 26) - 0.3 * np.exp(2j * np.pi * turns * (15 / 26 + 0.003))
    assert period_of_lines(replace(long, waves=np.stack([whirl.real, whirl.imag]))) == 26


def drifting(seed, size=0.3):
    """A motion whose phases walk at random."""
    drift = np.cumsum(size * np.random.default_rng(seed).standard_normal((2, ANGLE.size)), axis=1)
    return np.stack([np.cos(ANGLE + drift[0]), np.sin(ANGLE + drift[1])])


def test_powers_of_a_chaotic_motion_need_no_phase():
    powers = PowerComparison(channels(drifting(5)), [])
    same, other = (powers.of(drifting(6, size)) for size in (0.3, 0.09))
    assert "no phases" in powers.about
    assert log_likelihood(powers, same) > log_likelihood(powers, other) + 5
    assert powers.misfit(same) < 3


def test_the_likelihood_of_a_chaotic_motion_varies_by_chance_by_one():
    powers = PowerComparison(channels(drifting(5)), [])
    logs = [log_likelihood(powers, powers.of(drifting(seed))) for seed in range(100, 160)]
    assert 0.5 < np.std(logs) < 1.3


def test_two_probes_at_one_place_see_the_orbit():
    looks = {"left": -45, "skew": 70}
    probes = [
        {"name": name, "node": 3, "angle": np.radians(angle), "quantity": "displacement"}
        for name, angle in looks.items()
    ]
    v, w = motion()
    seen = np.stack([v * np.cos(p["angle"]) + w * np.sin(p["angle"]) for p in probes])
    names = ("probe_left", "probe_skew")
    one = replace(channels(seen), names=names, simulated=names, probes=tuple(probes))
    assert one.orbit @ one.waves == pytest.approx(np.stack([v, w]))
    apart = replace(one, probes=(probes[0], probes[1] | {"node": 4}))
    assert apart.orbit is None
    plain = channels(motion())
    assert PowerComparison(one, []).measured.values == pytest.approx(
        PowerComparison(plain, []).measured.values, abs=1e-3
    )
