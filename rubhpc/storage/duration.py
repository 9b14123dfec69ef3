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


def span(least: float, most: float) -> str:
    """From one span of time, s, to another for people: 12 to 30 min."""
    for unit, size in (("s", 1.0), ("min", 60.0), ("h", 3600.0), ("d", 86400.0)):
        if most < 100.0 * size or unit == "d":
            break
    digits = 1 if least / size < 9.5 else 0
    return f"{least / size:.{digits}f} to {most / size:.{0 if most / size >= 9.5 else 1}f} {unit}"
