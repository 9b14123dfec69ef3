"""Status of a store from its manifest, journals and lock; works during a run."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.errors import printable
from rubhpc.schema import DIVERGED, DONE, FAILED, INFERRED, MISSING, STATUS
from rubhpc.storage.disk import disk_errors
from rubhpc.storage.duration import duration
from rubhpc.storage.ledger import count, replay
from rubhpc.storage.lock import is_alive, read_holder
from rubhpc.storage.manifest import PRIVATE, Manifest
from rubhpc.storage.parts import Parts
from rubhpc.storage.refined import status_of
from rubhpc.storage.summary import verdicts

if TYPE_CHECKING:
    from pathlib import Path

    from rubhpc.storage.ledger import Ledger
    from rubhpc.storage.lock import Holder

_SHOWN = 10  # failed cases named
_MOST_BYTES = 10**8  # of measures that are read for the verdicts; of larger stores only a run states them


@dataclass(frozen=True, kw_only=True)
class PartStatus:
    """How a part of a study stands.

    Attributes
    ----------
    n_case, n_missing : int or None
        Cases of the part, and those without an outcome; None where the shares are not known.
    holder : Holder or None
        Who computes it now.
    n_recent : int
        Cases that its present run has journalled.
    """

    number: int
    count: int
    n_case: int | None = None
    n_missing: int | None = None
    holder: Holder | None = None
    n_recent: int = 0

    def text(self) -> str:
        """A part that is being computed, in a line."""
        text = f"running: {self.holder}, {self.n_recent} cases so far"
        if self.holder is None or self.n_missing is None:
            return text
        pace = (time.time() - self.holder.since) / self.n_recent if self.n_recent else None
        left = "" if pace is None else f", {duration(pace * self.n_missing)}"
        return f"{text}, {self.n_missing} of {self.n_case} left{left}"


@dataclass(frozen=True, kw_only=True)
class StoreStatus:
    """How a store stands.

    Attributes
    ----------
    counts : tuple of int
        Cases that are missing, done, failed, diverged and inferred, in this order.
    holder : Holder or None
        Who computes now.
    parts : tuple of PartStatus
        Parts of the study that are computed apart; all of them, where their shares are known.
    n_recent : int
        Cases journalled by the latest run.
    verdicts : str
        Regimes of the cases that are done, and how many had not settled or left the model's range; "" of a
        large store.
    failures : tuple of (str, str)
        Id, coordinates and reason of each failed or diverged case, or of one whose result has a flaw.
    """

    title: str
    counts: tuple[int, ...]
    holder: Holder | None
    n_recent: int
    n_damaged: int
    failures: tuple[tuple[str, str], ...]
    parts: tuple[PartStatus, ...] = ()
    verdicts: str = ""

    @property
    def seconds_left(self) -> float | None:
        """At the pace of the run that is on; None where there is none, or none known yet."""
        if self.holder is None or not self.n_recent:
            return None
        return (time.time() - self.holder.since) / self.n_recent * self.counts[MISSING]

    def text(self) -> str:
        """The status for people, a few lines."""
        n_case = sum(self.counts)
        lines = [
            self.title,
            f"{n_case} cases: "
            + ", ".join(
                f"{self.counts[i]} {STATUS[i]}"
                for i in (DONE, FAILED, DIVERGED, *((INFERRED,) if self.counts[INFERRED] else ()), MISSING)
            ),
        ]
        lines += [self.verdicts] if self.verdicts else []
        if self.holder is not None:
            left = self.seconds_left
            lines.append(
                f"running: {self.holder}, {self.n_recent} cases so far"
                + (f", {duration(left)} left" if left is not None else "")
            )
        lines += _parts_in_lines(self.parts)
        is_running = self.holder is not None or any(part.holder is not None for part in self.parts)
        if self.counts[MISSING] and not is_running:
            lines.append("no run is active; run the study again to compute what is missing")
        if self.n_damaged:
            lines.append(f"{self.n_damaged} damaged lines in the journals were skipped")
        lines += [f"  {case}: {reason}" for case, reason in self.failures[:_SHOWN]]
        if len(self.failures) > _SHOWN:
            lines.append(f"  and {len(self.failures) - _SHOWN} more")
        return "\n".join(lines)


def read_status(path: Path) -> StoreStatus:
    """How the store at `path` stands.

    Raises
    ------
    StoreError
        There is no store.
    """
    manifest = Manifest.read(path)
    lock = path / PRIVATE / "lock"
    with disk_errors(path):
        holder = read_holder(lock)
        if holder is not None and not is_alive(holder, lock):
            holder = None
        header = manifest.header
        is_read = manifest.refine is not None or manifest.n_case * header.record_type.itemsize <= _MOST_BYTES
        ledger = replay(path / PRIVATE / "journal", header, with_measures=is_read)
        is_done, measures = ledger.status == DONE, ledger.measures
        ledger.status = status_of(manifest, ledger.status, ledger.measures)
        parts = _read_parts(path, manifest, ledger)
    troubled = {*np.flatnonzero((ledger.status == FAILED) | (ledger.status == DIVERGED)).tolist()}
    return StoreStatus(
        parts=parts,
        title=manifest.title,
        counts=count(ledger.status),
        verdicts="" if measures is None else verdicts(manifest, is_done, measures),
        holder=holder,
        n_recent=ledger.n_recent,
        n_damaged=ledger.skipped.total(),
        failures=tuple(
            (
                f"{manifest.case_id(i)[:12]} {manifest.name_case(i)}: {STATUS[ledger.status[i]]}",
                printable(ledger.reasons.get(i, "")),
            )
            for i in sorted(troubled | ledger.reasons.keys())
        ),
    )


def _read_parts(path: Path, manifest: Manifest, ledger: Ledger) -> tuple[PartStatus, ...]:
    """How the parts stand: those that are being computed, and the others where the shares are known."""
    parts = Parts(path)
    holders = {int(holder.part.partition("/")[0]): holder for holder in parts.running()}
    shares = parts.read_shares(manifest)
    if shares is None:
        return tuple(
            PartStatus(
                number=number,
                count=int(holder.part.partition("/")[2]),
                holder=holder,
                n_recent=ledger.n_lines[holder.run],
            )
            for number, holder in sorted(holders.items())
        )
    owner = shares.of_cases(manifest)
    n_case, n_missing = (
        np.bincount(of, minlength=shares.count + 1).tolist()
        for of in (owner, owner[ledger.status == MISSING])
    )
    return tuple(
        PartStatus(
            number=number,
            count=shares.count,
            n_case=n_case[number],
            n_missing=n_missing[number],
            holder=holders.get(number),
            n_recent=ledger.n_lines[holders[number].run] if number in holders else 0,
        )
        for number in range(1, shares.count + 1)
    )


def _parts_in_lines(parts: tuple[PartStatus, ...]) -> list[str]:
    """The parts for people: a line for each that runs, the first of them, and one for all."""
    running = [part for part in parts if part.holder is not None]
    lines = [part.text() for part in running[:_SHOWN]]
    if len(running) > _SHOWN:
        lines.append(f"and {len(running) - _SHOWN} more parts")
    known = [part for part in parts if part.n_missing is not None]
    if known:
        waiting = [part.number for part in known if part.n_missing and part.holder is None]
        n_complete = len(known) - len(waiting) - len(running)
        rest = f"; to be run: {_ranges(waiting)}" if waiting else ""
        lines.append(f"{len(known)} parts: {n_complete} complete, {len(running)} running{rest}")
    return lines


def _ranges(numbers: list[int]) -> str:
    """Ascending numbers as Slurm takes them: 1-3,7."""
    cuts = [i for i in range(1, len(numbers)) if numbers[i] != numbers[i - 1] + 1]
    runs = [numbers[i:j] for i, j in zip([0, *cuts], [*cuts, len(numbers)], strict=True)]
    return ",".join(str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs)
