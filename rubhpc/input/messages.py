"""Parts of one-line messages about an input: its place, its value in short, the word that was meant."""

from __future__ import annotations

import difflib
import re
from typing import TYPE_CHECKING

from rubhpc.errors import printable

if TYPE_CHECKING:
    from collections.abc import Iterable

LIKE = 0.6  # likeness of a word to the known one that was meant
SHORTEST_PART = 4  # letters of a part of a name, "velocity" of "vertical_velocity"


def place(file: str, table: str = "", key: str = "") -> str:
    """Return "file: [table] key", the start of a message about an input, on one line."""
    name = " ".join(p for p in (f"[{table[:80]}]" if table else "", key[:80]) if p)
    head = ": ".join(p for p in (file, name) if p)
    return printable(head)


def brief(value: object) -> str:
    """Return a value shortened for a one-line message."""
    text = (
        f'"{value}"'
        if isinstance(value, str)
        else str(value).lower()
        if isinstance(value, bool)
        else str(value)
    )
    text = printable(text)
    return text if len(text) <= 60 else f"{text[:56]} ..."


def nearest(word: str, known: Iterable[str]) -> str:
    """Return how to fix an unknown word: the known word most like it, or the whole list."""
    known = list(known)
    closest = max(known, key=lambda k: _likeness(word, k), default="")
    is_close = _likeness(word, closest) >= LIKE
    return f"did you mean {closest}?" if is_close else f"choose one of {', '.join(known)}"


def _likeness(word: str, known: str) -> float:
    """How like each other two words are, 0 to 1, in their letters or with a part of the name left out."""
    word, whole = word.lower(), known.lower()
    letters = difflib.SequenceMatcher(None, whole, word).ratio()
    if word and whole and (word in whole or whole in word):
        return max(letters, 0.75 + 0.2 * letters)
    parts = [part for part in re.split(r"[._]", whole) if len(part) >= SHORTEST_PART and part != whole]
    return max(letters, *(0.85 * difflib.SequenceMatcher(None, part, word).ratio() for part in parts), 0.0)


def quoted(words: Iterable[str]) -> str:
    """Return words as a list of a TOML file holds them, without its brackets."""
    return ", ".join(f'"{word}"' for word in words)
