"""The types of the methods of `store.rub`, from the declarations of the figures, as a stub."""

from __future__ import annotations

import inspect
from pathlib import Path

import postproc.figures.options as vocabulary
from postproc.catalogue import Figure, figures

STUB = Path(vocabulary.__file__).parents[1] / "figure_methods.pyi"
HEAD = """# Written by `python tests/support/figure_stub.py` from the declarations of the figures.
from collections.abc import Mapping, Sequence
from typing import Any, Literal, Optional, Union

import xarray as xr
from matplotlib.axes import Axes

class FigureMethods:
    _store: xr.Dataset
    def __init__(self, store: xr.Dataset) -> None: ...
"""


def text() -> str:
    """Return the stub as it should be."""
    return HEAD + "".join(_method(figure) for figure in figures().values())


def _method(figure: Figure) -> str:
    positional = [p for p in figure.parameters if p.kind is inspect.Parameter.POSITIONAL_OR_KEYWORD]
    named = [p for p in figure.parameters if p.kind is inspect.Parameter.KEYWORD_ONLY]
    written = ["self", *map(_parameter, positional), "*", *map(_parameter, named)]
    lines = "".join(f"        {entry},\n" for entry in [*written, "ax: Axes | Sequence[Axes] | None = ..."])
    return f"    def {figure.name}(\n{lines}        **choice: Any,\n    ) -> Axes | list[Axes]: ...\n"


def _parameter(parameter: inspect.Parameter) -> str:
    kind = (
        inspect.formatannotation(parameter.annotation).replace("collections.abc.", "").replace("typing.", "")
    )
    kind = kind.replace("NoneType", "None")
    default = "" if parameter.default is inspect.Parameter.empty else " = ..."
    return f"{parameter.name}: {kind}{default}"


if __name__ == "__main__":
    STUB.write_text(text())
