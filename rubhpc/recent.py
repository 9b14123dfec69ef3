"""Cache of what the last calls assembled, for further calls with the same content."""

from __future__ import annotations

import io
import pickle
import threading
from collections import OrderedDict
from typing import TYPE_CHECKING, Any, TypeVar, cast

if TYPE_CHECKING:
    from collections.abc import Callable

T = TypeVar("T")

OWN = "rubhpc", "numpy", "builtins"
KEPT = 16  # of all kinds: three cases or more


class _Made(threading.local):
    """Of a thread, since contact modes are added to a set-up in use."""

    def __init__(self) -> None:
        self.by_content: OrderedDict[bytes, object] = OrderedDict()


_made = _Made()


class _Content(pickle.Pickler):
    """Writes content as bytes; refused are classes of others, whose functions may change meanwhile."""

    def reducer_override(self, value: object) -> Any:
        """Look at each object that is not built in, classes among them."""
        if isinstance(value, type) and value.__module__.partition(".")[0] not in OWN:
            raise pickle.PicklingError
        return NotImplemented


def recent(make: Callable[[], T], *content: object) -> T:
    """Return what has lately been made of the same content, or make it.

    Parameters
    ----------
    make : callable
        Makes it; it must depend on nothing else.
    *content
        Compared by value, arrays included, and not kept. Of what cannot be written as bytes, or has a class
        that is not the package's, it is made each time.
    """
    written = io.BytesIO()
    try:
        _Content(written).dump(content)
    except (pickle.PicklingError, TypeError, AttributeError):
        return make()
    key, known = written.getvalue(), _made.by_content
    if key not in known:
        known[key] = make()
        if len(known) > KEPT:
            known.popitem(last=False)
    known.move_to_end(key)
    return cast("T", known[key])


def forget() -> None:
    """Make everything again from here on, after a change to what makes it; memory is freed."""
    _made.by_content.clear()
