"""Compiled kernels: their cache on disk, and the flags that keep numbers honest."""

import copy
import fcntl
import math
import re
import subprocess
import sys
import threading
from itertools import product

import numba
import numpy as np
import pytest
from numba.core import inline_closurecall, ir
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, Flags
from running import ROOT, environment

from rubhpc.kernels import _jit
from rubhpc.kernels._compiler import KernelCompiler
from rubhpc.kernels.contact_modes import add_rows

CALLEE = """
from probe._jit import {flavour}
@{flavour}
def value():
    return {value}
"""
CALLER = """
from probe._jit import compilation, jit
from probe.callee import value
names = []
compilation.began = names.append
@jit
def twice():
    return 2 * value()
print(twice(), sum(twice.stats.cache_hits.values()), *names)
assert compilation.seconds > 0.0 or not names
"""


@pytest.fixture
def probe(tmp_path):
    """A package with kernels of its own; call it to start a Python that calls one of them."""
    package = tmp_path / "probe"
    package.mkdir()
    (package / "__init__.py").touch()
    for name in ("_jit.py", "_compiler.py"):
        source = (ROOT / "rubhpc" / "kernels" / name).read_text()
        (package / name).write_text(source.replace("rubhpc.kernels", "probe"))
    (package / "caller.py").write_text(CALLER)

    def start(value, flavour="jit"):
        """It prints its result, whether that came from the cache, and what was compiled."""
        (package / "callee.py").write_text(CALLEE.format(value=value, flavour=flavour))
        return subprocess.Popen(
            [sys.executable, "-c", "import probe.caller"],
            cwd=tmp_path,
            env=environment(
                PYTHONPATH=str(tmp_path),
                NUMBA_CACHE_DIR=str(tmp_path / "cache"),
                PYTHONDONTWRITEBYTECODE="1",  # Python distinguishes sources by their second and size
            ),
            stdout=subprocess.PIPE,
            text=True,
        )

    return start


def end(process):
    out, _ = process.communicate(timeout=100)
    assert process.returncode == 0
    return out.split()


def test_change_of_a_callee_in_another_file_outdates_the_cache(probe):
    """Else a kernel would go on with the old form of what it calls."""
    assert end(probe(3)) == ["6", "0", "twice"]
    assert end(probe(3)) == ["6", "1"]  # from the cache, though the file has another date
    assert end(probe(4)) == ["8", "0", "twice"]
    assert end(probe(5, "jit_inline")) == ["10", "0", "twice"]


def test_change_of_what_is_imported_by_another_outdates_the_cache(probe, tmp_path):
    """That of what is not imported leaves it."""
    (tmp_path / "probe" / "between.py").write_text("from probe.callee import value")
    imports = "from probe import between\nvalue = between.value"
    (tmp_path / "probe" / "caller.py").write_text(CALLER.replace("from probe.callee import value", imports))
    assert end(probe(3)) == ["6", "0", "twice"]
    (tmp_path / "probe" / "stranger.py").write_text("other = 1")
    assert end(probe(3)) == ["6", "1"]
    assert end(probe(4)) == ["8", "0", "twice"]


def test_what_only_kernels_call_lies_in_no_cache(probe, tmp_path):
    """It is compiled into its callers, which are cached."""
    end(probe(3))
    assert {path.name.split("-")[0] for path in tmp_path.rglob("*.nb?")} == {"caller.twice"}


@pytest.mark.long
def test_versions_that_take_turns_keep_their_caches(probe, tmp_path):
    """As installations of two versions in one environment do; of many, the latest four are kept."""
    assert end(probe(3)) == ["6", "0", "twice"]
    assert end(probe(4)) == ["8", "0", "twice"]
    assert end(probe(3)) == ["6", "1"]
    for value in (5, 6, 7):
        end(probe(value))
    assert len([*tmp_path.rglob("caller-*")]) == 4
    assert end(probe(7)) == ["14", "1"]


def test_processes_that_need_a_kernel_at_once_compile_it_once(probe):
    """The others wait for the first and load what it has compiled."""
    shown = [end(process) for process in [probe(3) for _ in range(3)]]
    assert sorted(words[1] for words in shown) == ["0", "1", "1"]
    assert {words[0] for words in shown} == {"6"}


@_jit.jit
def doubled(x):
    return 2.0 * x


@_jit.jit
def quadrupled(x):
    return doubled(doubled(x))


def test_what_only_kernels_call_gets_no_machine_code(monkeypatch):
    monkeypatch.setattr(quadrupled._cache, "load_overload", lambda *_: None)
    made = []
    make = JITCodeLibrary._finalize_specific
    monkeypatch.setattr(
        JITCodeLibrary, "_finalize_specific", lambda self: (made.append(self.name), make(self))
    )
    assert quadrupled(1.5) == 6.0
    assert "quadrupled" in made
    assert "doubled" not in made


