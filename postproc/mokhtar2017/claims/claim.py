"""What a claim is, and results of claims as text, as the table of docs/claims.md, and as JSON."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from postproc.mokhtar2017.claims.cases import CaseFailed, Cases

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    import xarray as xr

HEAD = ("id", "figure", "claim", "expected", "found", "verdict")
_SHOWN = (0, 1, 5, 3, 4)  # the columns that a terminal has room for
_WIDTHS = (4, 9, 8)  # characters of the first three of them; the other two share what is left

_DOCUMENT = """\
# What the paper claims, checked by machine

M. A. Mokhtar, A. K. Darpe, K. Gupta, *Journal of Sound and Vibration* 401 (2017) 94-113, claim by claim
against the studies in `jobs/paper`. `rubhpc claims --document docs/claims.md` wrote this page after `make
paper` had run them; [gallery.md](gallery.md) shows the figures. `rubhpc claims` evaluates the same from
any stores of these studies, and exits with 1 when a claim fails.

By default: the packaged rig, friction 0.3, fixed normal, sliding friction, steady state. `r` is the spin
speed over the first lateral natural frequency, `g` the gap, `cg` the gap over the amplitude that the disc
would have at that speed without the stator. What the paper leaves open, or contradicts itself on, is
*reported* with what was found, and never counted as held or failed; ids that begin with D are such
discrepancies. Periods are in revolutions; "11/2 X" is a line at 11/2 of the spin frequency. Spectra are
taken over whole periods, from samples locked to the shaft.
"""
HOLDS, FAILS, REPORTED = "holds", "fails", "reported"


@dataclass(frozen=True)
class Claim:
    """A statement of the paper that a machine can check; ids with D are of discrepancies within it."""

    id: str
    figure: str  # of the paper, with its panels: "6b", or "Table 1"
    cases: Cases | tuple[Cases, ...]
    says: str  # the setting and the statement, in our words
    expected: str  # what makes it hold, or why it is only reported
    quantity: Callable[..., Any]  # of one Dataset each of `cases`; a tuple becomes the arguments below
    found: Callable[..., str]  # writes the quantity
    holds: Callable[..., bool] | None = None  # none of a claim whose setting the paper leaves open

    @property
    def is_reported(self) -> bool:
        """Whether the finding is only reported."""
        return self.holds is None

    @property
    def studies(self) -> tuple[str, ...]:
        """The studies whose stores are needed."""
        return tuple(dict.fromkeys(cases.study for cases in self._cases))

    @property
    def figures(self) -> list[int]:
        """The numbers of the figures that the claim is on; none for a table's."""
        if self.figure.startswith("Table"):
            return []
        return [int(part.strip(" abcdefgh")) for part in self.figure.split(",") if part.strip(" abcdefgh")]

    @property
    def _cases(self) -> tuple[Cases, ...]:
        return self.cases if isinstance(self.cases, tuple) else (self.cases,)

    def evaluate(self, stores: Mapping[str, xr.Dataset]) -> Result:
        """Return what is found in the stores; a claim on a case that failed or diverged fails."""
        try:
            quantity = self.quantity(*(cases.of(stores) for cases in self._cases))
        except CaseFailed as failed:
            return Result(self, str(failed), REPORTED if self.is_reported else FAILS)
        values = quantity if isinstance(quantity, tuple) else (quantity,)
        if self.holds is None:
            return Result(self, self.found(*values), REPORTED)
        return Result(self, self.found(*values), HOLDS if self.holds(*values) else FAILS)


@dataclass(frozen=True)
class Result:
    """A claim, what was found in the stores, in words, and the verdict."""

    claim: Claim
    found: str
    verdict: str


def rows(results: Iterable[Result]) -> list[tuple[str, ...]]:
    """Return a row a claim, of texts."""
    return [(r.claim.id, r.claim.figure, r.claim.says, r.claim.expected, r.found, r.verdict) for r in results]


def counts(results: Iterable[Result]) -> str:
    """Return how many claims hold, fail and are reported, in words."""
    counts = Counter(r.verdict for r in results)
    words = {HOLDS: "hold", FAILS: "fail", REPORTED: "are reported"}
    return ", ".join(f"{counts[verdict]} {word}" for verdict, word in words.items() if counts[verdict])


def text(results: Sequence[Result], width: int) -> str:
    """Return the results as a table for a terminal of some width, its cells wrapped."""
    room = max(width - sum(_WIDTHS) - 2 * len(_WIDTHS) - 2, 40)
    widths = (*_WIDTHS, 2 * room // 5, room - 2 * room // 5)
    lines = []
    for row in [HEAD, *rows(results)]:
        cells = [wrap(row[column], size) or [""] for column, size in zip(_SHOWN, widths, strict=True)]
        for i in range(max(map(len, cells))):
            parts = (cell[i] if i < len(cell) else "" for cell in cells)
            lines.append("  ".join(f"{p:<{w}}" for p, w in zip(parts, widths, strict=True)).rstrip())
    return "\n".join([*lines, counts(results)])


def document_of(results: Sequence[Result]) -> str:
    """Return the results as a page of the documents."""
    table = [HEAD, ("---",) * len(HEAD), *rows(results)]
    lines = (f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |" for row in table)
    return f"{_DOCUMENT}\nOf {len(results)} claims {counts(results)}.\n\n{chr(10).join(lines)}\n"


def as_json(results: Sequence[Result]) -> str:
    """Return the results as a JSON list of objects."""
    found = [dict(zip(HEAD, row, strict=True)) for row in rows(results)]
    return json.dumps(found, ensure_ascii=False, indent=1)
