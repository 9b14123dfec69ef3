"""What a claim is: a statement of the paper, what is expected of it, and the function that finds out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable


@dataclass(frozen=True)
class Finding:
    """What was found in the stores, in words, and whether it is what the claim expects."""

    found: str
    holds: bool


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One statement of the paper that a machine can check.

    Attributes
    ----------
    id : str
        "C10"; ids that begin with D are discrepancies within the paper.
    figure : str
        Of the paper, with its panels: "6b", or "Table 1".
    studies : tuple of str
        Whose stores `evaluate` takes, in this order.
    says : str
        The setting and the statement, in our words.
    expected : str
        What makes it hold.
    is_reported : bool
        Whether the finding is only reported, since the paper leaves its setting open or contradicts itself.
    evaluate : function
        Of one Dataset a study.
    """

    id: str
    figure: str
    studies: tuple[str, ...]
    says: str
    expected: str
    is_reported: bool
    evaluate: Callable[..., Finding]


def claim(
    name: str, figure: str, *studies: str, says: str, expected: str
) -> Callable[[Callable[..., Finding]], Claim]:
    """Return a decorator that makes a claim of the function that evaluates it."""

    def decorate(evaluate: Callable[..., Finding]) -> Claim:
        return Claim(
            id=name,
            figure=figure,
            studies=studies,
            says=says,
            expected=expected,
            is_reported=False,
            evaluate=evaluate,
        )

    return decorate


def report(
    name: str, figure: str, *studies: str, says: str, reason: str
) -> Callable[[Callable[..., str]], Claim]:
    """Return a decorator that makes a claim of a function; it is only reported, for the `reason` given."""

    def decorate(describe: Callable[..., str]) -> Claim:
        return Claim(
            id=name,
            figure=figure,
            studies=studies,
            says=says,
            expected=f"reported: {reason}",
            is_reported=True,
            evaluate=lambda *stores: Finding(describe(*stores), True),
        )

    return decorate
