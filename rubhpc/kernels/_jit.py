"""The one place where kernels are compiled, so that all share their flags."""

from __future__ import annotations

import fcntl
import hashlib
import os
import re
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core.compiler_lock import global_compiler_lock

from rubhpc.frames import with_room
from rubhpc.kernels._compiler import (
    ApartCompiler,
    Flags,
    KernelCompiler,
    LinkedCompiler,
    PartCompiler,
    note_short_loops,
)

F = TypeVar("F", bound=Callable[..., object])

# "contract" allows fused multiply-add, "nsz" ignores the sign of zero; "nnan" and "ninf" would make
# isfinite(nan) true, and "reassoc" would make sums depend on how a loop was vectorised.
_FLAGS: dict[str, Any] = {
    "cache": True,
    "error_model": "numpy",
    "nogil": True,
    "fastmath": {"contract", "nsz"},
    "no_cfunc_wrapper": True,  # no C function calls a kernel
}
# Sums over modes may be reordered: otherwise no such loop is vectorised. Flags that break isfinite stay off.
_SUM_FLAGS: dict[str, Any] = {**_FLAGS, "fastmath": {"contract", "nsz", "reassoc"}}
# No reference counting: Python holds all arrays. Different products are fused with sums, so switching a
# kernel to these flags may change the last bits of its results.
_LEAN_FLAGS: dict[str, Any] = {**_FLAGS, "_nrt": False}
_LEAN_SUM_FLAGS: dict[str, Any] = {**_SUM_FLAGS, "_nrt": False}
_PACKAGE = re.escape(__package__)
_IMPORTS = re.compile(rf"\b{_PACKAGE}\.(\w+)|\bfrom {_PACKAGE} import ([\w ,]+|\([^)]*\))")
_MOST_CACHES = 4  # kept of a module, each of another state of the sources


@cache
def _imported_by(path: Path) -> frozenset[Path]:
    """Files of this package that a file of it imports."""
    words = " ".join(chain.from_iterable(_IMPORTS.findall(path.read_text())))
    return frozenset(
        file for word in re.findall(r"\w+", words) if (file := path.with_name(f"{word}.py")).exists()
    )


@cache
def _sources_of(path: Path) -> str:
    """Digest of all that the kernels of a file are compiled from: the file and its imports, by this numba."""
    found: set[Path] = set()
    waiting = {path}
    while waiting:
        found |= waiting
        waiting = {file for known in waiting for file in _imported_by(known)} - found
    sources = b"".join(file.read_bytes() for file in sorted(found))
    return hashlib.sha256(numba.__version__.encode() + sources).hexdigest()


class Compilation:
    """Time and progress of compilations in this process.

    Attributes
    ----------
    seconds : float
        Spent on compilation so far, including waiting for other processes.
    began : callable
        Called with the name of a kernel that is in no cache, before it is compiled.
    """

    def __init__(self) -> None:
        self.seconds = 0.0
        self.began: Callable[[str], None] = lambda name: None
        self._depth = 0

    @contextmanager
    def of(self, name: str, lock: Path) -> Iterator[None]:
        """Context of the compilation of a kernel and of all that it calls; one process at a time."""
        with global_compiler_lock, ExitStack() as held:
            if self._depth == 0:
                self.began(name)
                began = time.perf_counter()
                _drop_old(lock.parent)
            held.enter_context(_alone_with(lock))
            self._depth += 1
            try:
                yield
            finally:
                self._depth -= 1
                if self._depth == 0:
                    self.seconds += time.perf_counter() - began


compilation = Compilation()


@contextmanager
def _alone_with(lock: Path) -> Iterator[None]:
    """Wait until no other process compiles a kernel: this process would repeat the work.

    A process waits for a kernel while it compiles what calls it, never the other way round.
    """
    with ExitStack() as held:
        with suppress(OSError):  # a folder that cannot be written, or a file system without locks
            lock.parent.mkdir(parents=True, exist_ok=True)
            fcntl.flock(held.enter_context(lock.open("w")), fcntl.LOCK_EX)
        yield


def _wait_for(lock: Path) -> None:
    """Wait while another process compiles a kernel."""
    if lock.exists():
        with _alone_with(lock):
            pass


def _drop_old(folder: Path) -> None:
    """Remove all but the latest caches of other states of the sources."""
    name, _, _ = folder.name.rpartition("-")
    others = [path for path in folder.parent.glob(f"{name}-*") if path != folder and path.is_dir()]
    for path in sorted(others, key=lambda path: path.stat().st_mtime)[: -(_MOST_CACHES - 1)]:
        shutil.rmtree(path, ignore_errors=True)


