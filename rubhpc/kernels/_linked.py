"""The one place that reaches into numba: what only kernels call gets no machine code of its own.

Numba optimises a function when it is compiled and again in each caller into which it is linked, and
generates machine code and a Python wrapper for it each time. Here it is optimised with the kernel that calls
it, and nothing else: a first case with friction that sticks takes 1.95 times as long without, one that slides
1.6 times (processor time, numba 0.68). `RUBHPC_PLAIN_NUMBA=1` switches this off, and so does a version of
numba with which it has not been tried; results are the same to rounding.
"""

from __future__ import annotations

import ctypes
import os
from typing import Any

import numba
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

TRIED = ("0.68.",)
IS_PLAIN = os.environ.get("RUBHPC_PLAIN_NUMBA", "0") not in ("", "0") or not numba.__version__.startswith(
    TRIED
)


class _KernelCode(JITCodeLibrary):
    """Code of a kernel that Python calls."""

    def _finalize_final_module(self) -> None:
        """Keep to this kernel what is linked into it.

        Two kernels may have linked a function that was optimised in two ways, under one name. That of the
        kernel loaded first would serve both: last digits of a case would depend on the cases before it.
        """
        linked, module = self._final_module.clone(), self._final_module
        for function in module.functions:
            if function.linkage.name == "linkonce_odr":
                function.linkage = "internal"
        super()._finalize_final_module()
        self._final_module = linked
        self._get_module_for_linking()
        self._final_module = module


class _LinkedCode(JITCodeLibrary):
    """Code that is linked into kernels, and optimised and translated with them."""

    @property
    def codegen(self) -> Any:
        return self

    def set_env(self, name: str, env: Any) -> None:
        """Do nothing: the environment in memory is that of the kernel."""

    def get_pointer_to_function(self, name: str) -> int | None:
        """Address of what Python calls: of a function that raises TypeError."""
        self._ensure_finalized()
        return ctypes.cast(ctypes.pythonapi.PyErr_BadArgument, ctypes.c_void_p).value

    def _optimize_final_module(self) -> None:
        """Do nothing."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


class _KernelCompiler(Compiler):
    _code: type[JITCodeLibrary] = _KernelCode

    def compile_extra(self, func: Any) -> Any:
        self.state.library = self._code(self.state.targetctx.codegen(), func.__qualname__)
        self.state.library.enable_object_caching()
        return super().compile_extra(func)


class _LinkedCompiler(_KernelCompiler):
    _code = _LinkedCode


KERNEL: dict[str, Any] = {} if IS_PLAIN else {"pipeline_class": _KernelCompiler}
LINKED: dict[str, Any] = (
    {}
    if IS_PLAIN
    else {"pipeline_class": _LinkedCompiler, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
)
