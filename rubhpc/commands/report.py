"""`rubhpc report` and `rubhpc view`: a store as a page in a browser."""

from __future__ import annotations

from pathlib import Path

import click

from rubhpc.commands.options import quantity

_STORE = click.argument("store", type=click.Path(path_type=Path))


@click.command()
@_STORE
@click.option(
    "--output", type=click.Path(path_type=Path), metavar="FILE", help="The page [default: STORE.html here]."
)
@click.option("--limit", default="10 MB", show_default=True, metavar="SIZE", help="Largest size of the page.")
def report(store: Path, output: Path | None, limit: str) -> None:
    """Write one self-contained HTML page on STORE, which needs no network, server or store.

    It shows the study, the rig, the runs, failures, and where the model leaves its range; from its maps each
    case opens with its orbit, spectrum, waveform and Poincaré section. It also works during a run.
    """
    from postproc.report.budget import write_report
    from postproc.store.open import open_live
    from rubhpc.errors import InputError

    size = quantity(limit, "byte", "--limit")
    path = output or Path(f"{store.resolve().stem}.html")
    if path.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"{path}: a report is an HTML page; name it {path.stem}.html")
    if not path.parent.is_dir():
        raise InputError(f"{path}: no directory {path.parent}; make it first")
    load = write_report(open_live(store), path, size)
    click.echo(f"{path} ({path.stat().st_size / 1e6:.1f} MB)")
    for note in load.notes:
        click.echo(note)


@click.command()
@_STORE
@click.option(
    "--port", type=click.IntRange(0, 65535), default=0, show_default="a free port", help="Port of the server."
)
def view(store: Path, port: int) -> None:
    """Serve the page of `rubhpc report` over STORE, of any size, to this machine only; Ctrl-C ends it.

    Every case is shown in full, read when it is selected. Reload the page to see new results of a run.
    """
    import contextlib

    from postproc.report.server import Library, Server
    from postproc.store.open import open_live

    with Server(Library(lambda: open_live(store)), port) as server, contextlib.suppress(KeyboardInterrupt):
        click.echo(f"{store} is served at {server.url} (Ctrl-C ends it)")
        server.serve_forever()
