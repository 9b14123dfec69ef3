"""The program with some cases poisoned: friction 0.3 raises, 0.5 never ends; or with a rank that slips.

Run as `python poisoned.py cases STUDY...` or `python poisoned.py rank1 STUDY...`.
"""

from __future__ import annotations

import sys
import time
from typing import Any

from rubhpc.cli import main
from rubhpc.running import worker
from rubhpc.running.launch import launch

run_case = worker.run_case


def poisoned(setup: Any, *, friction: float, check: Any, **rest: Any) -> Any:
    if friction == 0.3:
        raise ZeroDivisionError("a poisoned case")
    while friction == 0.5:
        time.sleep(0.05)
        check()
    return run_case(setup, friction=friction, check=check, **rest)


def slip(*_: Any) -> None:
    raise LookupError("a slip")


if sys.argv.pop(1) == "cases":
    worker.run_case = poisoned
elif launch().rank == 1:
    worker.Worker.work = slip  # type: ignore[method-assign]
main()
