"""Compiled kernels: their cache on disk, and the flags that keep numbers honest."""

import math
import subprocess
import sys

import numba
import numpy as np
import pytest
from running import ROOT, environment

from rubhpc.kernels import _jit, _linked
from rubhpc.kernels.contact_modes import add_rows

CALLEE = """
from rubhpc.kernels._jit import jit, linked
@{flavour}
def value():
    return {value}
"""
CALLER = """
from rubhpc.integrate.compilation import announced_by
from rubhpc.kernels._jit import jit
from rubhpc.kernels.callee import value
names = []
@jit
def twice():
    return 2 * value()
with announced_by(names.append):
    print(twice(), sum(twice.stats.cache_hits.values()), len(names))
"""


@pytest.fixture
def probe(tmp_path):
    """A package with kernels of its own; call it to start a Python that calls one of them."""
    kernels = tmp_path / "rubhpc" / "kernels"
    (tmp_path / "rubhpc" / "integrate").mkdir(parents=True)
    kernels.mkdir()
    for folder in (kernels.parent, kernels, kernels.parent / "integrate"):
        (folder / "__init__.py").touch()
    for name in (
        "errors.py",
        "kernels/_jit.py",
        "kernels/_linked.py",
        "kernels/_cache.py",
        "integrate/compilation.py",
    ):
        (tmp_path / "rubhpc" / name).write_text((ROOT / "rubhpc" / name).read_text())
    (kernels / "caller.py").write_text(CALLER)

    def start(value, flavour="jit", **variables):
        """It prints its result, whether that came from the cache, and the number of announcements."""
        (kernels / "callee.py").write_text(CALLEE.format(value=value, flavour=flavour))
        return subprocess.Popen(
            [sys.executable, "-P", "-c", "import rubhpc.kernels.caller"],
            env=environment(
                PYTHONPATH=str(tmp_path),
                NUMBA_CACHE_DIR=str(tmp_path / "cache"),
                PYTHONDONTWRITEBYTECODE="1",  # Python distinguishes sources by their second and size
                **{"RUBHPC_PLAIN_NUMBA": "", **variables},
            ),
            stdout=subprocess.PIPE,
            text=True,
        )

    return start


def end(process):
    out, _ = process.communicate(timeout=100)
    assert process.returncode == 0
    return out.split()


@pytest.mark.parametrize("is_plain", ["", "1"])
def test_change_of_a_callee_in_another_file_outdates_the_cache(probe, is_plain):
    """Else a kernel would go on with the old form of what it calls."""
    variables = {"RUBHPC_PLAIN_NUMBA": is_plain}
    assert end(probe(3, **variables)) == ["6", "0", "1"]
    assert end(probe(3, **variables)) == ["6", "1", "0"]
    assert end(probe(4, **variables)) == ["8", "0", "1"]
    assert end(probe(5, "linked", **variables)) == ["10", "0", "1"]


def test_change_of_what_is_imported_by_another_outdates_the_cache(probe, tmp_path):
    """That of what is not imported leaves it."""
    kernels = tmp_path / "rubhpc" / "kernels"
    (kernels / "between.py").write_text("from rubhpc.kernels.callee import value")
    imports = "from rubhpc.kernels import between\nvalue = between.value"
    (kernels / "caller.py").write_text(CALLER.replace("from rubhpc.kernels.callee import value", imports))
    assert end(probe(3)) == ["6", "0", "1"]
    (kernels / "stranger.py").write_text("other = 1")
    assert end(probe(3)) == ["6", "1", "0"]
    assert end(probe(4)) == ["8", "0", "1"]


def test_numba_with_and_without_reaching_into_it_has_a_cache_of_its_own(probe):
    assert end(probe(3)) == ["6", "0", "1"]
    assert end(probe(3, RUBHPC_PLAIN_NUMBA="1")) == ["6", "0", "1"]
    assert end(probe(3)) == ["6", "1", "0"]


@pytest.mark.long
def test_versions_that_take_turns_keep_their_caches(probe, tmp_path):
    """As installations of two versions in one environment do; of many, the latest four are kept."""
    assert end(probe(3)) == ["6", "0", "1"]
    assert end(probe(4)) == ["8", "0", "1"]
    assert end(probe(3)) == ["6", "1", "0"]
    for value in (5, 6, 7):
        end(probe(value))
    assert len([*tmp_path.rglob("caller-*")]) == 4
    assert end(probe(7)) == ["14", "1", "0"]


def test_processes_that_need_a_kernel_at_once_compile_it_once(probe):
    """The others wait for the first and load what it has compiled."""
    shown = [end(process) for process in [probe(3) for _ in range(3)]]
    assert sorted(words[1] for words in shown) == ["0", "1", "1"]
    assert {words[0] for words in shown} == {"6"}


@pytest.mark.skipif(_linked.IS_PLAIN, reason="that is numba's own way of linking")
def test_what_is_linked_into_a_kernel_is_its_own():
    """Otherwise another kernel's copy of that name serves both, if it is loaded first."""

    @numba.njit(**_linked.KERNEL)  # in no cache, from which there would be nothing to read
    def add_rows_twice(rows, value, target):
        add_rows(rows, value, target)
        add_rows(rows, target, value)

    value, target = np.array([1.0, 2.0]), np.zeros(2)
    add_rows_twice(np.eye(2), value, target)
    assert target.tolist() == [1.0, 2.0]
    assert value.tolist() == [2.0, 4.0]
    (code,) = add_rows_twice.inspect_llvm().values()
    assert "define internal" in code
    assert "define linkonce_odr" not in code


@pytest.mark.skipif(_linked.IS_PLAIN, reason="Python may call it")
def test_what_only_kernels_call_is_refused_to_python():
    with pytest.raises(TypeError):
        add_rows(np.eye(2), np.ones(2), np.zeros(2))


@_jit.jit
def is_finite(x):
    return math.isfinite(x)


@_jit.jit_sum
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
