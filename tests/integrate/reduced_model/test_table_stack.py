"""Tables of contact modes, in room that grows."""

import mmap
from typing import Any, NamedTuple

import numpy as np
import pytest

from rubhpc.integrate.reduced_model.table_stack import FIRST_ROOM, NEXT_ROOM, TableStack


class Tables(NamedTuple):
    small: Any
    large: Any


def tables(k: int) -> Tables:
    return Tables(np.full((1, 3), k), np.full((1, 200, 200), complex(k)))


@pytest.mark.parametrize("n", [FIRST_ROOM, NEXT_ROOM, NEXT_ROOM + 3])
def test_tables_stay_as_room_grows(n):
    stack = TableStack(2)
    for k in range(n):
        stack.add(tables(k))
    assert [len(field) for field in stack.view()] == [n, n]
    assert np.array_equal(stack.view().small[:, 0], range(n))
    assert np.array_equal(stack.view().large[:, -1, -1], range(n))
    assert stack.n_byte == n * (3 * 8 + 200 * 200 * 16)


def test_large_tables_have_pages_of_their_own():
    """Which go back to the system when nobody has them any more; the C library would keep them."""
    stack = TableStack(2)
    for k in range(NEXT_ROOM):
        stack.add(tables(k))
    base = stack.view().large
    while isinstance(base, np.ndarray):
        assert base.flags.writeable
        base = base.base
    assert isinstance(base, memoryview | mmap.mmap)
    assert isinstance(getattr(base, "obj", base), mmap.mmap)
