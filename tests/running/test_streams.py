"""Standard streams that are closed, full or not of UTF-8 end no command."""

from __future__ import annotations

import io
import os
import shlex
import subprocess
from contextlib import redirect_stdout

import click
import pytest
from running import command, environment, run, write_study

from rubhpc.cli import main
from rubhpc.schema import DONE
from rubhpc.storage.store import Store
from rubhpc.streams import lasting_streams


def read_by_none() -> io.TextIOWrapper:
    """Return a pipe whose reader has ended."""
    reader, writer = os.pipe()
    os.close(reader)
    return os.fdopen(writer, "w")


def full() -> io.TextIOWrapper:
    return open("/dev/full", "w")


@pytest.mark.parametrize(("opened", "problem"), [(read_by_none, ""), (full, "No space left on device")])
@pytest.mark.parametrize("n", [1, 10**6])
def test_what_cannot_be_written_is_dropped(opened, problem, n):
    with opened() as stream, redirect_stdout(stream), lasting_streams() as found:
        print("x" * n)
        click.echo("x", nl=False)
        assert found() == problem
        assert found() == problem


def test_a_closed_stream_takes_everything():
    with redirect_stdout(None), lasting_streams() as found:
        print("x", flush=True)
        assert found() == ""


@pytest.mark.parametrize(("encoding", "shown"), [("ascii", "? ?"), ("latin-1", "é ?"), ("utf-8", "é Ω")])
def test_characters_that_an_encoding_lacks_are_replaced(encoding, shown):
    written = io.BytesIO()
    with redirect_stdout(io.TextIOWrapper(written, encoding)), lasting_streams():
        print("é Ω")
        click.echo("é Ω", nl=False)
        print("\udcff", end="", flush=True)  # of a file name
        assert written.getvalue().decode(encoding) == f"{shown}\n{shown}?"


def test_results_that_are_lost_are_reported(capsys):
    with full() as stream, redirect_stdout(stream), pytest.raises(SystemExit) as ended:
        main(["--help"])
    assert ended.value.code == 2
    assert capsys.readouterr().err.startswith("rubhpc: standard output: No space left on device; ")


def test_a_run_goes_on_without_its_output(tmp_path):
    study = write_study(tmp_path)
    with full() as stream, redirect_stdout(stream):
        assert run(study).returncode == 0


def test_workers_need_no_streams(tmp_path):
    study = write_study(tmp_path, clearance_ratio=[0.7])
    asked = shlex.join(command(study, "--workers", 2))
    subprocess.run(["sh", "-c", f"{asked} <&- >&- 2>&-"], env=environment(), check=True, timeout=120)
    assert (Store(tmp_path / "tiny.zarr").replay().status == DONE).all()
