"""How kernels are compiled, so that all share their flags; they are cached by the content of their sources.

Kernels take arrays, numbers and structs (`kernels._struct`). What Python calls is compiled by `jit`; what
only kernels call is linked into them, `linked`.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any, TypeVar

import numba

from rubhpc.kernels._cache import folder_of
from rubhpc.kernels._linked import IS_PLAIN, KERNEL, LINKED

F = TypeVar("F", bound=Callable[..., object])

# A division by zero yields infinity, as in NumPy: a kernel never raises. "contract" allows fused
# multiply-add, "nsz" ignores the sign of zero; "nnan" and "ninf" would make isfinite(nan) true.
_FLAGS: dict[str, Any] = {"error_model": "numpy", "nogil": True, "fastmath": {"contract", "nsz"}}
# Sums over modes may be taken in any (fixed) order: otherwise no such loop is vectorised.
_SUM_FLAGS: dict[str, Any] = {**_FLAGS, "fastmath": {"contract", "nsz", "reassoc"}}

_PACKAGE, _FOLDER = re.escape(__package__), Path(__file__).parent
_IMPORTS = re.compile(rf"\b{_PACKAGE}((?:\.\w+)+)|\bfrom {_PACKAGE} import ([\w ,]+|\([^)]*\))")


@cache
def _imported_by(path: Path) -> frozenset[Path]:
    """Files of this package and those in it that a file of them imports."""
    words = " ".join(chain.from_iterable(_IMPORTS.findall(path.read_text())))
    named = (_FOLDER.joinpath(*word.strip(".").split(".")) for word in re.findall(r"[\w.]+", words))
    return frozenset(file for name in named if (file := name.with_suffix(".py")).exists())


@cache
def _sources_of(path: Path) -> str:
    """Digest of all that the kernels of a file are compiled from: the file and its imports, by this numba."""
    found: set[Path] = set()
    waiting = {path}
    while waiting:
        found |= waiting
        waiting = {file for known in waiting for file in _imported_by(known)} - found
    sources = b"".join(file.read_bytes() for file in sorted(found))
    return hashlib.sha256(f"{numba.__version__} {IS_PLAIN}".encode() + sources).hexdigest()


def _cached(function: F, flags: dict[str, Any]) -> F:
    """Compile a kernel on its first call, and cache it by the content of its sources.

    Numba compares the date of a function's own file alone, though what it calls from other files is
    compiled into it.
    """
    source = Path(function.__code__.co_filename)
    with folder_of(f"{source.stem}-{_sources_of(source)[:16]}"):
        compiled: F = numba.njit(cache=True, **flags, **KERNEL)(function)
    return compiled


def jit(function: F) -> F:
    """Compile a kernel on its first call, without the interpreter's lock, and cache it on the disk."""
    return _cached(function, _FLAGS)


def jit_sum(function: F) -> F:
    """Compile such a kernel whose sums may be taken in any (fixed) order."""
    return _cached(function, _SUM_FLAGS)


def linked(function: F) -> F:
    """Compile what only kernels call, into each of them."""
    compiled: F = numba.njit(**_FLAGS, **LINKED)(function)
    return compiled


def linked_sum(function: F) -> F:
    """Compile such a function whose sums may be taken in any (fixed) order."""
    compiled: F = numba.njit(**_SUM_FLAGS, **LINKED)(function)
    return compiled


def plain(kernel: F) -> F:
    """Return the Python function of a kernel, for rare calls that are not worth a compilation.

    Only for comparisons and look-ups: compiled code may give other last bits of products and sums.
    """
    function: F = getattr(kernel, "py_func", kernel)
    return function
