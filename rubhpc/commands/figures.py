"""The figure commands: one for each figure of `postproc.catalogue`, whose options it takes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rubhpc.commands.selection import SELECT, measurement, open_cases, pairs

if TYPE_CHECKING:
    from collections.abc import Callable

    from postproc.catalogue import Figure, Option


# Figures of signals, which may have been measured.
MEASURED_FIGURES = {
    "bode",
    "cascade",
    "centreline",
    "hht",
    "orbit",
    "polar",
    "spectrum",
    "waterfall",
    "waveform",
}
_store_argument = click.argument("store")
_figure_option = click.option(
    "--figure", "output", metavar="FILE", help=".png, .pdf or .svg [default: STORE_COMMAND.png here]"
)
_measured_option = click.option(
    "--measured", metavar="FILE", help="A measured file (TOML, or its data), drawn with the case."
)
_data_option = click.option("--data", metavar="FILE", help="Write the data too: .csv, .json, .zarr or .nc.")


def figure_command(figure: Figure) -> click.Command:
    """Return the command that draws a figure of a store."""

    def command(
        store: str,
        selection: tuple[str, ...],
        output: str | None,
        data: str | None,
        measured: str | None = None,
        **words: Any,
    ) -> None:
        for name, option in figure.options.items():
            if option.form == "pairs":
                words[name] = dict(pairs(words[name], _flag(name)))
        draw(figure, store, selection, words, output, data, measured)

    decorators: list[Callable[[Any], Any]] = [_store_argument, SELECT, _figure_option, _data_option]
    if figure.name in MEASURED_FIGURES:
        decorators.append(_measured_option)
    decorators += [_click_option(option) for option in figure.options.values()]
    for decorate in reversed(decorators):
        command = decorate(command)
    return click.command(figure.name, help=figure.description)(command)


def draw(
    figure: Figure,
    store: str,
    selection: tuple[str, ...],
    words: dict[str, Any],
    output: str | None = None,
    data: str | None = None,
    beside: str | None = None,
) -> None:
    """Draw and save a figure, write its data where asked, and print its lines and the paths of all files."""
    from postproc.beside import figure_beside, samples_of
    from postproc.figures.drawing import check_figure_path
    from postproc.store.export import check_data_path, write_data

    path = check_figure_path(output or f"{Path(store).resolve().stem}_{figure.name}.png")
    data_path = check_data_path(data) if data else None
    cases = open_cases(store, selection)
    if beside is None:
        drawing = figure.of(cases, **words)
    else:
        found = measurement(beside, samples_per_revolution=samples_of(cases))
        drawing = figure_beside(figure, cases, found, words, has_data=data_path is not None)
    for line in drawing.lines:
        click.echo(line)
    click.echo(str(drawing.save(path)))
    files = ({data_path: drawing.shown} if data_path else {}) | dict(drawing.files)
    for file, dataset in files.items():
        click.echo(str(write_data(dataset, file)))


def _click_option(option: Option) -> Callable[[Any], Any]:
    is_flag = option.kind is bool
    metavar = option.metavar
    if option.form == "pairs":
        metavar = f"NAME={metavar or 'VALUE'}"
    return click.option(
        _flag(option.name),
        type=None if is_flag else _type(option),
        is_flag=is_flag,
        nargs=2 if option.form == "two" else 1,
        multiple=option.form in ("many", "pairs"),
        default=None if option.form != "one" else option.default,
        show_default=not is_flag and option.form == "one" and option.default is not None,
        metavar=metavar,
        help=option.help,
    )


def _type(option: Option) -> click.ParamType[Any]:
    if option.choices:
        return click.Choice(option.choices)
    if (bounds := option.bounds) is not None:
        ends: tuple[Any, Any] = (bounds.least, bounds.most)
        is_open = {"min_open": bounds.is_open, "max_open": bounds.is_open and bounds.most is not None}
        return click.IntRange(*ends, **is_open) if option.kind is int else click.FloatRange(*ends, **is_open)
    return click.types.convert_type(option.kind)


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"
