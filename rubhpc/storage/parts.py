"""Parts of a study that are computed apart, in one store: their locks, and which blocks each computes.

A part holds a lock of its own while it computes, and the store's lock for a moment as it begins and as it
ends. Whoever needs the store alone (a whole run, a growth, the last part) takes the store's lock and finds no
part at work. The shares are put down once, by the first part: predicted steps may differ in the last bit from
machine to machine, and a block that two parts computed would have two writers.
"""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING
from zlib import crc32

import numpy as np

from rubhpc.storage.disk import read_regular, remove, write_whole
from rubhpc.storage.lock import InUse, Lock, is_alive, read_holder
from rubhpc.storage.manifest import PARTS, PRIVATE

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from rubhpc.storage.lock import Holder
    from rubhpc.storage.manifest import Manifest
    from rubhpc.study.parts import Part

_SHARES = "shares.json"


class Shares:
    """Which part computes which block.

    Attributes
    ----------
    count : int
        Parts of the study.
    numbers : (n_block,) int32
        Of the part that computes each block, in C order of their places.
    """

    def __init__(self, count: int, numbers: NDArray[np.int32]) -> None:
        self.count, self.numbers = count, numbers

    def cases(self, number: int, manifest: Manifest) -> NDArray[np.bool_]:
        """Whether each case of the store belongs to a part, (n_case,)."""
        is_in: NDArray[np.bool_] = self.of_cases(manifest) == number
        return is_in

    def of_cases(self, manifest: Manifest) -> NDArray[np.int32]:
        """Number of the part of each case of the store, (n_case,)."""
        shape, chunk = manifest.shape, manifest.chunk
        numbers = self.numbers.reshape([-(-n // c) for n, c in zip(shape, chunk, strict=True)])
        for i, (n, c) in enumerate(zip(shape, chunk, strict=True)):
            numbers = np.take(numbers, np.arange(n) // c, axis=i)
        return numbers.ravel()


class Parts:
    """The parts of a study in the store at `path`."""

    def __init__(self, path: Path) -> None:
        self._store = path
        self._folder = path / PRIVATE / PARTS

    def running(self) -> list[Holder]:
        """The parts that are being computed, as far as can be seen from here."""
        paths = sorted(self._folder.glob("*.lock")) if self._folder.is_dir() else ()
        holders = ((path, read_holder(path)) for path in paths)
        return [holder for path, holder in holders if holder is not None and _is_alive(holder, path)]

    def lock(
        self, part: Part, run: int, on_loss: Callable[[], None] = lambda: None, heir_of: str = ""
    ) -> Lock:
        """The right to compute a part in a run, as a context; to be taken within `alone`.

        Raises
        ------
        InUse
            The part is being computed, or parts of another number of parts.
        """
        self._folder.mkdir(exist_ok=True)
        for other in self.running():
            if other.part.partition("/")[2] != str(part.total):
                raise InUse(
                    f"{self._store}: is being computed in other parts, by {other}; wait for it or stop it"
                )
        name = f"{part.number:06d}of{part.total:06d}.lock"
        return Lock(
            self._folder / name, on_loss, heir_of, part=str(part), run=run, what=f"{self._store}: part {part}"
        )

    def alone(
        self, part: Part, is_over: Callable[[], object], on_loss: Callable[[], None] = lambda: None
    ) -> Lock:
        """The store for this part alone for a moment, as a context; other parts' moments are waited for.

        Raises
        ------
        InUse
            A whole run is at work, or `is_over` while waiting.
        """
        path = self._store / PRIVATE / "lock"
        return Lock(path, on_loss, part=str(part), is_over=is_over)

    def read_shares(self, manifest: Manifest) -> Shares | None:
        """The shares as put down; None where they are absent, damaged, or of another grid."""
        try:
            check, _, text = read_regular(self._folder / _SHARES).partition(b"\n")
            content = json.loads(text)
            if check != b"%08x" % crc32(text) or content["grid"] != _grid(manifest):
                return None
            n_block = math.prod(-(-n // c) for n, c in zip(manifest.shape, manifest.chunk, strict=True))
            numbers = np.array(content["numbers"], np.int32)
            is_sound = numbers.shape == (n_block,) and isinstance(content["count"], int)
            return Shares(content["count"], numbers) if is_sound else None
        except (OSError, ValueError, TypeError, KeyError, OverflowError, RecursionError):
            return None

    def write_shares(self, shares: Shares, manifest: Manifest) -> None:
        """Put the shares down."""
        content = {"count": shares.count, "grid": _grid(manifest), "numbers": shares.numbers.tolist()}
        text = json.dumps(content).encode()
        write_whole(self._folder / _SHARES, b"%08x\n%s" % (crc32(text), text))

    def forget(self) -> None:
        """Forget the shares; needs the store's lock, and no part at work."""
        remove(self._folder)


def _is_alive(holder: Holder, path: Path) -> bool:
    try:
        return is_alive(holder, path)
    except FileNotFoundError:  # it has just ended
        return False


def _grid(manifest: Manifest) -> int:
    """A checksum of the grid and its blocks."""
    return crc32(json.dumps([manifest.header.grid, manifest.chunk], sort_keys=True).encode())
