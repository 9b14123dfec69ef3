"""Python processes that this one starts: of this very package, with one thread, and from no current folder.

Python would look for every module in the current folder first, `numpy.py` of a user included.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from rubhpc.threads import VARIABLES

SAFE_PATH = "PYTHONSAFEPATH"  # for what other packages start


def command(module: str, *arguments: object) -> list[str]:
    """Return the command that runs a module."""
    return [sys.executable, "-P", "-m", module, *map(str, arguments)]


def environment(**changes: str) -> dict[str, str]:
    """Return the environment of a process that runs a module of this package."""
    place = str(Path(__file__).parents[1])
    path = os.pathsep.join(filter(None, [place, os.environ.get("PYTHONPATH")]))
    return {**os.environ, **dict.fromkeys(VARIABLES, "1"), SAFE_PATH: "1", "PYTHONPATH": path, **changes}
