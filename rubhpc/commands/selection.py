"""The option `--select`, and the cases of a store that it leaves."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rubhpc.errors import InputError

if TYPE_CHECKING:
    import xarray as xr


SELECT = click.option(
    "--select",
    "selection",
    multiple=True,
    metavar="AXIS=VALUE",
    help='Such as speed_ratio=1.7, clearance="84 um", friction=0.1,0.3 or speed_ratio=1..2.',
)


def open_cases(store: str, selection: tuple[str, ...]) -> xr.Dataset:
    """Return the cases of a store, or of a measured file, that the command line selects."""
    from postproc.store.open import open_store
    from postproc.store.select import select

    cases = measurement(store) if is_measurement(store) else open_store(store)
    return select(cases, dict(pairs(selection, "--select")))


def is_measurement(path: str) -> bool:
    """Whether a path is that of a measured file, not of a store, which is a directory."""
    from postproc.measured.formats import FORMATS

    return not Path(path).is_dir() and Path(path).suffix.lower() in (".toml", *FORMATS)


def measurement(path: str, **keys: Any) -> xr.Dataset:
    """Return the dataset of a measured file, and print what is wrong with the record on stderr."""
    from postproc.measured.measured import measured

    found = measured(path, **keys)
    for note in filter(None, found.attrs["note"].split("\n")):
        click.echo(f"note: {note}", err=True)
    return found


def pairs(texts: tuple[str, ...], option: str) -> list[tuple[str, str]]:
    """Return the NAME=VALUE texts of an option as pairs."""
    for text in texts:
        if not all(part.strip() for part in text.partition("=")):
            raise InputError(f'{option}: "{text}" is not a pair; write NAME=VALUE')
    return [(name.strip(), value.strip()) for name, _, value in (text.partition("=") for text in texts)]
