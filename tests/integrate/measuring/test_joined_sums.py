"""Sums of a record in parts, against a record that is added up step by step."""

import numpy as np
import pytest

from rubhpc.integrate.marched_record import joined_sums
from rubhpc.integrate.measuring.samples import new_accumulator

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
def test_sums_are_those_of_all_steps(seed):
    steps = steps_of(np.random.default_rng(seed), 7)
    parts, sense = [], 0
    for first, last in ((0, 2), (2, 3), (3, 7)):
        parts.append(taken(steps[first:last], sense))
        sense = parts[-1].sense
    whole, found = taken(steps), joined_sums(parts)
    for name in set(whole._fields) - {"sense", "is_touching", "force_piece", "force_held", "origin"}:
        assert getattr(found, name) == pytest.approx(getattr(whole, name), rel=1e-13), name
