"""How a run ended."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rubhpc.schema import DIVERGED, DONE, FAILED, INFERRED, MISSING, STATUS
from rubhpc.storage.duration import duration

if TYPE_CHECKING:
    from pathlib import Path


_LOST = 71


@dataclass(frozen=True, kw_only=True)
class Summary:
    """How a run ended.

    Attributes
    ----------
    counts : tuple of int
        Cases of the study, or of its part, that are missing, done, failed, diverged and inferred, in this
        order.
    computed : int
        Cases this run computed.
    seconds : float
        Duration of the run, s.
    reasons : tuple of (str, str)
        Coordinates and reason of each failed case, the first hundred.
    flawed : int
        Cases that are done with a remark: a poor energy balance, or a start at rest within a sweep.
    verdicts : str
        Regimes of the cases that are done, and how many had not settled or left the model's range.
    lost : int
        Ranks that died during the run; the others did their work.
    part : str
        Part of the study that was run, as "3/64"; "" for the whole study.
    n_elsewhere : int
        Cases of other parts that are missing.
    """

    store: Path
    counts: tuple[int, ...]
    computed: int
    seconds: float
    reasons: tuple[tuple[str, str], ...] = ()
    lost: int = 0
    flawed: int = 0
    verdicts: str = ""
    part: str = ""
    n_elsewhere: int = 0

    @property
    def name(self) -> str:
        """The store, and the part of the study."""
        return f"{self.store}: part {self.part}" if self.part else str(self.store)

    @property
    def exit_code(self) -> int:
        """0: every case has a result (a diverged one is a result); 1: some failed; 71: a rank was lost."""
        return 1 if self.counts[FAILED] else _LOST if self.lost else 0

    def text(self) -> str:
        """The summary in a line, and what the cases show in another."""
        states = [i for i in (DONE, FAILED, DIVERGED, INFERRED, MISSING) if self.counts[i]]
        counts = ", ".join(f"{self.counts[i]} {STATUS[i]}" for i in states)
        flaw = f"; {self.flawed} done with a remark, rubhpc status lists them" if self.flawed else ""
        rest = ""
        if self.part:
            missing = f"{self.n_elsewhere} cases of other parts are missing"
            rest = f"; {missing}" if self.n_elsewhere else "; no case of another part is missing"
        done = f"{counts or 'no cases'}; {self.computed} computed in {duration(self.seconds)}"
        shown = f"\n{self.verdicts}" if self.verdicts else ""
        return f"{self.name}: {done}{flaw}{rest}{shown}"

    def complaint(self) -> str:
        """What failed and how to proceed, in one line."""
        if not self.counts[FAILED]:
            lost = "a rank was lost" if self.lost == 1 else f"{self.lost} ranks were lost"
            return (
                f"{self.name}: {lost} during the run; the others finished the study, and no case is missing"
            )
        case, reason = self.reasons[0]
        rest = (
            f" and {self.counts[MISSING]} were not computed (--max-failures)" if self.counts[MISSING] else ""
        )
        return (
            f"{self.name}: {self.counts[FAILED]} of {sum(self.counts)} cases failed{rest}; "
            f"the first, {case}: {reason}; rubhpc status lists them, --retry-failed computes them again"
        )
