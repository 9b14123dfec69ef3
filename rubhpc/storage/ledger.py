"""What the journals of a store say of every case: the last valid line counts."""

from __future__ import annotations

import binascii
import json
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np

from rubhpc.errors import printable
from rubhpc.schema import STATUS
from rubhpc.storage.disk import NotRegular, open_regular
from rubhpc.storage.journal import journals
from rubhpc.storage.measures import blank_records, converted

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from numpy.typing import NDArray

    from rubhpc.storage.journal import Header

_BATCH = 2**16  # records moved to the ledger at once
LONGEST = 2**24  # bytes of a line, at most


@dataclass(kw_only=True)
class Ledger:
    """State of every case of a grid, from the journals.

    Attributes
    ----------
    status : (n_case,) int8
        As in the schema; MISSING where no valid line stands.
    checksum : (n_case,) uint32
        CRC-32 of the stored arrays of each case.
    is_known : (n_case,) bool
        Whether any valid line is about the case, even one that marks it as missing.
    measures : (n_case,) record or None
        Measures of the cases, missing (NaN, -1) where a case has none; None where the replay left them out.
    reasons : dict
        Flat index -> why a case failed or diverged.
    skipped : Counter
        Name of a journal -> its lines that are damaged or truncated.
    damaged_cases : set
        Flat indices that can still be read in such lines.
    n_lines : Counter
        Number of a run -> its lines.
    state : str
        Of the journals, as `Store.replay` found them.
    """

    status: NDArray[np.int8]
    checksum: NDArray[np.uint32]
    is_known: NDArray[np.bool_]
    measures: NDArray[np.void] | None
    reasons: dict[int, str] = field(default_factory=dict)
    skipped: Counter[str] = field(default_factory=Counter)
    damaged_cases: set[int] = field(default_factory=set)
    n_lines: Counter[int] = field(default_factory=Counter)
    state: str = ""

    def enter(self, lines: Iterable[tuple[int, int, int]]) -> None:
        """Take the flat index, status and checksum of cases."""
        for flat, status, checksum in lines:
            self.status[flat], self.checksum[flat] = status, checksum

    @property
    def n_recent(self) -> int:
        """Lines of the latest run."""
        return self.n_lines[max(self.n_lines, default=0)]


def count(status: NDArray[np.int8]) -> tuple[int, ...]:
    """Cases of each status, in the order of the schema."""
    return tuple(np.bincount(status, minlength=len(STATUS)).tolist())


def replay(directory: Path, header: Header, *, with_measures: bool = True) -> Ledger:
    """Read every journal in turn; damaged lines and journals of other identities or grids are skipped."""
    n_case = header.points.n_case
    measures = blank_records(n_case, header.record_type) if with_measures else None
    ledger = Ledger(
        status=np.zeros(n_case, np.int8),
        checksum=np.zeros(n_case, np.uint32),
        is_known=np.zeros(n_case, bool),
        measures=measures,
    )
    for path in journals(directory):
        ledger.n_lines[int(path.name[3:9])] += _replay_file(path, header, ledger)
    return ledger


def _replay_file(path: Path, header: Header, ledger: Ledger) -> int:
    """Enter the lines of a journal in the ledger; how many there were."""
    n_case = len(ledger.status)
    status, checksum, is_known, reasons = ledger.status, ledger.checksum, ledger.is_known, ledger.reasons
    cases: list[int] = []
    records = bytearray()
    try:
        opened = open_regular(path)
    except NotRegular:  # what was in it is lost
        ledger.skipped[path.name] += 1
        return 0
    with opened as file:
        first = file.readline(LONGEST)
        about = header_in(first)
        is_sound = about is not None
        kind = header.type_in(about) if about is not None else None
        if is_sound and kind is None:
            return 0
        n_skipped = int(not is_sound)
        n_line = 0
        while line := file.readline(LONGEST):
            text = line[9:-1]
            if line[:8] != b"%08x" % crc32(text) or line[-1:] != b"\n":
                n_skipped += 1
                ledger.damaged_cases |= _still_legible(text, n_case)
                continue
            if line == first:  # the header once more
                continue
            try:
                number, name, state, check, packed, why = text.split(b" ", 5)
                flat, code, crc = int(number), int(state), int(check, 16)
                is_wanted = packed != b"-" and (ledger.measures is not None or not is_sound)
                measures = binascii.a2b_base64(packed) if is_wanted else b""
                reason = json.loads(why) if why != b"-" else ""
                is_fit = (
                    0 <= flat < n_case
                    and 0 <= code < len(STATUS)
                    and 0 <= crc < 2**32
                    and isinstance(reason, str)
                )
            except (ValueError, RecursionError):
                is_fit = False
            if not is_fit or (is_sound and measures and kind is not None and len(measures) != kind.itemsize):
                n_skipped += 1
                continue
            if not is_sound:  # then a line counts only if its id is that of its case
                if measures and kind is None:
                    kind = header.types_by_size.get(len(measures))
                is_fit = not measures or (kind is not None and len(measures) == kind.itemsize)
                if name.decode() != header.id_at(flat) or not is_fit:
                    continue
            n_line += 1
            status[flat] = code
            checksum[flat] = crc
            is_known[flat] = True
            if measures:
                cases.append(flat)
                records += measures
                if len(cases) == _BATCH:
                    _enter(ledger, kind, cases, records)
            if reason:
                reasons[flat] = printable(reason)
            elif reasons:
                reasons.pop(flat, None)
    _enter(ledger, kind, cases, records)
    if n_skipped:
        ledger.skipped[path.name] = n_skipped
    return n_line


def header_in(line: bytes) -> dict[str, Any] | None:
    """The header in a line; None where it is damaged."""
    if line[:8] != b"%08x" % crc32(line[9:-1]):
        return None
    try:
        content = json.loads(line[9:-1])
    except (ValueError, RecursionError):
        return None
    return content if isinstance(content, dict) else None


def _enter(ledger: Ledger, kind: np.dtype[np.void] | None, cases: list[int], records: bytearray) -> None:
    """Move packed records to their cases in the ledger; of a repeated case the last one counts."""
    if ledger.measures is not None and kind is not None and cases:
        ledger.measures[cases] = converted(np.frombuffer(bytes(records), kind), ledger.measures.dtype)
    cases.clear()
    records.clear()


def _still_legible(text: bytes, n_case: int) -> set[int]:
    """The flat index of a damaged line, if it can be read."""
    number, *rest = text.split(b" ", 2)
    if len(rest) < 2 or not number.isdigit() or int(number) >= n_case:
        return set()
    return {int(number)}
