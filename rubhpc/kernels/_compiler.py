"""Numba compilers for kernels: steps that kernels do not need are left out, which saves a fifth of the time.

Kernels take tuples of up to 30 arrays. Numba copies a whole tuple where one field of it is read, and clears a
tuple that is deleted. Without these copies LLVM receives a tenth of the code.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from numba.core import inline_closurecall, ir, types
from numba.core.cgutils import gep_inbounds
from numba.core.cgutils import ir as llvm  # type: ignore[attr-defined]  # a package of its own
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler import Flags as NumbaFlags
from numba.core.compiler_machinery import register_pass
from numba.core.lowering import Lower
from numba.core.typed_passes import BaseNativeLowering, NativeLowering
from numba.core.untyped_passes import InlineInlinables


class Flags(NumbaFlags):
    """Numba's flags with a cached hash; two are compared by the options that are set.

    Numba looks up each call that it types by the flags, and reads all of some 35 options for each hash and
    comparison: a tenth of the time of a compilation. The class has numba's name, because names of compiled
    functions contain it.
    """

    __slots__ = ()

    def __hash__(self) -> int:
        return _HASH

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, NumbaFlags):
            return NotImplemented
        ours, theirs = self._values, other._values
        return bool(
            ours == theirs
            or all(getattr(self, name) == getattr(other, name) for name in ours.keys() | theirs.keys())
        )


_HASH = hash(NumbaFlags())  # of the option names, as in numba
_NAMED = (types.NamedTuple, types.NamedUniTuple)
_SHORT: dict[str, list[tuple[int, int]]] = {}  # first and last lines of functions, by their file


def note_short_loops(function: Any) -> None:
    """Compile the loops of a function for a few whole vectors each, wherever it is inlined.

    Otherwise LLVM takes up to four vectors of eight numbers at a time, and the last 8 of 72 one by one.
    """
    lines = [line for _, _, line in function.__code__.co_lines() if line is not None]
    _SHORT.setdefault(function.__code__.co_filename, []).append((min(lines), max(lines)))


def _is_short(loc: ir.Loc) -> bool:
    return any(first <= loc.line <= last for first, last in _SHORT.get(loc.filename, ()))


class _FieldLower(Lower):
    """Lower a function to LLVM code that reads a field of a tuple without copying the tuple.

    Without reference counting, neither the previous value of a variable nor a deleted variable needs any
    code.
    """

    def lower_expr(self, resty: Any, expr: Any) -> Any:
        if expr.op == "getattr" and not self._disable_sroa_like_opt:
            name, held = expr.value.name, self.typeof(expr.value.name)
            is_in_memory = name not in self._blk_local_varmap
            if is_in_memory and isinstance(held, _NAMED) and expr.attr in held.fields:
                place = held.fields.index(expr.attr)
                field = self.builder.load(gep_inbounds(self.builder, self.getvar(name), 0, place))
                self.incref(held[place], field)
                return self.context.cast(self.builder, field, held[place], resty)
        return super().lower_expr(resty, expr)

    def lower_inst(self, inst: ir.Stmt) -> None:
        super().lower_inst(inst)
        if isinstance(inst, ir.Jump) and self.blkmap[inst.target].is_terminated and _is_short(inst.loc):
            self.builder.block.terminator.set_metadata("llvm.loop", self._one_vector_at_a_time())

    def _one_vector_at_a_time(self) -> llvm.MDValue:
        """Metadata of a loop that is not to be interleaved: a node whose first operand is the node itself."""
        module = self.builder.module
        count = module.add_metadata(
            [llvm.MetaDataString(module, "llvm.loop.interleave.count"), llvm.Constant(llvm.IntType(32), 1)]
        )
        loop = llvm.MDValue(module, [count], name=str(len(module.metadata)))
        loop.operands = loop, count
        return loop

    def storevar(self, value: Any, name: str, argidx: int | None = None) -> None:
        if self.context.enable_nrt or self._disable_sroa_like_opt:
            super().storevar(value, name, argidx)
            return
        self._alloca_var(name, self.typeof(name))
        if name in self._singly_assigned_vars:
            self._blk_local_varmap[name] = value
        else:
            self.builder.store(value, self.getvar(name))

    def delvar(self, name: str) -> None:
        if self.context.enable_nrt or self._disable_sroa_like_opt:
            super().delvar(name)
        elif name not in self._blk_local_varmap:
            self._singly_assigned_vars.discard(name)


@register_pass(mutates_CFG=True, analysis_only=False)
class _FieldLowering(BaseNativeLowering):
    """Numba's lowering pass with `_FieldLower`."""

    _name = "field_lowering"  # type: ignore[assignment]

    @property
    def lowering_class(self) -> type[Lower]:
        return _FieldLower


