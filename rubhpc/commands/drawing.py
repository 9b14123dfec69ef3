"""What the figure commands share: their store and selection, and where figure and data go."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rubhpc.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    import xarray as xr

    from postproc.figures.catalogue import Drawing

REVOLUTIONS = click.IntRange(min=1)
SELECT = click.option(
    "--select",
    "selection",
    multiple=True,
    metavar="AXIS=VALUE",
    help='Such as speed_ratio=1.7, clearance="84 um", friction=0.1,0.3 or speed_ratio=1..2.',
)


def of_store(function: Callable[..., None]) -> Callable[..., None]:
    """Add what every figure command takes: the store, a selection, and where figure and data go."""
    for decorate in (
        click.option("--data", metavar="FILE", help="Write the data too: .csv, .json, .zarr or .nc."),
        click.option("--figure", metavar="FILE", help=".png, .pdf or .svg [default: STORE_COMMAND.png here]"),
        SELECT,
        click.argument("store"),
    ):
        function = decorate(function)
    return function


def open_cases(store: str, selection: tuple[str, ...]) -> xr.Dataset:
    """Return the cases of a store that the command line selects."""
    from postproc.store.open import open_store
    from postproc.store.select import select

    return select(open_store(store), dict(pairs(selection, "--select")))


def draw(
    command: str,
    drawing_of: Callable[..., Drawing],
    words: dict[str, Any],
    tell: Callable[[Drawing], Iterable[str]] = lambda drawing: drawing.notes,
) -> Drawing:
    """Draw and save the figure of a command, write its data where asked, and tell where they are.

    Parameters
    ----------
    drawing_of : callable
        One of `postproc.figures.catalogue`; takes the cases selected and the command's own words.
    words : dict
        All that the command line says, with what `of_store` adds.
    tell : callable
        The lines that are printed before the figure is drawn.
    """
    from postproc.figures.style import check_figure_path, house_style, new_figure, save
    from postproc.store.export import check_data_path, write_data
    from postproc.store.units import caption

    own = dict(words)
    store, selection, figure, data = (own.pop(word) for word in ("store", "selection", "figure", "data"))
    path = check_figure_path(figure or f"{Path(store).resolve().stem}_{command}.png")
    data_path = check_data_path(data) if data else None
    drawing = drawing_of(open_cases(store, selection), **own)
    for line in tell(drawing):
        click.echo(line)
    with house_style():
        page, axes = new_figure(drawing.n_row, drawing.height, drawing.width, drawing.n_column)
        drawing.draw(axes)
        page.suptitle(caption(drawing.shown), fontsize=7, x=0.02, ha="left")
        save(page, path)
    click.echo(str(path))
    if data_path:
        click.echo(str(write_data(drawing.shown, data_path)))
    return drawing


def pairs(texts: tuple[str, ...], option: str) -> list[tuple[str, str]]:
    """Return the NAME=VALUE texts of an option as pairs."""
    for text in texts:
        if not all(part.strip() for part in text.partition("=")):
            raise InputError(f'{option}: "{text}" is no pair; write NAME=VALUE')
    return [(name.strip(), value.strip()) for name, _, value in (text.partition("=") for text in texts)]
