"""Status of a store from its manifest, journals and lock; works during a run."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.schema import DIVERGED, DONE, FAILED, MISSING, STATUS
from rubhpc.storage.disk import disk_errors
from rubhpc.storage.duration import duration
from rubhpc.storage.journal import count, replay
from rubhpc.storage.lock import is_alive, read_holder
from rubhpc.storage.manifest import PRIVATE, Manifest

if TYPE_CHECKING:
    from pathlib import Path

    from rubhpc.storage.lock import Holder

_SHOWN = 10  # failed cases named


@dataclass(frozen=True, kw_only=True)
class StoreStatus:
    """How a store stands.

    Attributes
    ----------
    counts : tuple of int
        Cases that are missing, done, failed and diverged, in this order.
    holder : Holder or None
        Who computes now.
    n_recent : int
        Cases journalled by the latest run.
    failures : tuple of (str, str)
        Id, coordinates and reason of each failed or diverged case, or of one whose result has a flaw.
    """

    title: str
    counts: tuple[int, ...]
    holder: Holder | None
    n_recent: int
    n_damaged: int
    failures: tuple[tuple[str, str], ...]

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
            + ", ".join(f"{self.counts[i]} {STATUS[i]}" for i in (DONE, FAILED, DIVERGED, MISSING)),
        ]
        if self.holder is not None:
            left = self.seconds_left
            lines.append(
                f"running: {self.holder}, {self.n_recent} cases so far"
                + (f", {duration(left)} left" if left is not None else "")
            )
        elif self.counts[MISSING]:
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
        ledger = replay(path / PRIVATE / "journal", manifest.header, with_measures=False)
    troubled = {*np.flatnonzero((ledger.status == FAILED) | (ledger.status == DIVERGED)).tolist()}
    return StoreStatus(
        title=manifest.title,
        counts=count(ledger.status),
        holder=holder,
        n_recent=ledger.n_recent,
        n_damaged=ledger.n_damaged,
        failures=tuple(
            (
                f"{manifest.case_id(i)[:12]} {manifest.name_case(i)}: {STATUS[ledger.status[i]]}",
                ledger.reasons.get(i, ""),
            )
            for i in sorted(troubled | ledger.reasons.keys())
        ),
    )
