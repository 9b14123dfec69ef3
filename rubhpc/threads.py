"""One thread a process for linear algebra: BLAS's sums, and a result's last bit, depend on their number.

On matrices as small as these, threads also take more processor time than they save.
"""

from __future__ import annotations

from contextlib import contextmanager
from functools import cache, wraps
from threading import Lock
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from threadpoolctl import ThreadpoolController

P = ParamSpec("P")
T = TypeVar("T")

# What libraries read as they start: BLAS, numba and zarr would each start as many threads as there are cores.
VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "NUMBA_NUM_THREADS",
    "ZARR_THREADING__MAX_WORKERS",
)


def on_one_thread(function: Callable[P, T]) -> Callable[P, T]:
    """Hold the libraries of linear algebra to one thread in a function, whatever the environment says."""

    @wraps(function)
    def held(*args: P.args, **kwargs: P.kwargs) -> T:
        with one_thread():
            return function(*args, **kwargs)

    return held


@contextmanager
def one_thread() -> Iterator[None]:
    """Hold them to one thread within a context; it costs some 10 us.

    Of contexts of several threads at once, the last to end gives back what the first has found.
    """
    with _counting:
        _held.append(_held[0] if _held else _controller().limit(limits=1))
    try:
        yield
    finally:
        with _counting:
            limit = _held.pop()
            if not _held:
                limit.restore_original_limits()


_held: list[Any] = []  # the limit, once for each context
_counting = Lock()


@cache
def _controller() -> ThreadpoolController:
    """The libraries that are loaded, found once."""
    import scipy.linalg  # noqa: F401 - it brings the second BLAS, NumPy's being the first
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
