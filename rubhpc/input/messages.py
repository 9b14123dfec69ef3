"""Parts of one-line messages about an input: its place, its value in short, the word that was meant."""

from __future__ import annotations

import difflib
from typing import TYPE_CHECKING

from rubhpc.errors import printable

if TYPE_CHECKING:
    from collections.abc import Iterable


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
    close = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    if not close:  # letters aside, people leave a word out
        close = [k for k in known if word and (word.lower() in k.lower() or k.lower() in word.lower())][:1]
    return f"did you mean {close[0]}?" if close else f"choose one of {', '.join(known)}"


def quoted(words: Iterable[str]) -> str:
    """Return words as a list of a TOML file holds them, without its brackets."""
    return ", ".join(f'"{word}"' for word in words)
