"""Compiled kernels: their cache on disk, and the flags that keep numbers honest."""

import math
import shutil
import subprocess
import sys

from running import ROOT, environment

from rubhpc.kernels import _jit

CALLEE = """
from probe._jit import {flavour}
@{flavour}
def value():
    return {value}
"""
CALLER = """
from probe._jit import jit
from probe.callee import value
@jit
def twice():
    return 2 * value()
print(twice(), sum(twice.stats.cache_hits.values()))
"""


def test_change_of_a_callee_in_another_file_outdates_the_cache(tmp_path):
    """Else a kernel would go on with the old form of what it calls."""
    package = tmp_path / "probe"
    package.mkdir()
    (package / "__init__.py").touch()
    shutil.copy(ROOT / "rubhpc" / "kernels" / "_jit.py", package)
    (package / "caller.py").write_text(CALLER)

    def twice(value, flavour):
        (package / "callee.py").write_text(CALLEE.format(value=value, flavour=flavour))
        run = [sys.executable, "-c", "import probe.caller"]
        shown = subprocess.run(
            run, cwd=tmp_path, env=environment(PYTHONPATH=""), check=True, capture_output=True, text=True
        )
        return [int(word) for word in shown.stdout.split()]

    assert twice(3, "jit") == [6, 0]
    assert twice(3, "jit") == [6, 1]  # from the cache
    assert twice(4, "jit") == [8, 0]
    assert twice(5, "jit_inline") == [10, 0]


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
