"""Cases that have been evaluated, kept on the disk: none is computed twice, whatever ends a run."""

from __future__ import annotations

import hashlib
import os
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.errors import InputError, reason_of
from rubhpc.identification.candidates import Outcome
from rubhpc.identification.comparison import Seen

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


class Evaluated:
    """Outcomes by the values of the open keys.

    Parameters
    ----------
    folder : Path or None
        For a file of each rank; all are read. None keeps nothing beyond the process.
    content : str
        All that outcomes depend on, except these values: others are in other files.
    like : Seen
        Features of the measured motion.
    n_value, n_stator : int
    rank : int
    """

    def __init__(
        self, folder: Path | None, content: str, like: Seen, n_value: int, n_stator: int, rank: int = 0
    ) -> None:
        self.folder, self._key = folder, hashlib.sha256(content.encode()).hexdigest()[:16]
        self._path = None if folder is None else folder / f"{self._key}.{rank}"
        self._found: dict[bytes, Outcome] = {}
        shape, kind = like.values.shape, "c16" if np.iscomplexobj(like.values) else "f8"
        self._type = np.dtype(
            [
                ("key", "f8", (n_value,)),
                ("status", "i4"),
                ("values", kind, shape),
                ("variance", "f8", shape),
                ("contact", "f8", (3, n_stator)),
            ]
        )
        self.read()

    def read(self) -> None:
        """Read what all ranks have kept; what a kill has cut short is left out."""
        if self.folder is None:
            return
        size = self._type.itemsize + 4
        for path in sorted(self.folder.glob(f"{self._key}.*")):
            whole = path.read_bytes()
            for start in range(0, len(whole) - size + 1, size):
                entry, check = whole[start : start + size - 4], whole[start + size - 4 : start + size]
                if zlib.crc32(entry).to_bytes(4, "little") != check:
                    break
                row: Any = np.frombuffer(entry, self._type)[0]
                seen = Seen(row["values"], row["variance"]).in_order()
                status = int(row["status"])
                has_seen = bool(np.isfinite(row["variance"]).all())
                self._found[row["key"].tobytes()] = Outcome(
                    status, seen if has_seen else None, *row["contact"]
                )

    def of(self, values: Floats) -> Outcome | None:
        """Return the outcome of these values, if it is known."""
        return self._found.get(np.asarray(values, dtype=float).tobytes())

    def keep(self, values: Floats, outcome: Outcome) -> None:
        """Keep an outcome."""
        values = np.asarray(values, dtype=float)
        self._found[values.tobytes()] = outcome
        if self._path is None:
            return
        row: Any = np.zeros(1, self._type)
        row["key"], row["status"] = values, outcome.status
        row["values"], row["variance"] = outcome.seen or (0.0, np.nan)
        row["contact"] = np.stack(outcome[2:])
        entry = row.tobytes()
        try:
            with self._path.open("ab") as file:
                # After a part of an entry nothing more would be read.
                end = file.seek(0, os.SEEK_END)
                if rest := end % (len(entry) + 4):
                    file.truncate(end - rest)
                file.write(entry + zlib.crc32(entry).to_bytes(4, "little"))
        except OSError as error:
            raise InputError(
                f"{self._path}: cannot be written ({reason_of(error, self._path)}); choose another --output"
            ) from None

    def __len__(self) -> int:
        return len(self._found)
