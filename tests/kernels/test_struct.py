"""Structs that kernels receive by reference."""

from __future__ import annotations

import pickle

import numba
import numpy as np
import pytest

from rubhpc.kernels._struct import Struct


class Inner(Struct):
    table: np.ndarray
    count: int
    size: float
    is_open: bool = True


class Outer(Struct):
    inner: Inner
    row: np.ndarray


@numba.njit
def read(held):
    inner = held.inner
    held.row[0] += 1.0
    return inner.table[1, 2] + 10.0 * inner.count + 100.0 * inner.size + (1000.0 if inner.is_open else 0.0)


@numba.njit
def total(table):
    return table.table.sum() + table.table[0, 1]


def test_a_kernel_reads_and_writes_what_python_holds():
    held = Outer(Inner(np.arange(6.0).reshape(2, 3), 2, 0.5), np.zeros(2))
    assert read(held) == 5.0 + 20.0 + 50.0 + 1000.0
    assert held.row.tolist() == [1.0, 0.0]
    assert read(held._replace(inner=held.inner._replace(is_open=False, count=3))) == 5.0 + 30.0 + 50.0
    assert held.row.tolist() == [2.0, 0.0]


def test_arrays_of_any_layout():
    whole = np.arange(24.0).reshape(4, 6)
    for part in (whole[::2, 1::2], whole.T, np.asfortranarray(whole), np.broadcast_to(3.0, (2, 3))):
        assert total(Inner(part, 0, 0.0)) == part.sum() + part[0, 1]


def test_an_interruption_while_python_is_asked_for_one_is_raised(monkeypatch):
    def interrupted(_held):
        raise KeyboardInterrupt

    held = Inner(np.zeros((2, 3)), 0, 0.0)
    assert total(held) == 0.0
    monkeypatch.setattr(Inner, "_address", property(interrupted))
    with pytest.raises(KeyboardInterrupt):
        total(held)


@numba.njit
def make(table, count):
    held = Outer(row=table[1], inner=Inner(table, count, is_open=False, size=0.25))
    return read(held), held.row[0]


def test_a_kernel_makes_one():
    table = np.arange(6.0).reshape(2, 3)
    assert make(table, 4) == (5.0 + 40.0 + 25.0, 4.0)
    assert table[1, 0] == 4.0


def test_it_is_a_tuple_of_named_values():
    held = Inner(np.zeros(1), count=1, size=2.0)
    table, *rest = held
    assert table is held.table
    assert rest == [1, 2.0, True]
    assert list(held._asdict()) == ["table", "count", "size", "is_open"]
    assert pickle.loads(pickle.dumps(held)).size == 2.0


@pytest.mark.parametrize("args", [(), (1, 2, 3, 4, 5)])
def test_what_is_missing_or_too_much(args):
    with pytest.raises(TypeError, match="Inner takes table, count, size, is_open"):
        Inner(*args)


def test_it_stays_as_it_is():
    """What Python would change, a kernel would not see."""
    with pytest.raises(AttributeError, match=r"Outer\.row cannot be changed; use _replace"):
        Outer(None, None).row = np.zeros(1)  # type: ignore[misc]


def test_what_is_no_number_is_refused():
    with pytest.raises(TypeError, match=r"Outer\.row is .*: no array, number or struct"):
        read(Outer(Inner(np.zeros((2, 3)), 0, 0.0), "text"))
