"""Counts the revolutions that are followed after records, for exponents and periodic motions."""

from __future__ import annotations

_followed = [0]


def n_followed() -> int:
    """Revolutions that this process has followed after records so far; of two motions, those of both."""
    return _followed[0]


def count_followed(n_revolution: int) -> None:
    """Add to `n_followed`."""
    _followed[0] += n_revolution
