"""Append-only journals of what has been computed: one a run and rank, one line a case; `ledger` reads them.

A line is `crc flat id status checksum measures reason`: the CRC-32 of the rest of the line, the case's flat
index in the grid of the file's header, its id, its status, the CRC-32 of its stored arrays, its measures
(base64 of one packed record, so that floats keep every bit; `-` where there are none) and the reason of a
failure (JSON, `-` where none). The header is `crc {json}` and lists the measures of the lines. A line of a
later run overrides an earlier one; a line with status 0 marks a case as missing again.
"""

from __future__ import annotations

import binascii
import json
import os
import re
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self
from zlib import crc32

import numpy as np

from rubhpc.storage.measures import columns, measures_type, record_type
from rubhpc.study.continuation import CaseIds

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path
    from types import TracebackType

    from rubhpc.schema import Variable
    from rubhpc.study.continuation import Continuation
    from rubhpc.study.points import Points

_FORMAT = 1
_NAME = re.compile(r"run(\d{6})-(\w+)\.journal")


@dataclass(frozen=True, slots=True)
class Entry:
    """One case in a journal; `checksum` is the CRC-32 of its stored arrays."""

    flat: int
    id: str
    status: int
    checksum: int = 0
    measures: bytes = b""
    reason: str = ""

    def line(self) -> bytes:
        """The entry as a line of the journal, its own checksum first."""
        measures = binascii.b2a_base64(self.measures, newline=False) if self.measures else b"-"
        reason = json.dumps(self.reason).encode() if self.reason else b"-"
        text = b"%d %s %d %08x %s %s" % (
            self.flat,
            self.id.encode(),
            self.status,
            self.checksum,
            measures,
            reason,
        )
        return b"%08x %s\n" % (crc32(text), text)


@dataclass(frozen=True, kw_only=True)
class Header:
    """What the lines of a journal refer to: the study's identity, its cases, and their measures."""

    identity: str
    points: Points
    n_stator: int
    measures: tuple[Variable, ...]
    n_added: int = 0  # of these, the last, which older journals of the store may lack
    continuation: Continuation | None = None

    @cached_property
    def grid(self) -> dict[str, Any]:
        """The part of the header that the journals of a store share."""
        return {
            "format": _FORMAT,
            "identity": self.identity,
            "shape": list(self.points.shape),
            "axes": [crc32(np.array(values).tobytes()) for values in self.points.values],
        }

    @cached_property
    def record_type(self) -> np.dtype[np.void]:
        """Packed record of the measures of a case."""
        return measures_type(self.measures, self.n_stator)

    def type_in(self, header: dict[str, Any]) -> np.dtype[np.void] | None:
        """Packed record in a journal with this header; None where it belongs to another study or grid."""
        listed = header.pop("metrics", ())
        if header != self.grid:
            return None
        try:
            return record_type(listed) if all(n in (0, self.n_stator) for *_, n in listed) else None
        except (TypeError, ValueError):
            return None

    @cached_property
    def types_by_size(self) -> dict[int, np.dtype[np.void]]:
        """Size in bytes -> packed record, of this journal and of older ones with fewer measures."""
        n = len(self.measures)
        types = [measures_type(self.measures[:i], self.n_stator) for i in range(n - self.n_added, n + 1)]
        return {kind.itemsize: kind for kind in types}

    def id_at(self, flat: int) -> str:
        """Id of the case at a flat index of the grid; "" beyond it."""
        return self._ids(self.points.at_flat(flat)) if flat < self.points.n_case else ""

    @cached_property
    def _ids(self) -> CaseIds:
        return CaseIds(self.identity, self.points.values, self.continuation)

    def line(self) -> bytes:
        """The header as the first line of a journal."""
        listed = columns(self.measures, self.n_stator)
        text = json.dumps({**self.grid, "metrics": listed}).encode()
        return b"%08x %s\n" % (crc32(text), text)


class Journal:
    """A run's and rank's own journal, opened for appending; made when its first entries come."""

    def __init__(self, directory: Path, run: int, writer: str, header: Header) -> None:
        self.path = directory / f"run{run:06d}-{writer}.journal"
        self._header = header
        self._handle: int | None = None

    def write(self, entries: Iterable[Entry]) -> None:
        """Append the entries: they survive this process, and a power failure once `sync` has returned."""
        data = b"".join(entry.line() for entry in entries)
        if self._handle is None:
            self._handle = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o666)
            data = self._header.line() + data
        view = memoryview(data)
        while view:
            view = view[os.write(self._handle, view) :]

    @property
    def is_begun(self) -> bool:
        """Whether there is a file yet."""
        return self._handle is not None

    def sync(self) -> None:
        """Return once all entries are on the disk."""
        if self._handle is not None:
            os.fsync(self._handle)

    def close(self) -> None:
        """Close the file."""
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def journals(directory: Path) -> list[Path]:
    """The journals in the order in which they count; no link that leads nowhere."""
    found = (path for path in directory.glob("*.journal") if _NAME.fullmatch(path.name))
    return sorted(path for path in found if path.exists())


def next_run(directory: Path) -> int:
    """Number of the run that starts now: one more than the highest that left a journal."""
    numbers = [int(found[1]) for path in directory.glob("*.journal") if (found := _NAME.fullmatch(path.name))]
    return max(numbers, default=0) + 1
