"""From the times of a few cases to that of all."""

import numpy as np
import pytest

from rubhpc.running.pilot_estimate import Sample, within
from rubhpc.storage.duration import span


def drawn(steps, seconds, chosen, probability):
    sample = Sample(len(steps), float(steps.sum()))
    for i in chosen:
        sample.add(steps[i], probability[i], seconds[i], is_whole=True)
    return sample


def total(sample):
    base, slope, error = sample.estimate()
    return base * sample.n_case + slope * sample.all_steps, error


def test_all_cases_timed_leave_no_error():
    steps, seconds = np.array([1.0, 2.0, 5.0]), np.array([3.0, 1.0, 0.5])
    found, error = total(drawn(steps, seconds, range(3), np.full(3, 1 / 3)))
    assert (found, error) == (pytest.approx(4.5), 0.0)


@pytest.mark.parametrize(("base", "slope"), [(2.0, 0.0), (0.0, 3.0), (2.0, 3.0)])
def test_times_on_a_line_are_predicted_from_three(base, slope):
    """The same time a case, the same a step, and both."""
    steps = np.linspace(1.0, 4.0, 40)
    seconds = base + slope * steps
    probability = 0.5 * steps / steps.sum() + 0.5 / 40
    found, error = total(drawn(steps, seconds, (3, 20, 31), probability))
    assert found == pytest.approx(seconds.sum())
    assert error == pytest.approx(0.0, abs=1e-9 * found)


def test_range_holds_the_time_of_most_plans():
    """Cases whose times are spread as those of a ring: some take ten times as long as the middle one."""
    rng = np.random.default_rng(1)
    steps = rng.uniform(1.0, 3.0, 200)
    seconds = np.exp(rng.normal(0.0, 1.0, 200))
    probability = 0.5 * steps / steps.sum() + 0.5 / 200
    held, middle = 0, []
    for _ in range(300):
        chosen = rng.choice(200, 12, replace=False, p=probability)
        sample = drawn(steps, seconds, chosen, probability)
        found, error = total(sample)
        least, most = within(found, error, len(chosen))
        held += least < seconds.sum() < most
        middle.append(found / seconds.sum())
    assert 0.85 < held / 300 < 0.95
    assert np.mean(middle) == pytest.approx(1.0, abs=0.05)


def test_times_predicted_from_parts_are_corrected_by_whole_cases():
    sample = Sample(4, 4.0)
    sample.add(1.0, 0.25, 2.0, is_whole=True)
    sample.add(1.0, 0.25, 1.0, is_whole=False)
    sample.checked.append((1.0, 2.0))
    assert sample.correction == pytest.approx(1.5)  # drawn towards 1: one case says little
    found, error = total(sample)
    assert found == pytest.approx(4 * 1.75)
    assert error > 0.2


@pytest.mark.parametrize(
    ("least", "most", "text"),
    [(30.0, 52.0, "30 to 52 s"), (720.0, 1800.0, "12 to 30 min"), (45.0, 200.0, "0.8 to 3.3 min")],
)
def test_span_of_time_has_one_unit(least, most, text):
    assert span(least, most) == text


def test_a_motion_that_still_meets_contact_modes_widens_the_range():
    """Until it is run whole."""

    def error(**second):
        sample = Sample(4, 4.0)
        sample.add(1.0, 0.25, 1.0, is_whole=True)
        sample.add(1.0, 0.25, 1.0, **second)
        return sample.estimate()[2]

    regular, irregular = (error(is_whole=False, is_irregular=given) for given in (False, True))
    assert irregular == pytest.approx(0.4 / 0.25 * regular)
    assert error(is_whole=True, is_irregular=True) == 0.0


def test_range_of_three_cases_begins_where_time_was_taken():
    """Cases of 14, 2 and 40 s out of six do not make a range from zero to an hour."""
    low, high = within(100.0, 70.0, 3, known=56.0)
    assert low == 56.0
    assert high == pytest.approx(100.0 * np.exp(1.3 * 0.7 * 3.182), rel=1e-3)  # further up than down
    assert within(100.0, 10.0, 3, known=56.0)[0] == pytest.approx(100.0 * np.exp(-0.1 * 3.182), rel=1e-3)
