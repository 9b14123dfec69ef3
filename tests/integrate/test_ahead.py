"""A second process that compiles what a proof of periodicity needs."""

import io
import os
from types import SimpleNamespace

import pytest

import rubhpc
from rubhpc.integrate import ahead
from rubhpc.integrate.setup import prepare
from rubhpc.kernels.mode_change import change_contacts
from rubhpc.kernels.shooting import search_period
from rubhpc.study.study import Contact, Integrator


@pytest.fixture
def started(monkeypatch, tmp_path):
    """Arguments of the processes that would be started, of an empty cache on two processors."""
    calls = []

    def start(arguments, **options):
        calls.append(arguments[4:])
        return SimpleNamespace(kill=lambda: None, communicate=lambda: None)

    monkeypatch.setattr(ahead, "_asked", set())
    monkeypatch.setattr(ahead.subprocess, "Popen", start)
    monkeypatch.setattr(ahead.atexit, "register", lambda *_: None)
    monkeypatch.setattr(ahead, "cache_of", lambda kernel: tmp_path / "cache" / "kernel.nbi")
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})
    return calls


def setup_of(**law):
    integrator = Integrator(method="central-difference") if law.pop("stepped", False) else Integrator()
    return prepare(
        rubhpc.read_rig("mokhtar2017"),
        150.0,
        contact=Contact(**law),
        integrator=integrator,
        samples_per_revolution=32,
    )


SOFT = {"law": "penalty", "stiffness": 1e8}


def test_it_is_started_once_for_each_law_in_closed_form(started):
    for _ in range(2):
        for law in ({}, {"friction_law": "coulomb"}, SOFT, SOFT | {"friction_law": "coulomb"}):
            ahead.compile_ahead(setup_of(**law))
    assert started == [["sliding"], ["coulomb"], ["sliding", "soft"], ["coulomb", "soft"]]


def test_one_process_a_cache(started, tmp_path):
    (tmp_path / "cache").mkdir()
    with (tmp_path / "cache" / "ahead.lock").open("w") as lock:
        ahead.fcntl.flock(lock, ahead.fcntl.LOCK_EX)
        ahead.compile_ahead(setup_of())
    assert started == []


def test_none_where_it_would_not_help(started, monkeypatch, tmp_path):
    ahead.compile_ahead(setup_of(normal="updated"))
    ahead.compile_ahead(setup_of(stepped=True))
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0})
    ahead.compile_ahead(setup_of())
    monkeypatch.undo()
    monkeypatch.setattr(ahead, "_asked", set())
    monkeypatch.setattr(ahead.subprocess, "Popen", lambda *_, **__: pytest.fail("kernels are cached"))
    rubhpc.periodic("mokhtar2017", speed_ratio=0.75, clearance_ratio=0.9, samples_per_revolution=32)
    ahead.compile_ahead(setup_of())
    assert started == []


@pytest.mark.parametrize("friction_law", ["sliding", "coulomb"])
def test_what_it_compiles(monkeypatch, friction_law):
    """All kernels are called that a proof calls; one takes the events of sliding pairs itself."""
    called = []
    monkeypatch.setattr(
        "rubhpc.integrate.periodic_motions.shooting.search_period",
        lambda *arguments: (called.append("search_period"), search_period(*arguments))[1],
    )
    march = ahead.closed_form_march(setup_of(friction_law=friction_law))
    take_change = march.take_change
    monkeypatch.setattr(
        march,
        "take_change",
        staticmethod(lambda *arguments: (called.append("change"), take_change(*arguments))[1]),
    )
    ahead._compile(friction_law, is_soft=False)
    is_sliding = friction_law == "sliding"
    assert {"search_period", *([] if is_sliding else ["change"])} == set(called)
    assert (take_change is change_contacts) == is_sliding


def test_it_ends_with_its_parent(monkeypatch):
    codes = []
    monkeypatch.setattr(os, "_exit", codes.append)
    monkeypatch.setattr("sys.stdin", SimpleNamespace(buffer=io.BytesIO(b"")))
    ahead._end_with_parent()
    assert codes == [1]
