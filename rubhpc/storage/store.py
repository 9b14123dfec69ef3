"""The zarr store of a study: made whole, written block by block, packed from the journals.

Every array has one chunk a block, and a block has one writer. Metrics are lines of a journal first
(`rubhpc.storage.journal`) and become arrays when a run ends. What is private lies under `.rubhpc`.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import socket
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import zarr

from rubhpc.errors import StoreError
from rubhpc.schema import DIVERGED, DONE, MISSING
from rubhpc.storage import layout
from rubhpc.storage.disk import disk_errors, write_whole
from rubhpc.storage.journal import METRICS, Entry, Journal, Ledger, journals, replay
from rubhpc.storage.lock import Lock, process_state
from rubhpc.storage.manifest import PRIVATE, Manifest

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from rubhpc.sweep import Sweep


class Store:
    """An open store; `arrays` holds its zarr arrays by name."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.manifest = Manifest.read(path)
        self.arrays: dict[str, zarr.Array[Any]] = {}
        self._open_arrays()

    @classmethod
    def create(cls, path: Path, sweep: Sweep) -> Self:
        """Make a store for `sweep` at `path`: built beside it, then renamed, so that it is never half made.

        Raises
        ------
        StoreError
            Something stands there already, or it cannot be written.
        """
        with disk_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            _remove_drafts(path)
            draft = path.with_name(f".{path.name}.{socket.gethostname()}.{os.getpid()}.draft")
            draft.mkdir()
            try:
                layout.build(draft, sweep)
                draft.rename(path)
            except (FileExistsError, NotADirectoryError):
                raise StoreError(
                    f"{path}: is no rubhpc store; move it away or choose another --output"
                ) from None
            except OSError as error:
                if path.is_dir() and any(path.iterdir()):
                    raise StoreError(
                        f"{path}: is no rubhpc store; move it away or choose another --output"
                    ) from error
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

    def lock(self, on_loss: Callable[[], None] = lambda: None) -> Lock:
        """Exclusive use of the store, as a context."""
        return Lock(self.private / "lock", on_loss)

    def journal(self, run: int, writer: str) -> Journal:
        """A new journal of this store."""
        return Journal(self.journal_directory, run, writer, self.manifest.header)

    def replay(self, *, with_metrics: bool = True) -> Ledger:
        """What the journals say."""
        with disk_errors(self.journal_directory):
            return replay(self.journal_directory, self.manifest.header, with_metrics=with_metrics)

    def take_back(self, ledger: Ledger, flat: Sequence[int], run: int, writer: str) -> None:
        """Declare cases missing, in the ledger and by a journal of their own."""
        if flat:
            ledger.status[flat] = MISSING
            with disk_errors(self.journal_directory), self.journal(run, writer) as journal:
                journal.write(Entry(i, "-", MISSING) for i in flat)
                journal.sync()

    def grow(self, sweep: Sweep) -> None:
        """Lengthen the axes to those of `sweep`, which begin as they do; killed, it can be done again."""
        with disk_errors(self.path):
            group = zarr.open_group(self.path, mode="r+", use_consolidated=False)
            layout.resize(group, Manifest.of(sweep))
            static = layout.write_static(group, sweep)
            group.update_attributes({"study": sweep.study.as_dict()})
            layout.consolidate(self.path)
            self.forget_packing()
            self.manifest = replace(Manifest.of(sweep, static=static), chunk=self.manifest.chunk)
            self.manifest.write(self.path)
        self._open_arrays()

    def damaged_static(self) -> list[str]:
        """Names of the coordinates and settings that are not what the manifest vouches for."""
        return [name for name, check in self.manifest.static.items() if not self._vouched(name, check)]

    def mend_static(self, sweep: Sweep) -> None:
        """Write coordinates and settings anew where one is damaged."""
        if self.damaged_static():
            with disk_errors(self.path):
                layout.write_static(zarr.open_group(self.path, mode="r+", use_consolidated=False), sweep)

    def _vouched(self, name: str, check: int) -> bool:
        try:
            return layout.checksum(np.asarray(self.arrays[name][...])) == check
        except (RuntimeError, ValueError, OSError):
            return False

    def _open_arrays(self) -> None:
        names = [*self.manifest.static, *(v.name for v in (*self.manifest.variables, *layout.PACKED))]
        try:
            group = zarr.open_group(self.path, mode="r+", use_consolidated=False)
            self.arrays = {name: layout.get_array(group, name) for name in names}
        except (KeyError, ValueError, TypeError, OSError) as error:
            raise StoreError(
                f"{self.path}: its metadata is damaged ({error}); run into another --output"
            ) from None

    def blocks(self) -> Iterator[tuple[int, ...]]:
        """First case of every block of the grid."""
        shape, chunk = self.manifest.shape, self.manifest.chunk
        for place in np.ndindex(*(math.ceil(n / c) for n, c in zip(shape, chunk, strict=True))):
            yield tuple(i * c for i, c in zip(place, chunk, strict=True))

    def window(self, start: tuple[int, ...]) -> tuple[slice, ...]:
        """The block that begins at `start`, as slices along the axes."""
        shape, chunk = self.manifest.shape, self.manifest.chunk
        return tuple(slice(s, min(s + c, n)) for s, c, n in zip(start, chunk, shape, strict=True))

    def flat(self, start: tuple[int, ...]) -> NDArray[np.int64]:
        """Flat indices of the cases of a block, in C order."""
        flat = np.zeros(1, np.int64)
        for window, n in zip(self.window(start), self.manifest.shape, strict=True):
            flat = np.add.outer(flat * n, np.arange(window.start, window.stop)).ravel()
        return flat

    def chunk_files(self, start: tuple[int, ...]) -> list[Path]:
        """The files that hold a block, one an array."""
        place = [s // c for s, c in zip(start, self.manifest.chunk, strict=True)]
        return [
            self.path / v.name / self.arrays[v.name].metadata.encode_chunk_key((*place, *[0] * len(v.dims)))
            for v in self.manifest.variables
        ]

    def has_files(self, start: tuple[int, ...]) -> bool:
        """Whether all files of a block are there and hold something; a power cut may leave empty ones."""
        try:
            return all(path.stat().st_size for path in self.chunk_files(start))
        except FileNotFoundError:
            return False

    def empty_block(self, start: tuple[int, ...]) -> dict[str, NDArray[Any]]:
        """Arrays of a block in which every case is missing, (n_case of it, ...) each."""
        n_case = math.prod(w.stop - w.start for w in self.window(start))
        return {
            v.name: np.full((n_case, *self.manifest.extent(v)), np.nan, v.dtype)
            for v in self.manifest.variables
        }

    def read_block(self, start: tuple[int, ...]) -> dict[str, NDArray[Any]] | None:
        """The arrays of a block as stored; None where a file is missing or cannot be decoded."""
        if not self.has_files(start):
            return None
        window, extent = self.window(start), self.manifest.extent
        try:
            return {
                v.name: np.ascontiguousarray(self.arrays[v.name][window]).reshape(-1, *extent(v))
                for v in self.manifest.variables
            }
        except (RuntimeError, ValueError, OSError):  # what the codecs raise on damaged bytes
            return None

    def write_block(self, start: tuple[int, ...], data: dict[str, NDArray[Any]]) -> None:
        """Store the arrays of a block; each file appears whole."""
        shape = tuple(w.stop - w.start for w in self.window(start))
        beyond = [(0, c - n) for n, c in zip(shape, self.manifest.chunk, strict=True)]  # at the grid's edge
        with disk_errors(self.path):
            for variable, path in zip(self.manifest.variables, self.chunk_files(start), strict=True):
                values = data[variable.name].reshape(*shape, *self.manifest.extent(variable))
                if shape != self.manifest.chunk:
                    inside = [(0, 0)] * len(variable.dims)
                    values = np.pad(values, beyond + inside, constant_values=layout.fill_value(variable))
                write_whole(path, layout.encode(values), is_synced=False)

    def remove_partial_files(self) -> None:
        """Remove what writers that were killed left half written."""
        for directory, _, names in os.walk(self.path):
            for name in names:
                if name.endswith(".partial"):
                    Path(directory, name).unlink(missing_ok=True)

    def pack(self, ledger: Ledger) -> None:
        """Write status and metrics of every case as arrays, unless the journals tell nothing new."""
        with disk_errors(self.path):
            if not self.is_packed():
                state = self._journal_state()
                for name, values in self.packed_values(ledger).items():
                    self.arrays[name][...] = values
                write_whole(self.private / "packed.json", state.encode())

    def packed_values(self, ledger: Ledger) -> dict[str, NDArray[Any]]:
        """Status and metrics as the packed arrays are to hold them."""
        if ledger.metrics is None:
            raise ValueError("a ledger replayed without metrics has none to pack")
        void = ~np.isin(ledger.status, (DONE, DIVERGED))
        shape = self.manifest.shape
        packed: dict[str, NDArray[Any]] = {"status": ledger.status.reshape(shape)}
        for variable in METRICS:
            values = ledger.metrics[variable.name].copy()
            values[void] = layout.fill_value(variable)
            packed[variable.name] = values.reshape(*shape, *self.manifest.extent(variable))
        return packed

    def is_packed(self) -> bool:
        """Whether the packed arrays tell all that the journals do."""
        try:
            return (self.private / "packed.json").read_text() == self._journal_state()
        except FileNotFoundError:
            return False

    def forget_packing(self) -> None:
        """Have the next run pack anew."""
        (self.private / "packed.json").unlink(missing_ok=True)

    def _journal_state(self) -> str:
        return json.dumps([[path.name, path.stat().st_size] for path in journals(self.journal_directory)])


def case_checksum(data: dict[str, NDArray[Any]], i_case: int) -> int:
    """CRC-32 of the stored arrays of one case of a block."""
    check = 0
    for values in data.values():
        check = layout.checksum(values[i_case], check)
    return check


def _remove_drafts(path: Path) -> None:
    """Remove what creations of this store on this host left behind when they were killed."""
    prefix, host = f".{path.name}.", socket.gethostname()
    for draft in path.parent.glob(f"{prefix}{host}.*.draft"):
        pid = draft.name.rsplit(".", 2)[1]
        if pid.isdigit() and process_state(int(pid)) is None:
            shutil.rmtree(draft, ignore_errors=True)
