"""Room for frames: no depth at which a call takes far longer than at another."""

import time

import pytest

from rubhpc.frames import with_room


def leaf():
    return None


def duration(depth):
    """Of calls at a depth, s: the least of three times."""
    if depth:
        return duration(depth - 1)
    times = []
    for _ in range(3):
        began = time.perf_counter()
        for _ in range(300):
            leaf()
        times.append(time.perf_counter() - began)
    return min(times)


def test_calls_take_the_same_time_at_all_depths():
    """Without room the longest takes 190 times as long as the shortest (Python 3.11 to 3.13)."""
    times = with_room(lambda: [duration(depth) for depth in range(200)])
    assert max(times) < 20.0 * min(times)


def test_arguments_results_and_errors_pass():
    assert with_room(divmod, 7, 2) == (3, 1)
    assert with_room(sorted, [1, 3, 2], reverse=True) == [3, 2, 1]
    with pytest.raises(ValueError, match="'x'"):
        with_room(int, "x")
