"""Blocks between computation and the store: read, held back while more of their cases may follow, written."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rubhpc.schema import DIVERGED, DONE, MISSING
from rubhpc.storage.disk import disk_errors, flush_to_disk
from rubhpc.storage.journal import Entry
from rubhpc.storage.store import case_checksum

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from rubhpc.storage.journal import Journal
    from rubhpc.storage.ledger import Ledger
    from rubhpc.storage.store import Store
    from rubhpc.study.cases import Block, CaseGrid

    Arrays = dict[str, NDArray[Any]]
    Start = tuple[int, ...]
    Lines = list[tuple[int, int, int]]  # flat index, status and checksum of cases

_ALONE = 8  # cases per rank that are claimed one by one at the end of a round


class Unit(NamedTuple):
    """What a rank claims: cases of a block, by their places in it; others may have further ones of it."""

    block: Block
    places: NDArray[np.int64]
    is_shared: bool


class News(NamedTuple):
    """Results that a rank sends to the others at the end of a round.

    Attributes
    ----------
    stored, held : list of Entry
        Cases that have ended since the last round: those that are journalled, and those that are held back.
    pieces : dict
        Block -> cases of it that are held back, of this round and those before.
    n_claim : int
        Number of claims, including the one after the last unit.
    is_due : bool
        Whether results have been held back for long.
    is_over : bool
        Whether all are to end.
    """

    stored: list[Entry]
    held: list[Entry]
    pieces: dict[Start, Lines]
    n_claim: int
    is_due: bool
    is_over: bool


class Blocks:
    """The blocks of a grid, found by the cases they hold."""

    def __init__(self, grid: CaseGrid) -> None:
        self._shape, self._chunk = grid.shape, grid.chunk
        self._n_block = tuple(-(-n // c) for n, c in zip(grid.shape, grid.chunk, strict=True))
        found = grid.blocks()
        starts = np.array([block.start for block in found]).T // np.array(grid.chunk)[:, None]
        order = np.argsort(np.ravel_multi_index(tuple(starts), self._n_block))
        self._turn = order  # of each block, the longest first
        self._found = [found[i] for i in order.tolist()]

    def units(self, missing: NDArray[np.bool_], n_rank: int) -> list[Unit]:
        """Return the units of missing cases, (n_case,): blocks with most of them first, then single cases."""
        flat = np.flatnonzero(missing)
        index = np.unravel_index(flat, self._shape)
        numbers = np.ravel_multi_index(
            tuple(i // c for i, c in zip(index, self._chunk, strict=True)), self._n_block
        )
        order = np.argsort(numbers, kind="stable")
        held, first, counts = np.unique(numbers[order], return_index=True, return_counts=True)
        n_left, units = len(flat), list[Unit]()
        for i in np.lexsort((self._turn[held], -counts)).tolist():
            block, cases = self._found[held[i]], order[first[i] : first[i] + counts[i]]
            inside = tuple(at[cases] - start for at, start in zip(index, block.start, strict=True))
            places = np.ravel_multi_index(inside, block.shape)
            is_shared = n_rank > 1 and n_left <= _ALONE * n_rank
            units += (
                [Unit(block, place, True) for place in places[:, None]]
                if is_shared
                else [Unit(block, places, False)]
            )
            n_left -= len(cases)
        return units


class Pieces:
    """Cases of blocks that other ranks may have cases of too: held back, and stored rank by rank.

    Attributes
    ----------
    entered : list of Entry
        Cases since the last round.
    """

    def __init__(self) -> None:
        self._held: dict[Start, tuple[Arrays, list[Entry]]] = {}
        self.entered: list[Entry] = []

    def rows(self, start: Start) -> Arrays | None:
        """Return the arrays of a block with the cases that are held of it; None where there are none."""
        return self._held[start][0] if start in self._held else None

    def hold(self, start: Start, data: Arrays, entries: Sequence[Entry]) -> None:
        """Hold further cases of a block, with their arrays among those of the block."""
        self._held.setdefault(start, (data, []))[1].extend(entries)
        self.entered += entries

    def take(self, start: Start) -> tuple[Arrays, list[Entry]]:
        """Return the arrays of a block and the cases held of it, and hold them no longer."""
        return self._held.pop(start)

    def listed(self) -> dict[Start, Lines]:
        """Return the cases that are held, by block."""
        return {start: lines_of(entries) for start, (_, entries) in self._held.items()}


def lines_of(entries: Sequence[Entry]) -> Lines:
    """What a ledger keeps of cases."""
    return [(entry.flat, entry.status, entry.checksum) for entry in entries]


def turns_of(pieces: Sequence[dict[Start, Lines]]) -> list[list[dict[Start, Lines]]]:
    """Return who stores which of the pieces that ranks hold, turn by turn: a block has one writer at a time.

    Returns
    -------
    turns : list of list of dict
        Turn -> rank -> block -> cases.
    """
    turns: list[list[dict[Start, Lines]]] = []
    n_before: dict[Start, int] = {}
    for rank, own in enumerate(pieces):
        for start, lines in own.items():
            turn = n_before.get(start, 0)
            n_before[start] = turn + 1
            while len(turns) <= turn:
                turns.append([{} for _ in pieces])
            turns[turn][rank][start] = lines
    return turns


# Seconds between syncs, at least, and times what the last took: slow disks cost 2 %.
_SYNC_GAP, _SYNC_SHARE = 1.0, 50.0


class HeldBlocks:
    """The blocks of a rank that are not stored yet.

    Parameters
    ----------
    store : Store
    ledger : Ledger
    journal : Journal
    is_refined : bool
        Whether to keep a list of what is entered, for the decisions of a refined map.

    Attributes
    ----------
    patience : float
        Seconds for which finished blocks may be held back, since more of their cases may come.
    entered : list of Entry
        Of a refined map: cases of whole blocks that this rank has computed or found damaged.
    pieces : Pieces
        Its results in blocks that it shares with other ranks.
    """

    def __init__(self, store: Store, ledger: Ledger, journal: Journal, *, is_refined: bool) -> None:
        self._store, self._ledger, self._journal, self._is_refined = store, ledger, journal, is_refined
        self.patience = 0.0
        self.entered: list[Entry] = []
        self.pieces = Pieces()
        self._held: dict[Start, tuple[Arrays, list[Entry]]] = {}
        self._stored = time.monotonic()
        self._unsynced: list[Path] = []
        self._next_sync = self._stored + _SYNC_GAP

    @property
    def is_due(self) -> bool:
        """Whether patience is over with what is held back."""
        return time.monotonic() - self._stored >= self.patience

    def read(
        self, start: Start, flat: NDArray[np.int64], wanted: NDArray[np.bool_]
    ) -> tuple[Arrays, NDArray[np.bool_]]:
        """Arrays of a block with its stored cases, and which of these are damaged.

        Parameters
        ----------
        flat : (n,) int
            Cases of the block.
        wanted : (n,) bool
            Those that are about to be computed.
        """
        damaged = np.zeros_like(wanted)
        if start in self._held:
            return self._held[start][0], damaged
        data = self._store.empty_block(start)
        status = self._ledger.status[flat]
        kept = np.flatnonzero(~wanted & ((status == DONE) | (status == DIVERGED)))
        if not len(kept):
            return data, damaged
        stored = self._store.read_block(start)
        for i_case in kept.tolist():
            if stored is None or case_checksum(stored, i_case) != self._ledger.checksum[flat[i_case]]:
                damaged[i_case] = True
                continue
            for name, values in stored.items():
                data[name][i_case] = values[i_case]
        return data, damaged

    def blank(self, start: Start, wanted: NDArray[np.bool_]) -> Arrays:
        """Arrays of a shared block, in which the cases that are about to be computed are missing."""
        data = self.pieces.rows(start) or self._store.blank_block(start)
        for values in data.values():
            values[wanted] = np.nan
        return data

    def hold(self, start: Start, data: Arrays, entries: list[Entry], damaged: NDArray[np.int64]) -> None:
        """Hold a block with further cases; damaged ones, by flat index, that are not among them are missing.

        It is stored when patience is over, together with the others.
        """
        self._add(start, data, entries, damaged)
        if self.is_due:
            self.store()

    def store(self) -> None:
        """Store and journal the blocks that are held back, but for pieces."""
        if not self._held:
            return
        for start, (data, entries) in self._held.items():
            self._store.write_block(start, data)
            with disk_errors(self._store.path):
                self._journal.write(entries)
            self._unsynced += self._store.chunk_files(start)
        self._held.clear()
        self._stored = time.monotonic()
        if self._stored > self._next_sync:
            self.sync()

    def store_pieces(self, starts: Iterable[Start]) -> None:
        """Add the cases held of shared blocks to what is stored of them, while no other rank does."""
        for start in starts:
            flat = self._store.flat(start)
            rows, entries = self.pieces.take(start)
            wanted = np.isin(flat, [entry.flat for entry in entries])
            data, damaged = self.read(start, flat, wanted)
            for name, values in data.items():
                values[wanted] = rows[name][wanted]
            n_before = len(self.entered)
            self._add(start, data, entries, flat[damaged])
            del self.entered[n_before : n_before + len(entries)]  # those that were computed are known
        self.store()

    def sync(self) -> None:
        """Sync to the disk what has been stored, arrays before their journal lines.

        It is needed for power failures only, not for killed processes.
        """
        began = time.monotonic()
        with disk_errors(self._store.path):
            for path in self._unsynced:
                flush_to_disk(path)
            self._journal.sync()
        self._unsynced.clear()
        ended = time.monotonic()
        self._next_sync = ended + max(_SYNC_GAP, _SYNC_SHARE * (ended - began))

    def take_unsynced(self) -> list[Path]:
        """Return the files that `sync` would write to the disk, arrays before the journal, once."""
        unsynced = [*self._unsynced, *([self._journal.path] if self._journal.is_begun else [])]
        self._unsynced.clear()
        return unsynced

    def _add(self, start: Start, data: Arrays, entries: list[Entry], damaged: NDArray[np.int64]) -> None:
        lost = set(damaged.tolist()) - {entry.flat for entry in entries}
        entries = entries + [Entry(flat, self._store.manifest.case_id(flat), MISSING) for flat in lost]
        if self._is_refined:
            self.entered += entries
        self._ledger.enter(lines_of(entries))
        held = self._held.get(start)
        self._held[start] = data, entries if held is None else held[1] + entries
