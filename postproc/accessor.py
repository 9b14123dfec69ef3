"""`store.rub`: the figures of a store, one method each, for notebooks; `rubhpc.open` registers it."""

from __future__ import annotations

import inspect
import textwrap
from typing import TYPE_CHECKING, Any

import xarray as xr

from postproc.catalogue import figures
from postproc.store.open import open_store
from postproc.store.select import select

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from matplotlib.axes import Axes

    from postproc.catalogue import Figure


@xr.register_dataset_accessor("rub")  # type: ignore[no-untyped-call]  # xarray leaves it untyped
class Rub:
    """Figures of a store.

    A method draws what the command of its name draws, and takes its options as keywords of the same names and
    defaults (`postproc.catalogue`). Further keywords choose cases, as in `select` (a dotted rig key with
    underscores).

    Examples
    --------
    >>> cases = rubhpc.open("quickstart.zarr")  # doctest: +SKIP
    >>> cases.rub.orbit(speed_ratio=1.7, clearance_ratio=0.7)  # doctest: +SKIP
    """

    def __init__(self, store: xr.Dataset) -> None:
        self._store = store

    def select(self, **choice: Any) -> xr.Dataset:
        """Return the cases whose axes have these values: numbers in SI, text with a unit, lists or slices.

        Raises
        ------
        InputError
            No such axis, or no such value on it; the message names what is near.
        """
        return select(self._store, choice)


def _method(figure: Figure) -> Callable[..., Axes | list[Axes]]:
    """Return the method of `Rub` that draws a figure, with its signature and docstring."""

    def method(
        self: Rub, *args: Any, ax: Axes | Sequence[Axes] | None = None, **words: Any
    ) -> Axes | list[Axes]:
        options = {name: words.pop(name) for name in figure.options if name in words}
        return figure.of(self.select(**words), *args, **options).show(ax)

    keyword, rest = inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.VAR_KEYWORD
    signature = inspect.Signature(
        [
            inspect.Parameter("self", inspect.Parameter.POSITIONAL_ONLY),
            *figure.parameters,
            inspect.Parameter("ax", keyword, default=None, annotation="Axes | Sequence[Axes] | None"),
            inspect.Parameter("choice", rest, annotation="Any"),
        ],
        return_annotation="Axes | list[Axes]",
    )
    method.__name__, method.__qualname__ = figure.name, f"{Rub.__qualname__}.{figure.name}"
    method.__signature__ = signature  # type: ignore[attr-defined]
    method.__doc__ = _document(figure)
    return method


def _document(figure: Figure) -> str:
    texts = {name: option.help for name, option in figure.options.items()}
    texts["ax"] = "Axes to draw on, as many as the figure has [default: a new figure of pyplot]."
    texts["**choice"] = "Values of axes, which select cases."
    wrapped = (f"{name}\n{textwrap.indent(textwrap.fill(text, 100), '    ')}" for name, text in texts.items())
    returned = "Axes or list of Axes\n    Those drawn on; a list for a figure of several panels."
    sections = ["Parameters\n----------\n" + "\n".join(wrapped), f"Returns\n-------\n{returned}"]
    return "\n\n".join([figure.description, *sections])


for _figure in figures().values():
    setattr(Rub, _figure.name, _method(_figure))


def open(path: str | Path) -> xr.Dataset:  # noqa: A001 - the public name
    """Return a store as a lazy, dask-backed dataset with the figures of `Rub` as its attribute `rub`.

    See `postproc.store.open.open_store`.
    """
    return open_store(path)
