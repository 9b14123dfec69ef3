"""What a claim is: a statement of the paper, a quantity of stored cases, and what the quantity has to be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from postproc.mokhtar2017.claims.cases import CaseFailed, Cases

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import xarray as xr

HOLDS, FAILS, REPORTED = "holds", "fails", "reported"


@dataclass(frozen=True)
class Claim:
    """One statement of the paper that a machine can check.

    Attributes
    ----------
    id : str
        "C10"; ids that begin with D are discrepancies within the paper.
    figure : str
        Of the paper, with its panels: "6b", or "Table 1".
    cases : Cases or tuple of Cases
        Those whose quantity is taken.
    says : str
        The setting and the statement, in our words.
    expected : str
        What makes it hold; or why it is only reported, since the paper leaves its setting open or contradicts
        itself.
    quantity : function
        Of one Dataset each of `cases`; a tuple of values becomes the arguments of `found` and `holds`.
    found : function
        Writes the quantity.
    holds : function, optional
        Whether the quantity is what is expected; none of a claim that is only reported.
    """

    id: str
    figure: str
    cases: Cases | tuple[Cases, ...]
    says: str
    expected: str
    quantity: Callable[..., Any]
    found: Callable[..., str]
    holds: Callable[..., bool] | None = None

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
