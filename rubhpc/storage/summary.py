"""How a run ended."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.models import may_reverse
from rubhpc.schema import DIVERGED, DONE, FAILED, INFERRED, MISSING, REGIME, SETTLED, STATUS
from rubhpc.storage.duration import duration
from rubhpc.study.axes import meanings_of
from rubhpc.validity import MONITORS, STEADY_SLIP, counted

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from rubhpc.storage.manifest import Manifest

_LAW = "contact.friction_law"


def verdicts(manifest: Manifest, is_done: NDArray[np.bool_], measures: NDArray[np.void]) -> str:
    """Return the line; "" where nothing is known.

    Parameters
    ----------
    is_done : (n_case,)
        The cases that count.
    measures : (n_case,) record
        Those of the store.
    """
    known = measures.dtype.names or ()
    parts = []
    if "regime" in known:
        counts = [int((measures["regime"][is_done] == flag).sum()) for flag in range(len(REGIME))]
        named = [f"{n} {name.replace('_', ' ')}" for name, n in zip(REGIME, counts, strict=True) if n]
        parts += [", ".join(named)] if named else []
    if "settled" in known:
        n_moving = int((measures["settled"][is_done] == SETTLED.index("not_settled")).sum())
        parts += [f"{n_moving} not settled"] if n_moving or parts else []
    codes = np.zeros(manifest.n_case, np.int16)
    is_watched = False
    for i, (name, monitor) in enumerate(MONITORS.items()):
        if name in known:
            values = measures[name]
            is_out = monitor.is_out(values)
            is_out = is_done & (is_out.any(axis=1) if is_out.ndim > 1 else is_out)
            if name == STEADY_SLIP:
                is_out &= ~_may_reverse(manifest)
            codes |= np.int16(1 << i) * is_out
            is_watched |= bool(np.isfinite(values[is_done]).any())
    n_out = int(np.count_nonzero(codes))
    if is_watched:
        parts.append(f"{n_out} out of the model's range" + (f": {counted(codes)}" if n_out else ""))
    return "; ".join(parts)


def _may_reverse(manifest: Manifest) -> NDArray[np.bool_]:
    """Whether slip may reverse in a case, (n_case,): under every law but steady sliding."""
    for axis in manifest.axes:
        if axis.name == _LAW:
            reverses = np.array([may_reverse(law) for law in meanings_of(_LAW)])[np.array(axis.values, int)]
            lengths = [
                n if dim == axis.dimension else 1
                for dim, n in zip(manifest.dims, manifest.shape, strict=True)
            ]
            return np.broadcast_to(reverses.reshape(lengths), manifest.shape).ravel()
    law = manifest.parts.get("contact", {}).get("friction_law")
    return np.full(manifest.n_case, may_reverse(law))


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
