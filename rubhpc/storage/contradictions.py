"""Cases with contradictory lines in a journal.

A repeated line, even a repeated journal, is harmless. A rank computes no case twice in one run unless it has
declared it missing in between. Other repeated lines of a case in one journal therefore come from elsewhere,
and it is unknown which is valid. Lines of different runs may differ: the later one counts, and processors
round differently.
"""

from __future__ import annotations

import binascii
from typing import TYPE_CHECKING
from zlib import crc32

from rubhpc.schema import DIVERGED, DONE
from rubhpc.storage.disk import NotRegular, open_regular
from rubhpc.storage.journal import journals
from rubhpc.storage.ledger import LONGEST, header_in

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np

    from rubhpc.storage.journal import Header

_CLOCK = "wall_time"  # of the measures: it differs at each computation of a case
_STORED = tuple(b"%d" % status for status in (DONE, DIVERGED))


def contradicted(directory: Path, header: Header) -> set[int]:
    """Flat indices of cases with contradictory lines in a journal and no line in a later one."""
    found: set[int] = set()
    for path in journals(directory):
        known, contradicted_here = _read(path, header)
        found -= known
        found |= contradicted_here
    return found


def _read(path: Path, header: Header) -> tuple[set[int], set[int]]:
    """Cases that a sound journal names, and those with contradictory lines."""
    known: dict[int, int] = {}
    twice: set[int] = set()
    try:
        opened = open_regular(path)
    except NotRegular:
        return set(), set()
    with opened as file:
        about = header_in(file.readline(LONGEST))
        kind = header.type_in(about) if about is not None else None
        if kind is None:
            return set(), set()
        while line := file.readline(LONGEST):
            text = line[9:-1]
            parts = text.split(b" ", 5)
            if line[:8] != b"%08x" % crc32(text) or len(parts) < 6 or not parts[0].isdigit():
                continue
            flat, said = int(parts[0]), _said(parts, kind)
            if parts[2] not in _STORED:  # what follows is computed again
                known[flat] = 0
                twice.discard(flat)
            elif said is not None:
                if known.get(flat, 0) not in (0, said):
                    twice.add(flat)
                known[flat] = said
    return set(known), twice


def _said(parts: list[bytes], kind: np.dtype[np.void]) -> int | None:
    """CRC-32 of a line of a case without the wall time; None where the line does not count."""
    _, name, status, check, measures, reason = parts
    if measures != b"-":
        try:
            record = bytearray(binascii.a2b_base64(measures))
            is_fit = len(record) == kind.itemsize and int(check, 16) < 2**32
        except ValueError:
            is_fit = False
        if not is_fit:
            return None
        assert kind.fields is not None
        if _CLOCK in kind.fields:
            field, offset = kind.fields[_CLOCK][:2]
            record[offset : offset + field.itemsize] = b""
        measures = bytes(record)
    return crc32(b" ".join([name, status, check, measures, reason])) or 1
