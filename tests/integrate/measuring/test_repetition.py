"""Sums and samples of a record that repeats a period, against a record that is added up step by step."""

import numpy as np
import pytest
from trial_rig import trial_rig

from rubhpc.fem.assemble import assemble
from rubhpc.integrate.marched_record import Part, repeated_samples, repeated_sums
from rubhpc.integrate.measuring.samples import empty_samples, new_accumulator

Q = 2


def steps_of(random, n):
    """Random steps of a record: what each adds, and in which sense each pair slides; 0 is without contact."""
    return [
        (random.uniform(0.0, 1.0, (5, Q)), random.integers(-1, 2, Q), random.integers(0, 2, Q))
        for _ in range(n)
    ]


def taken(steps, sense=0):
    """Accumulator of steps, begun with a sense."""
    sums = new_accumulator(Q)
    sums.sense[:] = sense
    for (time, impulse, work, force, slip), senses, begun in steps:
        sums.contact_time[:] += time
        sums.stick_time[:] += 0.3 * time
        sums.impulse[:] += impulse
        sums.friction_work[:] += work
        sums.energy[:] += work.sum() * np.arange(6)
        sums.n_contact[:] += begun
        np.maximum(sums.peak_force, force, out=sums.peak_force)
        np.maximum(sums.peak_lateral, slip, out=sums.peak_lateral)
        np.minimum(sums.least_slip, slip, out=sums.least_slip)
        sums.highest[:] = np.maximum(sums.highest, force[0])
        sums.lowest[:] = np.minimum(sums.lowest, -slip[0])
        sums.residual[:] = np.maximum(sums.residual, slip[1])
        sums.pivots[:] = max(sums.pivots[0], begun.sum())
        sums.reversals[:] += (senses != 0) & (sums.sense == -senses)
        sums.sense[:] = np.where(senses != 0, senses, sums.sense)
    return sums


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize(("n_over", "n_whole"), [(0, 1), (0, 4), (2, 1), (1, 3), (6, 2)])
def test_sums_are_those_of_all_steps(seed, n_over, n_whole):
    steps = steps_of(np.random.default_rng(seed), 7)
    whole = taken(n_whole * steps + steps[:n_over])
    if n_over:
        first = taken(steps[:n_over])
        parts = [
            Part(None, first, n_whole + 1),
            Part(None, taken(steps[n_over:], first.sense), n_whole),
        ]
    else:
        parts = [Part(None, taken(steps), n_whole)]
    found = repeated_sums(parts)
    for name in set(whole._fields) - {"sense", "is_touching", "force_piece", "force_held", "origin"}:
        assert getattr(found, name) == pytest.approx(getattr(whole, name), rel=1e-13), name


@pytest.mark.parametrize("n_sample", [3, 7, 16])
def test_samples_follow_one_another(n_sample):
    model = assemble(trial_rig(2))
    parts = []
    for first, n in ((0, 3), (3, 4)):
        samples = empty_samples(model.n_place, n)
        samples.whole[:] = np.arange(first, first + n) + 10.0 * np.arange(len(samples.whole))[:, np.newaxis]
        parts.append(Part(samples, None, 1))
    found = repeated_samples(parts, n_sample, model)
    expected = np.arange(n_sample) % 7
    assert found.whole[3].tolist() == (30.0 + expected).tolist()
    assert found.axial[1].tolist() == (50.0 + expected).tolist()
