"""Which figures there are, and the options of each, read from the files of `postproc.figures`.

A figure is a file there with a function of the file's name. The signature and the docstring of this function
are the only declaration of its options: the command line, `store.rub` and the documents derive from them.
They are read from the source, so that `rubhpc --help` loads neither numpy nor the figures.
"""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from postproc import figures as room
from postproc.figures import options as vocabulary
from postproc.figures.options import Bounds, Metavar
from rubhpc.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

    from postproc.figures.drawing import Drawing


@dataclass(frozen=True, kw_only=True)
class Option:
    """An option of a figure, as its function declares it."""

    name: str
    default: Any
    help: str
    kind: type  # bool, int, float or str, of one value
    form: Literal["one", "two", "many", "pairs"] = "one"  # a sequence, or a mapping of names to values
    choices: tuple[str, ...] = ()  # all values there are; none where any is allowed
    bounds: Bounds | None = None
    metavar: str | None = None

    def check(self, value: Any) -> None:
        """Raise InputError where the value is none of the choices or out of bounds."""
        if self.choices and value is not None and value not in self.choices:
            raise InputError(f'{self.name}: "{value}" is not one of {", ".join(self.choices)}')
        if self.bounds is not None and isinstance(value, int | float) and value not in self.bounds:
            raise InputError(f"{self.name}: {value:g} is out of range; it must be {self.bounds}")


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A figure and its declaration, named as its file, function, command and method."""

    name: str
    summary: str  # the first line of the docstring
    description: str  # all of it above the parameters
    parameters: tuple[inspect.Parameter, ...]  # without the cases; their annotations are plain types
    options: Mapping[str, Option]

    def of(self, cases: xr.Dataset, *args: Any, **words: Any) -> Drawing:
        """Return the drawing of some cases; `args` and `words` are those of the figure's function.

        InputError where a value is none of those offered or out of range, or the cases cannot be drawn so.
        """
        from postproc.cases.maps import verdict_of
        from postproc.signals.places import named_places

        given = inspect.Signature(self.parameters).bind(*args, **words).arguments
        for name, value in given.items():
            self.options[name].check(value)
        function = getattr(import_module(f"postproc.figures.{self.name}"), self.name)
        drawing: Drawing = function(named_places(cases), *args, **words)
        return replace(drawing, verdict=(*drawing.verdict, *verdict_of(cases)))


def figures() -> dict[str, Figure]:
    """Return all figures by name, in alphabetical order."""
    files = sorted(file for folder in room.__path__ for file in Path(folder).glob("[!_]*.py"))
    found = (_read(file) for file in files)
    return {figure.name: figure for figure in found if figure is not None}


@cache
def _read(file: Path) -> Figure | None:
    """Return the figure of a file, which does not run; None where the file has no function of its name."""
    source = file.read_text(encoding="utf-8")
    if f"\ndef {file.stem}(" not in source:
        return None
    node = next(n for n in ast.parse(source).body if isinstance(n, ast.FunctionDef) and n.name == file.stem)
    description, _, sections = (ast.get_docstring(node) or "").partition("\n\nParameters\n")
    described = vocabulary.HELP | dict(_entries(sections))
    stub = _stub(node, file)
    _, *parameters = inspect.signature(stub).parameters.values()
    plain = get_type_hints(stub)
    return Figure(
        name=file.stem,
        summary=description.partition("\n")[0],
        description=description,
        parameters=tuple(p.replace(annotation=plain[p.name]) for p in parameters),
        options={p.name: _option(p, described[p.name]) for p in parameters},
    )


def _stub(node: ast.FunctionDef, file: Path) -> Callable[..., None]:
    """Return a function without its body, its annotations evaluated with the names of the vocabulary."""
    node.body, node.returns, node.args.args[0].annotation = [ast.Pass()], None, None
    module = ast.fix_missing_locations(ast.Module([node], []))
    names = dict(vars(vocabulary))
    exec(compile(module, str(file), "exec", dont_inherit=True), names)  # noqa: S102 - of this package
    stub: Callable[..., None] = names[node.name]
    return stub


def _entries(sections: str) -> list[tuple[str, str]]:
    """Return the names and texts of a numpydoc list of parameters."""
    entries = re.findall(r"^(\w+)(?: :.*)?\n((?: {4}.*\n?|\n(?= {4}))+)", sections, re.MULTILINE)
    return [(name, " ".join(text.split())) for name, text in entries]


def _option(parameter: inspect.Parameter, text: str) -> Option:
    kinds = _members(parameter.annotation)
    form: Literal["one", "two", "many", "pairs"] = "one"
    item = kinds[0]
    for kind in kinds:
        if get_origin(kind) is Sequence:
            form, item = "many", get_args(kind)[0]
        elif get_origin(kind) is tuple:
            form, item = "two", get_args(kind)[0]
        elif get_origin(kind) is Mapping:
            form, item = "pairs", get_args(kind)[1]
    item, *notes = get_args(item) if get_origin(item) is Annotated else (item,)
    choices = get_args(item) if get_origin(item) is Literal else ()
    return Option(
        name=parameter.name,
        default=parameter.default,
        help=text,
        kind=item if item in (bool, int, float) else str,
        form=form,
        choices=choices,
        bounds=next((note for note in notes if isinstance(note, Bounds)), None),
        metavar=next((note.name for note in notes if isinstance(note, Metavar)), None),
    )


def _members(annotation: Any) -> tuple[Any, ...]:
    return get_args(annotation) if get_origin(annotation) in (Union, UnionType) else (annotation,)
