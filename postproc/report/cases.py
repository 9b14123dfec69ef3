"""Records of single cases out of a store: block by block for a page, one by one for a server."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import numpy as np

from postproc.report.packing import pack_case
from postproc.store.attributes import table_of
from postproc.store.axes import axes_of
from postproc.store.rig_of_case import stator_places
from postproc.store.variables import LONG_ROLES
from rubhpc.schema import DONE, role_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import xarray as xr

    from postproc.report.packing import Detail

_READ_AT_ONCE = 64_000_000  # bytes
_SPARSE = 16  # cases read for each that is asked for, beyond which they are read one by one
_MOVED = re.compile(r"stator(\.\d+)?\.(angle|clearance_offset|node)|rotor\.clearance_from")


class Cases:
    """The cases of a store by their flat index in its grid; `done` are those that have a result."""

    def __init__(self, store: xr.Dataset) -> None:
        self._axes = axes_of(store)
        self._shape = tuple(store.sizes[a] for a in self._axes)
        kept = [n for n in map(str, store.data_vars) if role_of(n) in LONG_ROLES]
        self.kept = tuple(sorted({role_of(n) for n in kept}))
        if "waveform" in self.kept:  # of which spectra over whole periods are taken
            kept = [n for n in kept if role_of(n) != "spectrum"]
        self._arrays = store[[*kept, *(n for n in ("period",) if n in store)]]
        self.status = store["status"].values.ravel()
        self.done = np.flatnonzero(self.status == DONE)
        self._window = self._whole_chunks(store[kept]) if kept else [1] * len(self._axes)
        grid = table_of(store, "study").get("grid", {})
        is_set_about = "clearance_from" in table_of(store, "rig").get("rotor", {})
        self.stators_move = any(
            _MOVED.fullmatch(name) or (is_set_about and name.startswith("rotor.")) for name in grid
        )

    def has_record(self, flat: int) -> bool:
        """Whether there is anything to be read of a case."""
        return bool(self.kept) and 0 <= flat < self.status.size and self.status[flat] == DONE

    def record(self, flat: int, detail: Detail) -> bytes:
        """Return one case as `pack_case` packs it."""
        case = self._arrays.isel(dict(zip(self._axes, self._place(flat), strict=True)))
        return self._pack(case.compute(), detail)

    def records(self, flats: Iterable[int], detail: Detail) -> Iterator[tuple[int, bytes]]:
        """Yield cases with their flat index; those close to one another in the store are read at once."""
        blocks: dict[tuple[int, ...], list[int]] = {}
        for flat in flats:
            corner = tuple(i // n for i, n in zip(self._place(flat), self._window, strict=True))
            blocks.setdefault(corner, []).append(flat)
        for corner, members in blocks.items():
            if math.prod(self._window) > _SPARSE * len(members):
                yield from ((flat, self.record(flat, detail)) for flat in members)
                continue
            start = [c * n for c, n in zip(corner, self._window, strict=True)]
            window = {a: slice(s, s + n) for a, s, n in zip(self._axes, start, self._window, strict=True)}
            block = self._arrays.isel(window).compute()
            for flat in members:
                inside = (i - s for i, s in zip(self._place(flat), start, strict=True))
                yield flat, self._pack(block.isel(dict(zip(self._axes, inside, strict=True))), detail)

    def _whole_chunks(self, arrays: xr.Dataset) -> list[int]:
        """Return the cases along each axis that are read at once: chunks of the store, some at a time."""
        first = next(iter(arrays.data_vars.values()))
        window = [int(c[0]) for c in (first.chunks or ())[: len(self._axes)]] or [1] * len(self._axes)
        case_bytes = max(arrays.nbytes // max(math.prod(self._shape), 1), 1)
        for k in reversed(range(len(window))):
            room = _READ_AT_ONCE // (case_bytes * math.prod(window))
            window[k] *= max(1, min(room, math.ceil(self._shape[k] / window[k])))
        return window

    def _place(self, flat: int) -> tuple[int, ...]:
        return tuple(int(i) for i in np.unravel_index(flat, self._shape)) if self._shape else ()

    def _pack(self, case: xr.Dataset, detail: Detail) -> bytes:
        return pack_case(case, detail, stator_places(case) if self.stators_move else None)


def spread(flats: list[int], n: int) -> list[int]:
    """Return `n` of some cases, evenly spread over them."""
    if n >= len(flats):
        return flats
    return [flats[math.floor((i + 0.5) * len(flats) / n)] for i in range(n)]
