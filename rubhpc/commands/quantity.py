"""Quantities on the command line: a plain number is SI, other text carries its unit."""

from __future__ import annotations


def quantity(text: str, unit: str, option: str) -> float:
    """Return the value of an option in `unit`, such as "1800 rpm" in rad/s; InputError where it has none."""
    from rubhpc.input.quantity import parse_quantity

    try:
        number: float | str = float(text)
    except ValueError:
        number = text
    return float(parse_quantity(number, unit, option))
