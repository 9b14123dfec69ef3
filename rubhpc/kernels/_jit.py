"""The one place where kernels are compiled, so that all share their flags."""

from __future__ import annotations

import fcntl
import hashlib
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core.compiler_lock import global_compiler_lock

F = TypeVar("F", bound=Callable[..., object])

# "contract" allows fused multiply-add, "nsz" ignores the sign of zero; "nnan" and "ninf" would make
# isfinite(nan) true, and "reassoc" would let sums depend on how a loop was vectorised.
_FLAGS: dict[str, Any] = {
    "cache": True,
    "error_model": "numpy",
    "nogil": True,
    "fastmath": {"contract", "nsz"},
    "no_cfunc_wrapper": True,  # no C function calls a kernel
}
_compile = numba.njit(**_FLAGS)
_compile_inline = numba.njit(inline="always", **_FLAGS)
_SOURCES = hashlib.sha256(
    b"".join(path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))
).hexdigest()
_MOST_CACHES = 4  # of other sources that are kept


class Compilation:
    """What is known of compilations in this process.

    Attributes
    ----------
    seconds : float
        Spent on them so far, waiting for other processes included.
    began : callable
        Called with the name of a kernel that is in no cache, before it is compiled.
    """

    def __init__(self) -> None:
        self.seconds = 0.0
        self.began: Callable[[str], None] = lambda name: None
        self._depth = 0

    @contextmanager
    def of(self, name: str, folder: Path) -> Iterator[None]:
        """Around the compilation of a kernel, and of all that it calls; one process at a time."""
        with global_compiler_lock, ExitStack() as held:
            if self._depth == 0:
                self.began(name)
                began = time.perf_counter()
                held.enter_context(_alone_in(folder))
            self._depth += 1
            try:
                yield
            finally:
                self._depth -= 1
                if self._depth == 0:
                    self.seconds += time.perf_counter() - began


compilation = Compilation()


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Wait until no other process compiles into a folder: they would repeat, or spoil, each other's work."""
    with ExitStack() as held:
        with suppress(OSError):  # a folder that cannot be written, or a file system without locks
            folder.mkdir(parents=True, exist_ok=True)
            _drop_old(folder)
            lock = held.enter_context((folder / "lock").open("w"))
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _drop_old(folder: Path) -> None:
    """Remove all but the latest caches of other sources."""
    others = [path for path in folder.parent.glob("kernels-*") if path != folder and path.is_dir()]
    for path in sorted(others, key=lambda path: path.stat().st_mtime)[: -(_MOST_CACHES - 1)]:
        shutil.rmtree(path, ignore_errors=True)


def _stamped(compiled: Any) -> Any:
    """Cache a kernel by the content of all kernels' sources, and compile it in one process at a time.

    Numba compares the date of a function's own file, though what it calls from other files is compiled into
    it, and an installation renews all dates. Each state of the sources has a folder of its own, so that
    versions that take turns in one environment keep theirs.
    """
    cache = getattr(compiled, "_cache", None)
    file = getattr(cache, "_cache_file", None)
    if cache is None or file is None:  # nothing is compiled under NUMBA_DISABLE_JIT
        return compiled
    folder = Path(file._cache_path) / f"kernels-{_SOURCES[:16]}"
    cache._cache_path = file._cache_path = str(folder)
    file._index_path = str(folder / file._index_name)
    file._source_stamp = _SOURCES
    compile_or_load = compiled.compile

    def compile_once(signature: Any) -> Any:
        if tuple(signature) in compiled.overloads or _is_cached(compiled, signature):
            return compile_or_load(signature)
        with compilation.of(compiled.py_func.__name__, folder):
            return compile_or_load(signature)

    compiled.compile = compile_once
    return compiled


def _is_cached(compiled: Any, signature: Any) -> bool:
    """Whether a kernel lies in the cache on the disk."""
    compiled.targetctx.refresh()
    key = compiled._cache._index_key(signature, compiled.targetctx.codegen())
    return key in compiled._cache._cache_file._load_index()


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
