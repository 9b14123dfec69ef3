"""Arguments and options that several commands take, and numbers as people and JSON write them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

STUDY = click.argument("study", metavar="STUDY.toml", type=click.Path(path_type=Path))
TRUST_STUDY = click.option(
    "--trust-rig", is_flag=True, help='Run the Python code of a study whose rig is "FILE.py:FUNCTION".'
)
WORKERS = click.option(
    "--workers", type=click.IntRange(min=1), default=1, show_default=True, help="Processes of this machine."
)
SEED = click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True)


def quantity(text: str, unit: str, option: str) -> float:
    """Return the value of an option in `unit`: plain numbers are SI, other text has its unit ("1800 rpm").

    InputError where it has none.
    """
    from rubhpc.input.quantity import parse_quantity

    try:
        number: float | str = float(text)
    except ValueError:
        number = text
    return float(parse_quantity(number, unit, option))


def plain_number(value: Any) -> Any:
    """Return a value, or each of a list, for JSON, which has no infinity and no NaN: None."""
    if isinstance(value, list):
        return [plain_number(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
