"""`rubhpc STUDY.toml`, `plan`, `compile`, `status` and `verify`."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from rubhpc.commands.options import STUDY, TRUST_STUDY, quantity
from rubhpc.errors import InputError, RubError, StoreError
from rubhpc.running.launch import end_with_launcher, launch

_OUTPUT = click.option(
    "--output",
    type=click.Path(path_type=Path),
    metavar="STORE",
    help="The store, in place of that of the study.",
)
_WHOLE_START = 1.5  # the store made and ended


@click.command()
@STUDY
@_OUTPUT
@TRUST_STUDY
@click.option("--retry-failed", is_flag=True, help="Compute failed cases again.")
@click.option(
    "--max-failures", type=click.IntRange(min=0), metavar="N", help="Stop when more than N cases fail."
)
@click.option(
    "--workers",
    type=click.IntRange(min=1),
    metavar="N",
    help="Share the work among N processes of this machine, without MPI.",
)
@click.option(
    "--part",
    metavar="K/N",
    help="Compute part K of N only; parts may run at the same time, on machines that share the disk.",
)
@click.option("--time-limit", metavar="TIME", help='Stop after TIME: "2 h", or seconds.')
@click.option(
    "--accept-version",
    is_flag=True,
    help="Keep the cases that another version of the physics has computed, and continue.",
)
@click.option(
    "--only",
    metavar="ID",
    help="Compute one case, print it and compare it with the store, bit for bit; nothing is written.",
)
@click.option("--quiet", is_flag=True, help="Print nothing but errors.")
def run(
    study: Path,
    output: Path | None,
    trust_rig: bool,
    part: str | None,
    time_limit: str | None,
    only: str | None,
    quiet: bool,
    **options: Any,
) -> int:
    """Run or resume STUDY.toml; with --workers, or under mpirun, on several processes.

    With --part 3/64, as in an array of jobs, only that part is computed; the last part to end completes the
    store. The run stops cleanly, with code 75, on SIGTERM, SIGINT or SIGUSR1, at its time limit, or when a
    file STOP is created in the store; the same command resumes it.
    """
    if only is not None:
        if part is not None:
            raise InputError("--only computes one case; leave --part out")
        return _reproduce(study, output, only, trust_rig=trust_rig)
    from rubhpc.running.stopping import Stopping

    end_with_launcher()
    with Stopping() as stopping:  # signals are handled from here on, however long the imports below take
        from rubhpc.running.driver import run as run_study

        summary = run_study(
            study,
            output=output,
            trust_rig=trust_rig,
            time_limit=None if time_limit is None else quantity(time_limit, "s", "--time-limit"),
            part=part,
            quiet=quiet,
            stopping=stopping,
            **options,
        )
    if launch().rank == 0 and not quiet:
        click.echo(summary.text())
    if summary.exit_code:
        error = RubError(summary.complaint())
        error.exit_code = summary.exit_code
        raise error
    return 0


def _reproduce(study: Path, output: Path | None, name: str, *, trust_rig: bool) -> int:
    from rubhpc.running.recompute import reproduce
    from rubhpc.study.study import read_study

    if launch().rank == 0:
        click.echo(reproduce(read_study(study, output, trust_rig=trust_rig), name).text())
    return 0


@click.command()
@STUDY
@_OUTPUT
@TRUST_STUDY
@click.option("--part", metavar="K/N", help="Estimate only part K of N.")
def plan(study: Path, output: Path | None, trust_rig: bool, part: str | None) -> int:
    """Estimate the cost of STUDY.toml and show what is done; writes nothing.

    Core-hours come from cases spread over all axes, timed on this machine for some 10 s at most and scaled by
    the predicted steps. Long cases are cut, and scaled by the share that was done.
    """
    from rubhpc.running.plan import make_plan
    from rubhpc.running.progress import one_line
    from rubhpc.study.study import read_study

    with one_line() as say:
        found = make_plan(read_study(study, output, trust_rig=trust_rig), part, say)
    start_up = time.process_time() - found.spent  # what this process and a run have in common
    click.echo(replace(found, start_up=_WHOLE_START * start_up).text())
    return 0


@click.command("compile")
@STUDY
@TRUST_STUDY
def compile_kernels(study: Path, trust_rig: bool) -> int:
    """Compile the kernels of STUDY.toml and compute nothing.

    A run does so by itself. Run this before a job of many processes, or where the kernels are installed for
    others: they are kept beside the sources, or in NUMBA_CACHE_DIR.
    """
    from rubhpc.integrate.compilation import announced_by, seconds_compiling
    from rubhpc.kernels._cache import cache_folder
    from rubhpc.running.warm_up import warm_up
    from rubhpc.study.cases import CaseGrid
    from rubhpc.study.study import read_study

    grid = CaseGrid(read_study(study, trust_rig=trust_rig))
    with announced_by(click.echo):
        warm_up(grid, grid.sequences()[0][0].start, lambda: None)
    click.echo(f"kernels in {cache_folder()}: {seconds_compiling():.0f} s of compilation")
    return 0


@click.command()
@click.argument("store", type=click.Path(path_type=Path))
def status(store: Path) -> int:
    """Show the progress of STORE and its failed cases; works during a run."""
    from rubhpc.storage.status import read_status

    click.echo(read_status(store).text())
    return 0


@click.command()
@click.argument("store", type=click.Path(path_type=Path))
def verify(store: Path) -> int:
    """Check every case of STORE against its checksum; the next run computes what is damaged."""
    from rubhpc.storage.verify import verify as verify_store

    damage = verify_store(store)
    for line in damage.warnings():
        click.echo(line)
    if not damage:
        click.echo(f"{damage.n_checked} cases checked, no damage")
        return 0
    for line in damage.lines():
        click.echo(line)
    raise StoreError(damage.complaint())
