"""Calls from Python of what only kernels call."""

from __future__ import annotations

from types import FunctionType
from typing import TYPE_CHECKING, Any, TypeVar

import numba

if TYPE_CHECKING:
    from collections.abc import Callable

F = TypeVar("F", bound="Callable[..., object]")


def called(function: F) -> F:
    """Return a kernel that calls a function with `kernels._jit.linked`, which has no code of its own."""

    @numba.njit
    def call(*args):  # type: ignore[no-untyped-def]
        return function(*args)

    found: F = call
    return found


def interpreted(function: Callable[..., Any], known: dict[int, Any] | None = None) -> Callable[..., Any]:
    """Return a kernel as Python runs it, with all that it calls: nothing is compiled for a few calls."""
    known = {} if known is None else known
    source = getattr(function, "py_func", function)
    if id(source) not in known:
        there: dict[str, Any] = {}
        known[id(source)] = FunctionType(source.__code__, there, source.__name__, source.__defaults__)
        for name, value in source.__globals__.items():
            there[name] = interpreted(value, known) if hasattr(value, "py_func") else value
    found: Callable[..., Any] = known[id(source)]
    return found
