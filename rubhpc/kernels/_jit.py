"""The one place where kernels are compiled, so that all share their flags."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., object])

# "contract" allows fused multiply-add, "nsz" ignores the sign of zero; "nnan" and "ninf" would make
# isfinite(nan) true, and "reassoc" would let sums depend on how a loop was vectorised.
_FLAGS: dict[str, Any] = {
    "cache": True,
    "error_model": "numpy",
    "nogil": True,
    "fastmath": {"contract", "nsz"},
}
_compile = numba.njit(**_FLAGS)
_compile_inline = numba.njit(inline="always", **_FLAGS)
_SOURCES = hashlib.sha256(
    b"".join(path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))
).hexdigest()


def _stamped(compiled: Any) -> Any:
    """Make a change of any kernel outdate the cache of this one.

    Numba compares the file of a function alone, though what it calls from other files is compiled into it.
    The version is compared before the cache is read: an outdated one may name classes that no longer exist.
    """
    cache = getattr(getattr(compiled, "_cache", None), "_cache_file", None)
    if cache is not None:  # nothing is compiled under NUMBA_DISABLE_JIT
        cache._version = f"{cache._version} {_SOURCES}"
    return compiled


def jit(function: F) -> F:
    """Compile a kernel on first call, without the interpreter's lock, and cache it on disk."""
    compiled: F = _stamped(_compile(function))
    return compiled


def jit_inline(function: F) -> F:
    """Compile a kernel into its callers: a call that hands over a tuple of arrays costs 0.1 us and more."""
    compiled: F = _stamped(_compile_inline(function))
    return compiled


# Sums over modes may be reordered, without which no such loop is vectorised; never what isfinite relies on.
_SUM_FLAGS: dict[str, Any] = {**_FLAGS, "fastmath": {"contract", "nsz", "reassoc"}}
_compile_sum = numba.njit(**_SUM_FLAGS)
_compile_inline_sum = numba.njit(inline="always", **_SUM_FLAGS)


def jit_sum(function: F) -> F:
    """Compile a kernel whose sums may be taken in any (fixed) order."""
    compiled: F = _stamped(_compile_sum(function))
    return compiled


def jit_inline_sum(function: F) -> F:
    """Compile such a kernel into its callers."""
    compiled: F = _stamped(_compile_inline_sum(function))
    return compiled
