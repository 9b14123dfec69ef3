"""What of a store goes onto a page of limited size, and what is said of the rest."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from postproc.report.cases import spread
from postproc.report.packing import LEVELS, pack_floats
from postproc.report.page import Page, least_size, text_size
from rubhpc.errors import InputError, writing

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr

    from postproc.report.cases import Cases
    from postproc.report.packing import Detail

_NEEDED = ("status", "validity")  # without which a page shows nothing
_SHARE_OF_MEASURES = 0.5  # of the room for data, at most
_PILOTS = 24  # cases that are packed to estimate the size of all


@dataclass
class Load:
    """What a page is to carry, and notes on what is left out."""

    values: dict[str, bytes] = field(default_factory=dict)
    records: dict[int, bytes] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def write_report(store: xr.Dataset, path: Path, limit: float) -> Load:
    """Write a self-contained page of at most `limit` bytes, and return its content.

    Measures come first, the most asked for before the others. Of the rest every case gets the same share:
    as much detail as fits all of them, or, where the least detail does not, cases evenly spread. InputError
    where the limit is below what a page takes at least, or the file cannot be written.
    """
    page = Page(store)
    # Room for the notes on what is left out.
    room = limit - least_size(page) - 4096
    load = Load()
    room -= _load_measures(page, load, room, limit)
    _load_records(page, load, room)
    text = page.html(load.values, load.records, load.notes)
    with writing(path):
        path.write_text(text, encoding="utf-8")
    return load


def _load_measures(page: Page, load: Load, room: float, limit: float) -> int:
    """Load what fits, and return the bytes that it takes, with the description of each measure."""
    left_out = []
    used = 0
    described = {str(variable["name"]): len(json.dumps(variable)) for variable in page.measures.described()}
    for name in page.measures.names:
        packed = pack_floats(page.measures.values(name))
        size = text_size(packed) + described[name]
        share = room if name in _NEEDED or not page.cases.kept else room * _SHARE_OF_MEASURES
        if used + size <= share:
            load.values[name] = packed
            used += size
        elif name in _NEEDED:
            least = (limit - room + used + size) / 1e6 + 0.1
            raise InputError(
                f"--limit: {limit / 1e6:.3g} MB is too small for this store; give {least:.1f} MB or more, or "
                "open the store with rubhpc view"
            )
        else:
            left_out.append(page.measures.label(name).lower())
    if left_out:
        load.notes.append(f"Measures left out: {', '.join(left_out)}.")
    return used


def _load_records(page: Page, load: Load, room: float) -> None:
    cases = page.cases
    done = [int(i) for i in cases.done]
    if not cases.kept:
        load.notes.append(
            "Of cases that change speed the page shows measures and pictures over their revolutions."
            if page.is_run_up
            else "The store contains no waveforms, spectra or sections."
        )
        return
    if not done:
        return
    pilots = spread(done, _PILOTS)
    margin = 1.0 if pilots == done else 1.05  # the pilots give an estimate of the size
    for level in LEVELS:
        tried = dict(cases.records(pilots, level))
        each = margin * sum(map(text_size, tried.values())) / len(pilots)
        if each * len(done) <= room:
            break
    chosen = spread(done, max(0, int(room / each)))
    for flat, packed in tried.items() if chosen == pilots else cases.records(chosen, level):
        room -= text_size(packed)
        if room < 0:
            break
        load.records[flat] = packed
    _note(level, load, cases)


def _note(level: Detail, load: Load, cases: Cases) -> None:
    n_kept, n_done = len(load.records), len(cases.done)
    if n_kept:
        which = "all" if n_kept == n_done else f"{n_kept} of {n_done}"
        load.notes.append(f"On this page, of {which} cases with a result: {level.text(cases.kept)}.")
    if n_kept < n_done:
        load.notes.append(
            f"Left out to stay within the size: waveforms, spectra and sections of {n_done - n_kept} cases."
        )
