"""The figures as methods of a class, made from their declarations; `figure_methods.pyi` states their types.

The stub is written by `python tests/support/figure_stub.py`, and a test holds it to the declarations.
"""

from __future__ import annotations

import inspect
import textwrap
from typing import TYPE_CHECKING, Any

from postproc.catalogue import figures
from postproc.store.select import select

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import xarray as xr
    from matplotlib.axes import Axes

    from postproc.catalogue import Figure


class FigureMethods:
    """A method for each figure, which draws what the command of its name draws."""

    def __init__(self, store: xr.Dataset) -> None:
        self._store = store


def _method(figure: Figure) -> Callable[..., Axes | list[Axes]]:
    """Return the method that draws a figure, with its signature and docstring."""

    def method(
        self: FigureMethods, *args: Any, ax: Axes | Sequence[Axes] | None = None, **words: Any
    ) -> Axes | list[Axes]:
        options = {name: words.pop(name) for name in figure.options if name in words}
        return figure.of(select(self._store, words), *args, **options).show(ax)

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
    method.__name__, method.__qualname__ = figure.name, f"Rub.{figure.name}"
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
    setattr(FigureMethods, _figure.name, _method(_figure))