@_jit.jit
def add_rows_twice(rows, value, target):
    add_rows(rows, value, target)
    add_rows(rows, target, value)


def test_what_is_linked_into_a_kernel_is_its_own(monkeypatch):
    """Otherwise another kernel's copy of that name serves both, if it is loaded first."""
    value, target = np.array([1.0, 2.0]), np.zeros(2)
    monkeypatch.setattr(add_rows_twice._cache, "load_overload", lambda *_: None)
    add_rows_twice(np.eye(2), value, target)
    assert target.tolist() == [1.0, 2.0]
    assert value.tolist() == [2.0, 4.0]
    (compiled,) = add_rows_twice.overloads.values()
    code = compiled.library
    linkages = [
        function.linkage.name for function in code._final_module.functions if not function.is_declaration
    ]
    assert "linkonce_odr" not in linkages
    assert "internal" in linkages


def test_a_caller_waits_for_what_another_process_compiles():
    with doubled.lock.open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        waiting = threading.Thread(target=_jit._wait_for, args=(doubled.lock,))
        waiting.start()
        waiting.join(0.05)
        assert waiting.is_alive()
    waiting.join(60)
    assert not waiting.is_alive()


def test_flags_of_kernels_are_equal_where_those_of_numba_are():
    def flags_of(kind):
        for nrt, fastmath in product((None, False, True), (None, {"contract"}, {"contract", "nsz"})):
            made = kind()
            if nrt is not None:
                made.nrt = nrt  # False is the default: set or not, it is the same
            if fastmath is not None:
                made.fastmath = fastmath
            yield made

    ours, theirs = list(flags_of(_jit.Flags)), list(flags_of(Flags))
    expected = [[a == b for b in theirs] for a in theirs]
    assert sum(map(sum, expected)) > len(theirs)
    for others in (ours, theirs):
        assert [[a == b for b in others] for a in ours] == expected
    assert {hash(flags) for flags in ours} == {hash(flags) for flags in theirs}
    assert ours[5].get_mangle_string() == theirs[5].get_mangle_string()
    assert type(quadrupled._compiler._customize_flags(Flags())) is _jit.Flags


@_jit.jit
def is_finite(x):
    return math.isfinite(x)


@_jit.jit_lean_sum
def is_finite_sum(x):
    return math.isfinite(x)


def test_what_is_not_finite_is_seen_as_such():
    """With fastmath whole, isfinite(nan) would be true."""
    for kernel in (is_finite, is_finite_sum):
        assert kernel(1.0)
        for value in (math.nan, math.inf, -math.inf):
            assert not kernel(value)


@_jit.jit
def quotient(x, y):
    return x / y


def test_division_by_zero_yields_infinity():
    """As in NumPy: a kernel never raises."""
    assert quotient(1.0, 0.0) == math.inf
    assert math.isnan(quotient(0.0, 0.0))


def add(a, b):
    for k in range(a.size):
        b[k] += a[k]


def add_few(a, b):
    for k in range(a.size):
        b[k] += a[k]


def call_add_few(a, b):
    inlined(a, b)


inlined = numba.njit(inline="always")(_jit.short_loops(add_few))


def test_what_is_inlined_is_not_copied(monkeypatch):
    """It was read for this call alone; numba's copies took a third of a long compilation."""
    copied, deepcopy = [], copy.deepcopy
    monkeypatch.setattr(copy, "deepcopy", lambda *given: copied.append(type(given[0])) or deepcopy(*given))
    blocks = []
    for compiler in (Compiler, KernelCompiler):
        a, b = np.arange(3.0), np.ones(3)
        numba.njit(pipeline_class=compiler)(call_add_few)(a, b)
        assert b.tolist() == [1.0, 2.0, 3.0]
        blocks.append(copied.count(ir.Block))
        copied.clear()
    assert blocks[0] > 0
    assert blocks[1] == 0
    assert inline_closurecall.copy is copy


def test_short_loops_take_one_vector_at_a_time():
    """Wherever they are compiled into; what is left behind whole vectors is less."""

    def vectors(function):
        kernel = numba.njit(pipeline_class=KernelCompiler)(function)
        a, b = np.arange(13.0), np.ones(13)
        kernel(a, b)
        assert b.tolist() == (a + 1.0).tolist()
        (code,) = kernel.inspect_llvm().values()
        return len(re.findall(r"load <\d+ x double>", code))

    assert vectors(add_few) == vectors(call_add_few) == 2  # one of each array
    assert vectors(add) > 2


def test_cases_run_without_compilation():
    case = "speed_ratio=1.2, clearance='100 um', friction=0.1, revolutions=1, transient=1"
    script = f"import rubhpc; print(rubhpc.simulate('mokhtar2017', {case}, samples_per_revolution=16).status)"
    environ = environment() | {"NUMBA_DISABLE_JIT": "1"}
    said = subprocess.run([sys.executable, "-c", script], env=environ, capture_output=True, text=True)
    assert said.stdout == "1\n", said.stderr
