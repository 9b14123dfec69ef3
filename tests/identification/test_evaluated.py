"""Cases on the disk: found again, whatever ended the run that wrote them."""

import numpy as np

from rubhpc.identification.candidates import Outcome
from rubhpc.identification.comparison import Seen
from rubhpc.identification.evaluated import Evaluated

LIKE = Seen(np.zeros((2, 3), complex), np.ones((2, 3)))


def opened(folder, content="a", rank=0):
    return Evaluated(folder, content, LIKE, 2, 1, rank)


def outcome(x):
    contact = (np.array([x]), np.array([2 * x]), np.array([3 * x]))
    return Outcome(0, Seen(np.full((2, 3), x + 1j), np.full((2, 3), x)), *contact)


def test_cases_are_found_again_by_all_ranks(tmp_path):
    for rank in (0, 1):
        opened(tmp_path, rank=rank).keep(np.array([rank, 0.5]), outcome(rank + 1.0))
    again = opened(tmp_path)
    assert len(again) == 2
    found = again.of(np.array([1.0, 0.5]))
    assert found.status == 0
    assert (found.seen.values == 2.0 + 1j).all()
    assert found.contact_fraction.tolist() == [2.0]
    assert found.seen.values.flags.aligned  # sums round as on arrays that were not stored
    assert opened(tmp_path, "another study").of(np.array([1.0, 0.5])) is None


def test_a_case_that_a_kill_has_cut_short_is_computed_again(tmp_path):
    first = opened(tmp_path)
    for x in (1.0, 2.0):
        first.keep(np.array([x, x]), outcome(x))
    (path,) = tmp_path.iterdir()
    whole = path.read_bytes()
    path.write_bytes(whole[:-7])
    again = opened(tmp_path)
    assert len(again) == 1
    again.keep(np.array([2.0, 2.0]), outcome(2.0))
    assert path.read_bytes() == whole


def test_failed_cases_are_kept_too(tmp_path):
    failed = Outcome(3, None, *(np.full(1, np.nan) for _ in range(3)))
    opened(tmp_path).keep(np.zeros(2), failed)
    found = opened(tmp_path).of(np.zeros(2))
    assert found.seen is None
    assert found.status == 3
