"""Memory of this process, at its peak and now."""

from __future__ import annotations

import sys
from pathlib import Path

_STATUS = Path("/proc/self/status")
_NOW = "VmRSS:"
_PEAK = "VmHWM:"  # of the program itself: getrusage includes the process that started it


def peak_memory() -> float:
    """Peak memory of this process so far, bytes."""
    try:
        return 1024.0 * float(_STATUS.read_text().split(_PEAK)[1].split()[0])
    except (OSError, IndexError, ValueError):  # no Linux
        from resource import RUSAGE_SELF, getrusage

        return getrusage(RUSAGE_SELF).ru_maxrss * (1.0 if sys.platform == "darwin" else 1024.0)


def memory() -> float:
    """Memory of this process now, bytes; its peak where that is unknown."""
    try:
        return 1024.0 * float(_STATUS.read_text().split(_NOW)[1].split()[0])
    except (OSError, IndexError, ValueError):
        return peak_memory()
