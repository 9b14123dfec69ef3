"""What users read of compilations, and how much is compiled."""

import subprocess
import sys

from running import environment

from rubhpc.integrate import compilation
from rubhpc.kernels import _jit


def test_each_part_is_announced_once(monkeypatch):
    monkeypatch.setattr(compilation, "_announced", [])
    monkeypatch.setattr(compilation, "_expected", {compilation.NEIGHBOURS, compilation.STICK})
    before, texts = _jit.compilation.began, []
    with compilation.announced_by(texts.append):
        for name in ("enter_with", "advance", "carry_along", "enter_with", "carry_along", "advance_by_steps"):
            _jit.compilation.began(name)
        _jit.compilation.began("advance_friction")
    assert _jit.compilation.began is before
    once = "once after an installation:"
    assert texts == [
        f"compiling kernels, {once} about 10 s on a free core",
        f"compiling kernels for neighbouring motions, which distinguish chaos from order, {once} "
        "set 1 of at most 2, about 10 s on a free core",
        f"compiling kernels for contact in short steps, {once} about 10 s on a free core",
        f"compiling kernels for friction with stick, {once} set 2 of at most 2, about 70 s on a free core",
    ]


def test_parts_are_names_of_kernels():
    from rubhpc.kernels import (
        curved_loop,
        friction_kernel,
        linear_theory,
        piece_loop,
        revolutions,
        shooting,
        stepping_loop,
        tangent,
    )

    modules = (
        revolutions, shooting, linear_theory, tangent, stepping_loop, curved_loop, friction_kernel, piece_loop
    )  # fmt: skip
    kernels = {name for module in modules for name in vars(module)}
    assert all(name in kernels for name in compilation._SETS)


def test_no_garbage_is_looked_for_while_kernels_are_compiled():
    import gc

    import numba
    from numba.core import event

    collects = []

    class Watching(event.Listener):
        def on_start(self, event):
            collects.append(gc.isenabled())

        def on_end(self, event):
            pass

    with event.install_listener("numba:compile", Watching()):
        assert numba.njit(lambda x: x + 1.0)(1.0) == 2.0
    assert collects
    assert not any(collects)
    assert gc.isenabled()


MAY_COMPILE = {
    "enter_with",
    "advance",
    "is_within",
    "normal_and_gap",
    "search_period",
    "add_force",
}
FIRST_CASE = """
import sys
from rubhpc.integrate.case import compile_kernels
from rubhpc.integrate.setup import prepare
from rubhpc.rig.reading import read_rig
from rubhpc.study.study import Contact, Integrator, Recording

setup = prepare(
    read_rig("mokhtar2017"), 150.0, contact=Contact(), integrator=Integrator(), samples_per_revolution=32
)
compile_kernels(setup, clearance=1e-4, friction=0.3, recording=Recording())
for path, module in list(sys.modules.items()):
    for name, kernel in vars(module).items() if path.startswith("rubhpc.kernels.") else ():
        if getattr(kernel, "__module__", "") == path:
            for compiled in getattr(kernel, "overloads", {}).values():
                code = compiled.library._get_module_for_linking()
                print(name, sum(len(list(block.instructions)) for f in code.functions for block in f.blocks))
"""


def test_a_first_case_compiles_no_more_than_it_did(tmp_path):
    """Its kernels, one signature each, and their instructions: 46 700, of which a second makes 2000.

    On an empty cache: where some parts come from a cache, after an edit, there are a tenth more.
    """
    empty = environment() | {"NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", FIRST_CASE], env=empty, check=True, capture_output=True, text=True
    )
    compiled = [line.split() for line in done.stdout.splitlines()]
    names, counts = zip(*compiled, strict=True)
    assert set(names) <= MAY_COMPILE
    assert len(names) == len(set(names))
    assert 20_000 < sum(map(int, counts)) < 47_500
