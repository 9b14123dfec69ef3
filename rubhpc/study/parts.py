"""Parts of a study: shares that are computed apart, by jobs that do not talk to each other.

A share is made of whole sequences of blocks, so that a block has one writer and a sweep belongs to one part.
Longest first, neighbours one after another, each goes to the part with the least predicted steps so far.
Between parts with equal loads a hash decides: in plain turns a part would get the cases of one friction, say,
where the number of parts fits the length of that axis.
"""

from __future__ import annotations

import heapq
import re
from typing import TYPE_CHECKING, NamedTuple, Self
from zlib import crc32

import numpy as np

from rubhpc.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.study.cases import CaseGrid
    from rubhpc.study.study import Study

MOST_PARTS = 100_000


class Part(NamedTuple):
    """Part `number` of `total`, from 1."""

    number: int
    total: int

    def __str__(self) -> str:
        return f"{self.number}/{self.total}"

    @classmethod
    def parse(cls, text: str) -> Self:
        """The part that a text such as "3/64" names."""
        found = re.fullmatch(r"(\d{1,99})/(\d{1,99})", text.strip(), re.ASCII)
        if found is None:
            raise InputError(f'part "{text}": is not of the form K/N; give for example 3/64')
        part = cls(int(found[1]), int(found[2]))
        if not 1 <= part.total <= MOST_PARTS:
            raise InputError(f"part {part}: a study has from 1 to {MOST_PARTS} parts")
        if not 1 <= part.number <= part.total:
            raise InputError(f"part {part}: is out of range; parts count from 1 to {part.total}")
        return part


def check_parts(part: Part, study: Study) -> None:
    """Check that a study can be computed in parts."""
    if study.refine is not None:
        why = "the levels of a refined map need the results of all parts"
        raise InputError(f"part {part}: {why}; use --workers or mpirun, or remove [refine]")


def share_out(grid: CaseGrid, total: int) -> NDArray[np.int32]:
    """Number of the part, of `total`, that computes each block, (n_block,), in C order of their places."""
    n_block = [-(-n // c) for n, c in zip(grid.shape, grid.chunk, strict=True)]
    shares = np.zeros(n_block, np.int32)
    costs = [(sum(block.cost for block in sequence), sequence) for sequence in grid.sequences()]
    loads = [(0, _mixed(number), number) for number in range(1, total + 1)]
    heapq.heapify(loads)
    for cost, sequence in sorted(costs, key=lambda pair: (-pair[0], pair[1][0].start)):
        load, _, number = loads[0]
        heapq.heapreplace(loads, (load + cost, _mixed(number, *sequence[0].start), number))
        for block in sequence:
            shares[tuple(s // c for s, c in zip(block.start, grid.chunk, strict=True))] = number
    return shares.ravel()


def _mixed(*numbers: int) -> int:
    """A number that does not rise or fall with these, the same on every machine."""
    return crc32(repr(numbers).encode())
