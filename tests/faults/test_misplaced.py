"""Files of a store with other content, of another kind or type than expected: a clear line, and a repair."""

from __future__ import annotations

import json
import os
import re
import shutil
import struct
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np
import pytest
from google_crc32c import value as crc32c
from numcodecs.blosc import Blosc
from running import stored_bytes, write_study

from rubhpc.cli import main
from rubhpc.running.driver import run as run_study
from rubhpc.storage.verify import verify

if TYPE_CHECKING:
    from collections.abc import Callable

CHUNK = "vertical/c/1/0/0/0"
JOURNAL = ".rubhpc/journal/run000001-rank00000.journal"
RUN = ".rubhpc/runs/run000001.json"
LOCK = ".rubhpc/lock"
PACKED = ".rubhpc/packed.json"

Damage = tuple[str, str, "Callable[[Path], None]"]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("finished")
    run_study(write_study(folder, keep='["waveform"]'), quiet=True)
    return folder


def clear(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def text(content: str | bytes) -> Callable[[Path], None]:
    return lambda path: path.write_bytes(content if isinstance(content, bytes) else content.encode())


def directory(path: Path) -> None:
    clear(path)
    (path / "within").mkdir(parents=True)


def file(path: Path) -> None:
    clear(path)
    path.write_text("a file")


def pipe(path: Path) -> None:
    clear(path)
    os.mkfifo(path)


def endless(path: Path) -> None:
    clear(path)
    path.symlink_to("/dev/zero")


def of_array(array: np.ndarray) -> Callable[[Path], None]:
    """Another array than expected, as a chunk that is sound in itself."""
    encoded = Blosc(cname="lz4", clevel=5, shuffle=Blosc.SHUFFLE).encode(np.ascontiguousarray(array))
    return text(encoded + struct.pack("<I", crc32c(encoded)))


def undecodable(path: Path) -> None:
    data = path.read_bytes()[:8] + bytes(100)
    path.write_bytes(data + struct.pack("<I", crc32c(data)))


def field(name: str, value: Any) -> Callable[[Path], None]:
    """Change one value of a small JSON file."""

    def change(path: Path) -> None:
        here = {"host": os.uname().nodename, "pid": 1, "born": "0", "parent": 0, "since": 0.0, "token": "t"}
        content = json.loads(path.read_text()) if path.exists() else here
        path.write_text(json.dumps(content | {name: value}))

    return change


def line(content: str, *, at: int = 1) -> Callable[[Path], None]:
    """Insert a line with a valid checksum in a journal."""

    def change(path: Path) -> None:
        lines = path.read_bytes().splitlines(keepends=True)
        lines.insert(at, b"%08x %s\n" % (crc32(content.encode()), content.encode()))
        path.write_bytes(b"".join(lines))

    return change


def doubled_header(path: Path) -> None:
    first, _, rest = path.read_bytes().partition(b"\n")
    path.write_bytes(first + b"\n" + first + b"\n" + rest)


def attribute(name: str, value: Any) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        content = json.loads(path.read_text())
        content["attributes"][name] = value
        path.write_text(json.dumps(content))

    return change


BYTES = [b"\xff\xfe\x00", "[]", "7", '{"number": []}', "[" * 10_000]
KINDS = [directory, pipe, endless]
ID = "0" * 32
DAMAGES: list[Damage] = [
    *((f"{where} holds {what[:8]!r}", where, text(what)) for where in (PACKED, RUN, LOCK) for what in BYTES),
    *(
        (f"{where} is {how.__name__}", where, how)
        for where in (PACKED, RUN, LOCK, ".rubhpc/lock.guard", JOURNAL, CHUNK, "zarr.json", "period/c/0/0/0")
        for how in KINDS
    ),
    *(
        (f"{where} is {how.__name__}", where, how)
        for where in (".rubhpc/journal", ".rubhpc/runs", ".rubhpc/in_progress", ".rubhpc/logs", "vertical")
        for how in (file, pipe)
    ),
    *((f"{at} is {how.__name__}", at, how) for at in ("vertical/c", "vertical/c/1") for how in (file, clear)),
    *((f"{at} is gone", at, clear) for at in (".rubhpc/journal", ".rubhpc/runs", ".rubhpc/logs", "vertical")),
    *(
        (f"{where} has {name} {value!r:.12}", where, field(name, value))
        for where, name, value in (
            (LOCK, "pid", "one"),
            (LOCK, "pid", 2**70),
            (LOCK, "pid", -1),
            (LOCK, "since", 1e300),
            (LOCK, "since", []),
            (LOCK, "host", "\x1b[31m"),
            (RUN, "number", [1]),
            (RUN, "number", 10**300),
            (RUN, "began", "then"),
            (RUN, "wrote", {}),
            (RUN, "host", None),
        )
    ),
    ("a chunk of another shape", CHUNK, of_array(np.zeros(5, "f4"))),
    ("a chunk of a larger shape", CHUNK, of_array(np.zeros(10**7, "f4"))),
    ("a chunk that does not decode", CHUNK, undecodable),
    ("a doubled header", JOURNAL, doubled_header),
    *(
        (f"a line {what[:30]!r}", JOURNAL, line(what))
        for what in ("", "0", "{}", "x x x x x x", f"99 {ID} 1 0 - -", f"-1 {ID} 1 0 - -", f"0 {ID} 9 0 - -")
    ),
    ("a line with a huge checksum", JOURNAL, line(f"0 {ID} 1 fffffffff - -")),
    ("a line with short measures", JOURNAL, line(f"0 {ID} 1 0 AAAA -")),
    ("a line whose reason is a list", JOURNAL, line(f"0 {ID} 1 0 - []")),
    *((f"a header {what[:20]!r}", JOURNAL, line(what, at=0)) for what in ("[]", "{}", '{"metrics": 5}')),
    *(
        (f"attribute {name} is {value!r}", "zarr.json", attribute(name, value))
        for name in ("study", "rig", "versions", "title", "identity", "conventions", "coordinates")
        for value in (5, [], None)
    ),
    ("attributes of an array", "vertical/zarr.json", attribute("units", [])),
]


def called(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str]:
    """Exit code of a command and what it prints on stderr."""
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    return int(ended.value.code or 0), capsys.readouterr().err


def damaged(finished: Path, folder: Path, where: str, how: Callable[[Path], None]) -> Path:
    """Damage a copy of the store; returns its path."""
    store = Path(shutil.copytree(finished / "tiny.zarr", folder / "tiny.zarr"))
    (store / ".rubhpc" / "in_progress").mkdir(exist_ok=True)
    how(store / where)
    return store


def check_said(code: int, err: str) -> None:
    """One line of plain text where a command fails, none where it does not."""
    assert code in (0, 1, 3), err
    assert len(err.splitlines()) == (code != 0), err
    assert re.fullmatch(r"[^\x00-\x09\x0b-\x1f]*", err), err


def one_in(count: int) -> list[Any]:
    """The damages, of which one in `count` is done here, and all with `make faults`."""
    return [
        pytest.param(*how, id=name, marks=[pytest.mark.long] if i % count else [])
        for i, (name, *how) in enumerate(DAMAGES)
    ]


@pytest.mark.timeout(120, func_only=True)
@pytest.mark.parametrize(("where", "how"), one_in(10))
def test_a_damage_is_reported_in_a_line_and_repaired(finished, tmp_path, capsys, where, how):
    store = damaged(finished, tmp_path, where, how)
    for command in ("status", "verify"):
        check_said(*called(capsys, command, store))
    assert called(capsys, "run", finished / "tiny.toml", "--output", store, "--quiet") == (0, "")
    assert stored_bytes(store) == stored_bytes(finished / "tiny.zarr")
    assert not verify(store)


@pytest.mark.timeout(120, func_only=True)
@pytest.mark.parametrize(("where", "how"), one_in(25))  # a page takes longer than all the rest
def test_a_damage_does_not_break_the_report(finished, tmp_path, capsys, where, how):
    store = damaged(finished, tmp_path, where, how)
    check_said(*called(capsys, "report", store, "--output", tmp_path / "report.html"))
