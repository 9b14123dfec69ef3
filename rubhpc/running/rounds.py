"""Rounds of a refined map: ranks claim what it asks for so far, then exchange results.

A round ends as soon as one rank finds nothing left: the others finish their case and leave the rest to the
next round, so that no rank waits for longer than a case. The last cases of a round are claimed one by one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.storage.journal import Entry
    from rubhpc.study.cases import Block, CaseGrid

    Start = tuple[int, ...]
    Arrays = dict[str, NDArray[Any]]
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
