"""Kernels that are compiled for arrays which share no memory (`jit_apart_sum`) are given such arrays."""

from itertools import combinations

import numpy as np
import pytest
from closed_form import read_rig, run_up, simulate
from equal_stators import in_ring

from rubhpc.integrate.marches import event_driven


def arrays_of(value, name):
    """All arrays among the arguments of a kernel, with their names."""
    if isinstance(value, np.ndarray):
        return [(name, value)]
    if hasattr(value, "_fields"):
        return [
            found
            for field, part in zip(value._fields, value, strict=True)
            for found in arrays_of(part, f"{name}.{field}")
            if field != "whole"  # of samples: no kernel reads it
        ]
    return []


@pytest.fixture
def given(monkeypatch):
    """Arrays that the march gives to its kernels, call by call."""
    found = []
    kernel = event_driven.advance

    def note(*arguments):
        found.append([pair for i, one in enumerate(arguments) for pair in arrays_of(one, str(i))])
        return kernel(*arguments)

    monkeypatch.setattr(event_driven, "advance", note)
    return found


def shared(arrays):
    """Names of two arrays with common memory, unless both are of tables that are read alone."""
    return [
        (one, other)
        for (one, a), (other, b) in combinations(arrays, 2)
        if np.shares_memory(a, b) and not all(name.startswith(("0.", "1.")) for name in (one, other))
    ]


@pytest.mark.parametrize("n_stator", [1, 3])
def test_cases_and_their_proofs(given, n_stator):
    rig = in_ring(read_rig("mokhtar2017"), n_stator)
    case = {"speed_ratio": 1.3, "clearance_ratio": 0.8, "revolutions": 16, "samples_per_revolution": 32}
    for transient in (20, "direct"):
        simulate(rig, transient=transient, **case)
    assert len(given) > 3
    assert not [pair for arrays in given for pair in shared(arrays)]


def test_run_ups(given):
    run_up("mokhtar2017", start="900 rpm", stop="1000 rpm", time=1.0, clearance="84 um")
    assert given
    assert not [pair for arrays in given for pair in shared(arrays)]


def test_what_shares_memory_is_seen():
    whole = np.zeros(8)
    assert shared([("2", whole[:5]), ("3", whole[4:])]) == [("2", "3")]
    assert not shared([("2", whole[:4]), ("3", whole[4:])])
