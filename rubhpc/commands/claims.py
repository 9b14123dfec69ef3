"""`rubhpc claims`: the paper's claims against the stores of `jobs/paper`, and its figures drawn from them."""

from __future__ import annotations

import shutil
from pathlib import Path

import click

from rubhpc.errors import InputError, writing

FOLDER = "paper"  # where the studies of jobs/paper put their stores


@click.command()
@click.option("--figure", "number", type=click.IntRange(min=1), metavar="N", help="Only Fig. N of the paper.")
@click.option(
    "--stores",
    metavar="FOLDER",
    default=FOLDER,
    show_default=True,
    help="Where the stores of jobs/paper are.",
)
@click.option("--json", "is_json", is_flag=True, help="Print JSON instead of a table.")
@click.option("--document", metavar="FILE", help="Write the table as a document, such as docs/claims.md.")
@click.option("--draw", metavar="FOLDER", help="Draw the figures of the paper into a folder, as PNG.")
def claims(number: int | None, stores: str, is_json: bool, document: str | None, draw: str | None) -> int:
    """Check every claim of the paper against the stores of its studies; the exit code is 1 if one fails.

    `make paper` runs the studies. Where the paper leaves a value open or contradicts itself, the result is
    only reported.
    """
    from postproc.mokhtar2017.claims.cases import open_studies
    from postproc.mokhtar2017.claims.claim import FAILS, as_json, document_of, text
    from postproc.mokhtar2017.claims.table import CLAIMS, on_figure
    from postproc.mokhtar2017.figures.pages import FIGURES, draw_figures

    if document and number is not None:
        raise InputError("--document: contains all claims; leave out --figure")
    chosen = on_figure(number) if number is not None else list(CLAIMS)
    figures = [n for n in FIGURES if number in (None, n)] if draw else []
    needed = [*(s for c in chosen for s in c.studies), *(s for n in figures for s in FIGURES[n].studies)]
    opened = open_studies(stores, needed)
    results = [claim.evaluate(opened) for claim in chosen]
    click.echo(as_json(results) if is_json else text(results, shutil.get_terminal_size((120, 24)).columns))
    if document:
        with writing(Path(document), "--document"):
            Path(document).write_text(document_of(results), encoding="utf-8")
    if draw:
        for path in draw_figures(figures, opened, draw):
            click.echo(str(path), err=is_json)
    return int(any(result.verdict == FAILS for result in results))
