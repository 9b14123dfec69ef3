"""Room for the frames of Python's functions.

Python takes memory for frames in blocks of 16 kB. Where the calls of a loop cross the end of a block, each of
them takes another and frees it, which lasts nearly 200 times as long as the call. Whether a loop is there
depends on all functions above it.
"""

from __future__ import annotations

from types import FunctionType
from typing import TYPE_CHECKING, ParamSpec, TypeVar, cast

if TYPE_CHECKING:
    from collections.abc import Callable

P = ParamSpec("P")
T = TypeVar("T")

WORDS = 70_000  # of a frame: more than half a block of 1 MB, in which the frames of what is called follow


def _call(function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
    return function(*args, **kwargs)


def with_room(function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
    """Return what a function returns; frames of what it calls, up to 480 kB, are in one block of memory."""
    return cast("T", _with_room(function, *args, **kwargs))


_with_room = FunctionType(_call.__code__.replace(co_stacksize=WORDS), globals())
