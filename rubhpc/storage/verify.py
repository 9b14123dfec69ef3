"""Checks every stored case against its checksum and marks damaged ones for the next run."""

from __future__ import annotations

import binascii
import os
from dataclasses import dataclass, field
from typing import TYPE_CHECKING
from zlib import crc32

import numpy as np

from rubhpc.errors import StoreError
from rubhpc.schema import DIVERGED, DONE, INFERRED, MISSING, VARIABLES
from rubhpc.storage.disk import NotRegular, is_filled, open_regular
from rubhpc.storage.growth import finish_growth
from rubhpc.storage.journal import journals, next_run
from rubhpc.storage.ledger import LONGEST, header_in
from rubhpc.storage.manifest import GROWTH, PRIVATE
from rubhpc.storage.packed import read_packed
from rubhpc.storage.store import Store, case_checksum
from rubhpc.storage.tidy import unfit

if TYPE_CHECKING:
    from pathlib import Path

    from rubhpc.storage.journal import Header
    from rubhpc.storage.ledger import Ledger

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


@dataclass(frozen=True, kw_only=True)
class Damage:
    """Differences between a store and its checksums.

    Attributes
    ----------
    cases : dict
        Flat index -> the case's index and coordinates, and what is wrong with it.
    arrays : tuple of str
        Metadata, coordinates, settings and packed arrays; the next run rewrites them without computing.
    n_checked : int
        Cases that have been compared with their checksum.
    skipped : dict
        Name of a journal -> its damaged lines, which count for nothing: no damage, where no case is named.
    note : str
        Why the damage could not be marked for the next run; empty where it was, or where there is none.
    """

    store: Path
    cases: dict[int, str]
    arrays: tuple[str, ...]
    n_checked: int
    skipped: dict[str, int] = field(default_factory=dict)
    note: str = ""

    def __bool__(self) -> bool:
        return bool(self.cases or self.arrays)

    def warnings(self) -> list[str]:
        """What is odd and harms nothing by itself, a line each."""
        return [
            f"warning: {n} damaged line{'s' * (n > 1)} in {name}: skipped" for name, n in self.skipped.items()
        ]

    def lines(self) -> list[str]:
        """What is damaged, a line each."""
        return [f"damaged: case {text}" for text in self.cases.values()] + [
            f"damaged: {name}; the next run rewrites it" for name in self.arrays
        ]

    def complaint(self) -> str:
        """All of it in one line, with what to do."""
        advice = (
            f"not marked for the next run: {self.note}" if self.note else "run its study again to repair it"
        )
        return f"{self.store}: damage in {len(self.cases)} cases and {len(self.arrays)} arrays; {advice}"


def verify(path: Path) -> Damage:
    """Compare all that a store holds with its checksums; cases found damaged are missing from then on."""
    store = Store(path)
    note = ""
    if (store.private / GROWTH).is_dir():  # a run was killed in it
        with store.lock():
            finish_growth(path)
        store.reopen()
    ledger = store.replay()
    damaged = _damaged_cases(store, ledger)
    for flat in contradicted(store.journal_directory, store.manifest.header):
        if ledger.status[flat] != MISSING:
            damaged.setdefault(flat, "two lines of a journal contradict each other")
    lost = _lost_lines(store, ledger)
    packed = _damaged_packed(store, ledger)
    oversized = dict.fromkeys(
        f"{file.parent.name} (a shard with bytes that belong to no case)"
        for file in store.block_files.oversized()
    )
    files = dict.fromkeys(_named(name) for name in store.damaged_files())
    n_checked = int(np.isin(ledger.status, (DONE, DIVERGED)).sum())
    if damaged or packed:
        try:
            with store.lock():
                if packed:
                    store.packing_note.remove()
                store.mark_missing(ledger, sorted(damaged), next_run(store.journal_directory), "verify")
        except (StoreError, OSError) as error:
            note = str(error)
    return Damage(
        store=path,
        cases={i: f"{_name(store, i)}: {text}" for i, text in sorted((damaged | lost).items())},
        arrays=tuple(
            dict.fromkeys(
                (*files, *packed, *oversized, *store.manifest.damaged_copies(path), *_misplaced(store))
            )
        ),
        n_checked=n_checked,
        skipped=dict(ledger.skipped),
        note=note,
    )


def _named(file: str) -> str:
    """What a file of metadata, coordinates or settings is to the reader of a store."""
    array, slash, rest = file.partition("/")
    if not slash:
        return "metadata"
    return f"metadata of {array}" if rest == "zarr.json" else array


def _name(store: Store, flat: int) -> str:
    index = ", ".join(str(i) for i in np.unravel_index(flat, store.manifest.shape))
    return f"({index}) {store.manifest.name_case(flat)}"


def _damaged_cases(store: Store, ledger: Ledger) -> dict[int, str]:
    """Cases whose arrays are missing, cannot be decoded, or have changed."""
    damaged = {}
    for start in store.blocks():
        flat = store.flat(start)
        there = np.flatnonzero(np.isin(ledger.status[flat], (DONE, DIVERGED)))
        if not len(there):
            continue
        data = store.read_block(start)
        for i_case in there.tolist():
            if data is None:
                damaged[int(flat[i_case])] = _trouble(store, start)
            elif case_checksum(data, i_case) != ledger.checksum[flat[i_case]]:
                damaged[int(flat[i_case])] = "its arrays have changed"
    return damaged


def _trouble(store: Store, start: tuple[int, ...]) -> str:
    """Why a block cannot be read."""
    if store.has_files(start):
        return "a chunk cannot be decoded"
    absent = [path for path in store.chunk_files(start) if not is_filled(path)]
    is_gone = not any(os.path.lexists(path) for path in absent)
    return "a file is missing" if is_gone else "a chunk is empty, or is not a regular file"


def _lost_lines(store: Store, ledger: Ledger) -> dict[int, str]:
    """Cases whose line in a journal is cut short, damaged, or packed and yet no longer there."""
    never = ~ledger.is_known
    packed = read_packed(store.path, store.manifest, VARIABLES["status"])
    lost = set(ledger.damaged_cases)
    if packed is not None:
        lost |= set(np.flatnonzero(~np.isin(packed.ravel(), (MISSING, INFERRED)) & never).tolist())
    return {flat: "its line in the journal is damaged or missing" for flat in lost if never[flat]}


def _misplaced(store: Store) -> list[str]:
    """Names in the private directory that are of another kind of file than they must be, or gone."""
    private = store.path / PRIVATE
    places = unfit(store.path, store.manifest)
    return [
        str(place.relative_to(private))
        for place in places
        if place.is_relative_to(private) and not place.name.endswith(".partial")
    ]


def _damaged_packed(store: Store, ledger: Ledger) -> tuple[str, ...]:
    """Packed arrays that do not hold what the journals say, though these have not changed since.

    Where the note of that is garbled, it is named: nobody knows whether they should.
    """
    if store.packing_note.is_garbled():
        return ("packed.json",)
    if not store.is_packed():
        return ()
    damaged = []
    values = store.packed_values(ledger)
    for variable in store.manifest.packed:
        stored = read_packed(store.path, store.manifest, variable)
        if stored is None or stored.tobytes() != values[variable.name].tobytes():
            damaged.append(variable.name)
    return tuple(damaged)
