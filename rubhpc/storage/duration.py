"""Spans of time as people read them."""

from __future__ import annotations


def duration(seconds: float) -> str:
    """A span of time for people: 42 s, 3:05 min, 12:40 h, 3.1 d."""
    if seconds < 60:
        return f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes}:{rest:02d} min"
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d} h" if hours < 48 else f"{hours / 24:.1f} d"
