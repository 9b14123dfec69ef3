"""Calls from Python of what only kernels call."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

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