def _stamped(compiled: Any) -> Any:
    """Cache a kernel by the content of its sources and compile it in one process at a time.

    Numba compares the date of a function's own file, though what it calls from other files is compiled into
    it, and an installation renews all dates. Each state of the sources has its own folder, so that versions
    that alternate in one environment keep their caches.
    """
    cache = getattr(compiled, "_cache", None)
    file = getattr(cache, "_cache_file", None)
    if cache is None or file is None:  # nothing is compiled under NUMBA_DISABLE_JIT
        return compiled
    source = Path(compiled.py_func.__code__.co_filename)
    sources = _sources_of(source)
    folder = Path(file._cache_path) / f"{source.stem}-{sources[:16]}"
    compiled.lock = folder / f"{file._index_name}.lock"
    cache._cache_path = file._cache_path = str(folder)
    file._index_path = str(folder / file._index_name)
    file._source_stamp = sources
    compile_or_load = compiled.compile

    def compile_once(signature: Any) -> Any:
        if tuple(signature) in compiled.overloads or _is_cached(compiled, signature):
            return compile_or_load(signature)
        with compilation.of(compiled.py_func.__name__, compiled.lock):
            return with_room(compile_or_load, signature)

    compiled.compile = compile_once
    return compiled


def _quick(compiled: Any) -> Any:
    """Give a kernel flags with a fast comparison."""
    if hasattr(compiled, "_compiler"):  # not under NUMBA_DISABLE_JIT
        compiled._compiler._customize_flags = Flags
    return compiled


def cache_of(kernel: Callable[..., object]) -> Path:
    """Path of the index file of a kernel's cache; the file may not exist."""
    cache: Any = getattr(kernel, "_cache", None)
    return Path(cache._cache_file._index_path) if cache is not None else Path(os.devnull)


def _is_cached(compiled: Any, signature: Any) -> bool:
    """Whether a kernel is in the cache on the disk."""
    compiled.targetctx.refresh()
    key = compiled._cache._index_key(signature, compiled.targetctx.codegen())
    return key in compiled._cache._cache_file._load_index()


def _of_kernels(compiled: Any, flags: dict[str, Any], compiler: type[LinkedCompiler]) -> Any:
    """Compile a kernel that other kernels call without the wrapper that unpacks Python arguments.

    A wrapper for tables of arrays takes as long to compile as the kernel. Called kernels are compiled into
    their callers, so they need no cache either. A kernel that Python has called before is used unchanged.
    """
    if not hasattr(compiled, "overloads"):  # under NUMBA_DISABLE_JIT
        return compiled
    linked = numba.njit(**{**flags, "cache": False, "no_cpython_wrapper": True}, pipeline_class=compiler)
    inner = _quick(linked(compiled.py_func))
    template_of = compiled.get_call_template

    def get_call_template(args: Any, kws: Any) -> Any:
        _, folded = compiled.fold_argument_types(args, kws)
        _wait_for(compiled.lock)
        is_wrapped = tuple(folded) in compiled.overloads or _is_cached(compiled, folded)
        return template_of(args, kws) if is_wrapped else inner.get_call_template(args, kws)

    def get_overload(signature: Any) -> Any:
        found = compiled.overloads.get(tuple(signature)) or inner.overloads[tuple(signature)]
        return found.entry_point

    compiled.get_call_template, compiled.get_overload = get_call_template, get_overload
    return compiled


def _compiled(function: F, flags: dict[str, Any], compiler: type[LinkedCompiler] = LinkedCompiler) -> F:
    called = _stamped(_quick(numba.njit(**flags, pipeline_class=KernelCompiler)(function)))
    found: F = _of_kernels(called, flags, compiler)
    return found


def _inlined(function: F, flags: dict[str, Any]) -> F:
    found: F = _stamped(_quick(numba.njit(inline="always", **flags)(function)))
    return found


def plain(kernel: F) -> F:
    """Return the Python function of a kernel, for rare calls that are not worth a compilation.

    Only for comparisons and look-ups: compiled code may give other last bits of products and sums.
    """
    function: F = getattr(kernel, "py_func", kernel)
    return function


def short_loops(function: F) -> F:
    """Mark a function, in the line below its compilation, whose loops take a few vectors of eight each.

    They are then not interleaved, which changes the order of their sums.
    """
    note_short_loops(function)
    return function


def jit(function: F) -> F:
    """Compile a kernel on first call, without the interpreter's lock, and cache it on disk."""
    return _compiled(function, _FLAGS)


def jit_inline(function: F) -> F:
    """Compile a kernel into its callers, once for each call.

    For small kernels, and for those called once with a tuple of arrays: passing it costs 0.1 us and more.
    """
    return _inlined(function, _FLAGS)


def jit_inline_sum(function: F) -> F:
    """Compile a kernel whose sums may be taken in any (fixed) order into its callers."""
    return _inlined(function, _SUM_FLAGS)


def jit_lean(function: F) -> F:
    """Compile a kernel that allocates no array, in three quarters of the time."""
    return _compiled(function, _LEAN_FLAGS)


def jit_lean_sum(function: F) -> F:
    """Compile such a kernel whose sums may be taken in any (fixed) order."""
    return _compiled(function, _LEAN_SUM_FLAGS)


def jit_part_sum(function: F) -> F:
    """Compile such a kernel that only kernels call: LLVM optimises it with its callers, not separately."""
    return _compiled(function, _LEAN_SUM_FLAGS, PartCompiler)


def jit_apart_sum(function: F) -> F:
    """Compile such a kernel whose arrays never overlap."""
    return _compiled(function, _LEAN_SUM_FLAGS, ApartCompiler)