@register_pass(mutates_CFG=True, analysis_only=False)
class _Inlining(InlineInlinables):
    """Numba's inlining without its copies of functions that are read anew for each call.

    It copies them twice, and with each block all of the function's variables. Numba compiles in one thread
    at a time, so that no other compilation misses its copies.
    """

    _name = "inlining_without_copies"

    def run_pass(self, state: Any) -> bool:
        inlining: Any = inline_closurecall
        copies, inlining.copy = inlining.copy, SimpleNamespace(deepcopy=lambda block: block)
        try:
            return bool(super().run_pass(state))
        finally:
            inlining.copy = copies


_OUR_PASSES = {NativeLowering: _FieldLowering, InlineInlinables: _Inlining}


class _KernelCode(JITCodeLibrary):
    """Code of a kernel; without reference counting, the search for reference operations is skipped."""

    counts_references = False

    def _optimize_final_module(self) -> None:
        if self.counts_references:
            super()._optimize_final_module()
            return
        found = self._codegen._module_pass_manager()
        passes, *builder = found if isinstance(found, tuple) else (found,)
        passes.run(self._final_module, *builder)

    def _finalize_final_module(self) -> None:
        """Keep to this kernel what is linked into it.

        Kernels that were compiled in different processes may name different code alike; that of the one which
        is loaded first would serve both. What other kernels link is taken before.
        """
        linked, module = self._final_module.clone(), self._final_module
        for function in module.functions:
            if function.linkage.name == "linkonce_odr":
                function.linkage = "internal"
        super()._finalize_final_module()
        self._final_module = linked
        self._get_module_for_linking()
        self._final_module = module


class _LinkedCode(_KernelCode):
    """Code that is linked into kernels and never runs by itself: no machine code is generated for it."""

    @property
    def codegen(self) -> Any:
        return self

    def set_env(self, name: str, env: Any) -> None:
        """Do nothing: the environment in memory is that of the kernel."""

    def get_pointer_to_function(self, name: str) -> int:
        self._ensure_finalized()
        return 0

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


class _PartCode(_LinkedCode):
    """Linked code that is optimised only together with its callers."""

    def _optimize_final_module(self) -> None:
        """Do nothing."""


class KernelCompiler(Compiler):
    """Compile a kernel that Python calls."""

    _code: type[_KernelCode] = _KernelCode

    def define_pipelines(self) -> Any:
        pipelines = super().define_pipelines()
        for pipeline in pipelines:
            pipeline.passes = [(_OUR_PASSES.get(step, step), said) for step, said in pipeline.passes]
            pipeline.finalize()
        return pipelines

    def compile_extra(self, func: Any) -> Any:
        self.state.library = self._code(self.state.targetctx.codegen(), func.__qualname__)
        self.state.library.counts_references = self.state.flags.nrt
        self.state.library.enable_object_caching()
        return super().compile_extra(func)


class LinkedCompiler(KernelCompiler):
    """Compile a function only as far as its callers need it, which saves a sixteenth of the total time."""

    _code = _LinkedCode


class PartCompiler(LinkedCompiler):
    """Compile a function that is optimised only together with its callers."""

    _code = _PartCode


class ApartCompiler(PartCompiler):
    """Compile such a function for arrays that do not overlap, so that loops need no overlap checks."""

    def compile_extra(self, func: Any) -> Any:
        self.state.flags.noalias = True
        return super().compile_extra(func)
