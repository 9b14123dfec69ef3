"""The zarr store of a study: made whole, written block by block, packed from the journals.

Every array has one chunk a block, and a block has one writer (`rubhpc.storage.block_files`). Measures are
lines of a journal first (`rubhpc.storage.journal`) and become arrays when a run ends. What is private lies
under `.rubhpc`.
"""

from __future__ import annotations

import math
import os
import shutil
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self
from zlib import crc32

import numpy as np

from rubhpc.errors import StoreError
from rubhpc.schema import DIVERGED, DONE, MISSING
from rubhpc.storage import layout
from rubhpc.storage.block_files import BlockFiles
from rubhpc.storage.disk import disk_errors, read_regular, write_whole
from rubhpc.storage.journal import Entry, Journal
from rubhpc.storage.ledger import Ledger, replay
from rubhpc.storage.lock import Lock, draft_of, remove_drafts
from rubhpc.storage.manifest import GROWTH, PRIVATE, Manifest, no_store
from rubhpc.storage.packed import PackingNote, state_of_journals, write_packed
from rubhpc.storage.parts import Parts
from rubhpc.storage.refined import status_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from rubhpc.study.cases import CaseGrid


ELSEWHERE = "move it away or choose another --output"


class Store:
    """An open store."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.manifest = Manifest.read(path)

    def reopen(self) -> None:
        """Take the manifest as it now is."""
        self.manifest = Manifest.read(self.path)
        self.__dict__.pop("block_files", None)

    @classmethod
    def create(cls, path: Path, grid: CaseGrid) -> Self:
        """Make a store for `grid` at `path`: built next to it and renamed, so that it is never incomplete.

        Raises
        ------
        StoreError
            The path exists already, or cannot be written.
        """
        with disk_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            place = Path(os.path.realpath(path))  # "." has no name
            draft = draft_of(place)
            remove_drafts(place)
            draft.mkdir()
            try:
                with disk_errors(path):  # while all of it is there, a disk that is full shows of what
                    layout.build(draft, grid)
                draft.rename(place)
            except (FileExistsError, NotADirectoryError):
                raise StoreError(no_store(path, ELSEWHERE)) from None
            except OSError as error:
                if path.is_dir() and any(path.iterdir()):
                    raise StoreError(no_store(path, ELSEWHERE)) from error
                raise
            finally:
                shutil.rmtree(draft, ignore_errors=True)
        return cls(path)

    @property
    def private(self) -> Path:
        """Where the manifest, the journals, the lock and the logs lie."""
        return self.path / PRIVATE

    @property
    def journal_directory(self) -> Path:
        """Where the journals lie."""
        return self.private / "journal"

    @property
    def in_progress_directory(self) -> Path:
        """Where each rank records the case it computes."""
        return self.private / "in_progress"

    @property
    def parts(self) -> Parts:
        """Parts of the study that are computed apart."""
        return Parts(self.path)

    def lock(self, on_loss: Callable[[], None] = lambda: None, heir_of: str = "") -> Lock:
        """Exclusive use of the store, as a context; refused while parts of the study are computed."""
        return Lock(
            self.private / "lock",
            on_loss,
            heir_of,
            find_rival=lambda: next(iter(self.parts.running()), None),
        )

    def journal(self, run: int, writer: str) -> Journal:
        """A new journal of this store."""
        return Journal(self.journal_directory, run, writer, self.manifest.header)

    def replay(self, *, with_measures: bool = True) -> Ledger:
        """What the journals say."""
        with disk_errors(self.journal_directory):
            state = state_of_journals(self.journal_directory)
            ledger = replay(self.journal_directory, self.manifest.header, with_measures=with_measures)
        ledger.state = state  # that of before: parts of the study may write while this one reads
        return ledger

    def mark_missing(self, ledger: Ledger, flat: Sequence[int], run: int, writer: str) -> None:
        """Declare cases missing, in the ledger and by a journal of their own."""
        if flat:
            ledger.status[flat] = MISSING
            with disk_errors(self.journal_directory), self.journal(run, writer) as journal:
                journal.write(Entry(i, self.manifest.case_id(i), MISSING) for i in flat)
                journal.sync()

    def damaged_files(self) -> list[str]:
        """Paths of the metadata, coordinates and settings whose checksum differs from the manifest's."""
        damaged = []
        for name, check in self.manifest.files.items():
            try:
                if crc32(read_regular(self.path / name)) == check:
                    continue
            except OSError:
                pass
            damaged.append(name)
        return damaged

    def repair_files(self, grid: CaseGrid) -> None:
        """Rewrite damaged metadata, coordinates and settings, the manifest, and shards written twice."""
        with disk_errors(self.path):
            self.block_files.compact()
        damaged = self.damaged_files()
        if not damaged and not self.manifest.damaged_copies(self.path):
            return
        with disk_errors(self.path):
            if damaged:
                files = layout.skeleton(grid, self.manifest)
                for name in damaged:
                    write_whole(self.path / name, files[name])
                checks = {name: crc32(files[name]) for name in damaged}
                self.manifest = replace(self.manifest, files=self.manifest.files | checks)
            self.manifest.write(self.path)

    def blocks(self) -> Iterator[tuple[int, ...]]:
        """First case of every block of the grid."""
        shape, chunk = self.manifest.shape, self.manifest.chunk
        for place in np.ndindex(*(math.ceil(n / c) for n, c in zip(shape, chunk, strict=True))):
            yield tuple(i * c for i, c in zip(place, chunk, strict=True))

    def window(self, start: tuple[int, ...]) -> tuple[slice, ...]:
        """The block that begins at `start`, as slices along the axes."""
        shape, chunk = self.manifest.shape, self.manifest.chunk
        return tuple(slice(s, min(s + c, n)) for s, c, n in zip(start, chunk, shape, strict=True))

    def start_of(self, flat: int) -> tuple[int, ...]:
        """First case of the block that holds a case."""
        index = np.unravel_index(flat, self.manifest.shape)
        return tuple(int(i) // c * c for i, c in zip(index, self.manifest.chunk, strict=True))

    def flat(self, start: tuple[int, ...]) -> NDArray[np.int64]:
        """Flat indices of the cases of a block, in C order."""
        flat = np.zeros(1, np.int64)
        for window, n in zip(self.window(start), self.manifest.shape, strict=True):
            flat = np.add.outer(flat * n, np.arange(window.start, window.stop)).ravel()
        return flat

    @cached_property
    def block_files(self) -> BlockFiles:
        """Where the encoded chunks lie."""
        return BlockFiles(self.path, self.manifest)

    def _place(self, start: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(s // c for s, c in zip(start, self.manifest.chunk, strict=True))

    def chunk_files(self, start: tuple[int, ...]) -> list[Path]:
        """The files to which a block is written, one an array."""
        return [self.block_files.own_file(v, self._place(start)) for v in self.manifest.variables]

    def has_files(self, start: tuple[int, ...]) -> bool:
        """Whether all arrays of a block are there and hold something; a power cut may leave empty files."""
        place = self._place(start)
        return all(self.block_files.size(variable, place) for variable in self.manifest.variables)

    def has_any_file(self, start: tuple[int, ...]) -> bool:
        """Whether any array of a block is there."""
        place = self._place(start)
        return any(self.block_files.size(variable, place) for variable in self.manifest.variables)

    def empty_block(self, start: tuple[int, ...]) -> dict[str, NDArray[Any]]:
        """Arrays of a block in which every case is missing, (n_case of it, ...) each."""
        block = self.blank_block(start)
        for values in block.values():
            values[...] = np.nan
        return block

    def blank_block(self, start: tuple[int, ...]) -> dict[str, NDArray[Any]]:
        """Arrays of a block, (n_case of it, ...) each, that hold nothing yet and take no memory before."""
        n_case = math.prod(w.stop - w.start for w in self.window(start))
        return {
            v.name: np.empty((n_case, *self.manifest.extent(v)), v.dtype) for v in self.manifest.variables
        }

    def read_block(self, start: tuple[int, ...]) -> dict[str, NDArray[Any]] | None:
        """The arrays of a block as stored; None where a file is missing or cannot be decoded."""
        inside = tuple(slice(w.stop - w.start) for w in self.window(start))
        block = {}
        for variable in self.manifest.variables:
            extent = self.manifest.extent(variable)
            shape = (*self.manifest.chunk, *extent)
            most = layout.most_bytes(variable.dtype, shape)
            data = self.block_files.read(variable, self._place(start), most)
            chunk = None if data is None else layout.decode(data, variable.dtype, shape)
            if chunk is None:
                return None
            block[variable.name] = np.ascontiguousarray(chunk[inside]).reshape(-1, *extent)
        return block

    def write_block(self, start: tuple[int, ...], data: dict[str, NDArray[Any]]) -> None:
        """Store the arrays of a block; each file appears whole."""
        shape = tuple(w.stop - w.start for w in self.window(start))
        beyond = [(0, c - n) for n, c in zip(shape, self.manifest.chunk, strict=True)]  # at the grid's edge
        with disk_errors(self.path):
            for variable, path in zip(self.manifest.variables, self.chunk_files(start), strict=True):
                values = data[variable.name].reshape(*shape, *self.manifest.extent(variable))
                if shape != self.manifest.chunk:
                    inside = [(0, 0)] * len(variable.dims)
                    values = np.pad(values, beyond + inside, constant_values=variable.fill_value)
                write_whole(path, layout.encode(values), is_synced=False)

    def pack(self, ledger: Ledger) -> None:
        """Write status and measures of every case as arrays, unless nothing has been journalled since."""
        with disk_errors(self.path):
            if self.packing_note.read() != ledger.state.encode():
                values = self.packed_values(ledger)
                for variable in self.manifest.packed:
                    write_packed(self.path, self.manifest, variable, values[variable.name])
                self.packing_note.write(ledger.state)

    def packed_values(self, ledger: Ledger) -> dict[str, NDArray[Any]]:
        """Status and measures as the packed arrays are to hold them."""
        if ledger.measures is None:
            raise ValueError("a ledger replayed without measures has none to pack")
        void = ~np.isin(ledger.status, (DONE, DIVERGED))
        shape = self.manifest.shape
        status = status_of(self.manifest, ledger.status, ledger.measures)
        packed: dict[str, NDArray[Any]] = {"status": status.reshape(shape)}
        for variable in self.manifest.measures:
            values = ledger.measures[variable.name].copy()
            values[void] = variable.fill_value
            packed[variable.name] = values.reshape(*shape, *self.manifest.extent(variable))
        return packed

    @property
    def packing_note(self) -> PackingNote:
        """Note of what the packed arrays hold."""
        return PackingNote(self.private / "packed.json", self.journal_directory)

    def is_packed(self) -> bool:
        """Whether the packed arrays are up to date with the journals."""
        return self.packing_note.is_current()

    def refine(self, table: dict[str, Any] | None) -> None:
        """Have the map refined in this way, or (None) computed whole; needs the store's lock."""
        if self.manifest.refine != table:
            with disk_errors(self.path):
                self.packing_note.remove()
                self.manifest = replace(self.manifest, refine=table)
                self.manifest.write(self.path)


def case_checksum(data: dict[str, NDArray[Any]], i_case: int) -> int:
    """CRC-32 of the stored arrays of one case of a block."""
    check = 0
    for values in data.values():
        check = layout.checksum(values[i_case], check)
    return check


def is_damaged(path: Path) -> bool:
    """Whether the metadata of the group at `path` differ from what its manifest lists; False without one."""
    if (path / PRIVATE / GROWTH).is_dir():
        return False  # a growth is under way
    try:
        check = Manifest.read(path).files.get("zarr.json")
        return check is not None and crc32(read_regular(path / "zarr.json")) != check
    except (StoreError, OSError):
        return False
