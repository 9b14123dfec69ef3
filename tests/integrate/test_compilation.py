"""What users read of compilations, and how much is compiled."""

import fcntl
import subprocess
import sys
import threading
import time

import numba
from running import environment

from rubhpc.integrate import compilation


def test_each_part_is_announced_once(monkeypatch):
    monkeypatch.setattr(compilation, "_announced", [])
    monkeypatch.setattr(compilation, "_expected", {compilation.PERIODIC, compilation.COLLOCATION})
    listener, texts = compilation.compilation, []
    before = listener.announce
    with compilation.announced_by(texts.append):
        for name in (*2 * ("enter_with", "advance", "carry_pieces"), "advance_by_collocation"):
            listener.announce_set_of(name)
    assert listener.announce is before
    once = "once after an installation:"
    assert texts == [
        f"compiling kernels, {once} about 10 s on a free core",
        f"compiling kernels for periodic motions, {once} set 1 of at most 2, about 10 s on a free core",
        f"compiling kernels for curved gaps and any law, {once} set 2 of at most 2, "
        "about 15 s on a free core",
    ]


def test_parts_are_names_of_kernels():
    from rubhpc.kernels.closed_form import revolutions, small_changes
    from rubhpc.kernels.collocation import march

    modules = revolutions, small_changes, march
    kernels = {name for module in modules for name in vars(module)}
    assert all(name in kernels for name in compilation._SETS)


def test_their_time_is_counted_and_others_of_numba_are_not_announced():
    texts, before = [], compilation.seconds_compiling()
    with compilation.announced_by(texts.append):
        assert numba.njit(lambda x: x + 1.0)(1.0) == 2.0
    assert not texts
    assert compilation.seconds_compiling() == before
    assert not compilation.is_compiling()


MAY_COMPILE = {
    "carry_pieces",
    "change_contacts",
    "change_pressed",
    "end_span",
    "follow_revolutions",
    "shaft_angle",
    "shaft_turn",
    "enter_with",
    "advance",
    "is_within",
    "normal_and_gap",
    "add_force",
}
FIRST_CASE = """
import sys
from rubhpc.integrate.case import compile_kernels
from rubhpc.integrate.setup import prepare
from rubhpc.rig.reading import read_rig
from rubhpc.study.study import Contact, Integrator, Recording

setup = prepare(
    read_rig("mokhtar2017").with_geometry("linear"),
    150.0,
    contact=Contact(normal="fixed", friction_law="sliding"),
    integrator=Integrator(),
    samples_per_revolution=32,
)
compile_kernels(setup, clearance=1e-4, friction=0.3, recording=Recording())
for path, module in list(sys.modules.items()):
    for name, kernel in vars(module).items() if path.startswith("rubhpc.kernels.") else ():
        stats = getattr(kernel, "stats", None)
        if stats and stats.cache_path and kernel.__module__ == path:
            for code in kernel.inspect_llvm().values():
                print(name, len(code.splitlines()))
"""


def test_a_first_case_compiles_no_more_than_it_did(tmp_path):
    """Its kernels, one signature each, and the lines of code that LLVM receives."""
    empty = environment() | {"NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", FIRST_CASE], env=empty, check=True, capture_output=True, text=True
    )
    compiled = [line.split() for line in done.stdout.splitlines()]
    names, counts = zip(*compiled, strict=True)
    assert set(names) <= MAY_COMPILE
    assert len(names) == len(set(names))
    assert 20_000 < sum(map(int, counts)) < 105_000


def test_waiting_for_another_process_counts(monkeypatch, tmp_path):
    monkeypatch.setattr(compilation, "cache_folder", lambda: tmp_path)
    before, seen = compilation.seconds_compiling(), []
    with (tmp_path / "lock").open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        waiting = threading.Thread(target=lambda: numba.njit(lambda x: x + 2.0)(1.0))
        waiting.start()
        while not compilation.is_compiling():
            time.sleep(0.01)
        seen.append(waiting.is_alive())
        time.sleep(0.1)
    waiting.join(60)
    assert seen == [True]
    assert not waiting.is_alive()
    assert compilation.seconds_compiling() >= before + 0.1
    assert not compilation.is_compiling()
