"""Cache of what the last calls assembled, for further calls with the same content."""

from __future__ import annotations

import io
import pickle
import threading
from collections import OrderedDict
from dataclasses import is_dataclass
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
        self.written: OrderedDict[int, tuple[object, bytes]] = OrderedDict()  # by identity, of what is fixed


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
    try:
        key, known = _written(tuple(_short(item) for item in content)), _made.by_content
    except (pickle.PicklingError, TypeError, AttributeError):
        return make()
    if key not in known:
        known[key] = make()
        if len(known) > KEPT:
            known.popitem(last=False)
    known.move_to_end(key)
    return cast("T", known[key])


def _written(content: object) -> bytes:
    """Content as bytes."""
    written = io.BytesIO()
    _Content(written).dump(content)
    return written.getvalue()


def _short(item: object) -> object:
    """The bytes of a rig, which takes long to write; the same for any other content."""
    if not is_dataclass(item):
        return item
    known = _made.written
    if id(item) not in known:
        if not _is_fixed(item):
            return item
        known[id(item)] = item, _written(item)
        if len(known) > KEPT:
            known.popitem(last=False)
    return known[id(item)][1]


def _is_fixed(item: object) -> bool:
    """Whether an object cannot change: numbers, text, and frozen dataclasses and tuples of them."""
    if isinstance(item, tuple):
        return all(map(_is_fixed, item))
    params = getattr(item, "__dataclass_params__", None)
    if params is not None and params.frozen:
        return all(map(_is_fixed, vars(item).values()))
    return item is None or type(item) in (bool, int, float, str)


def forget() -> None:
    """Make everything again from here on, after a change to what makes it; memory is freed."""
    _made.by_content.clear()
