"""What commands print."""

from __future__ import annotations

from typing import TYPE_CHECKING

from click.testing import CliRunner

from postproc.catalogue import figures
from rubhpc.commands.figures import figure_command

if TYPE_CHECKING:
    import click


def printed(command: click.Command | str, *words: object) -> str:
    """Return what a command prints, or that of a figure by its name; its errors are raised."""
    if isinstance(command, str):
        command = figure_command(figures()[command])
    return CliRunner().invoke(command, [str(word) for word in words], catch_exceptions=False).output
