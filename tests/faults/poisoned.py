"""The program with something wrong in it, or with its cases counted.

Run as `python poisoned.py MODE STUDY...`, where MODE is one of

- cases: friction 0.3 raises, 0.5 never ends, 0.7 yields what is no number;
- segfault, killed: friction 0.3 ends its process by a fatal signal, by SIGKILL as for want of memory;
- stuck: friction 0.3 never comes back to be asked whether its time is over;
- rank1, exit1: the second rank has a slip in the program itself, or calls `sys.exit()`;
- counted: every case that has been computed is a line in the file COUNT.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time
from typing import Any

from rubhpc.running.launch import end_with_launcher, launch

end_with_launcher()  # before what takes long, as the command does

import numpy as np  # noqa: E402

from rubhpc.cli import main  # noqa: E402
from rubhpc.running import watchdog, worker  # noqa: E402

run_case = worker.run_case
mode = sys.argv.pop(1)


def poisoned(setup: Any, *, friction: float, check: Any, **rest: Any) -> Any:
    if mode == "cases":
        if friction == 0.3:
            raise ZeroDivisionError("a poisoned case")
        while friction == 0.5:
            time.sleep(0.05)
            check()
    elif friction == 0.3:
        if mode == "segfault":
            ctypes.string_at(0)
        if mode == "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        while mode == "stuck":
            time.sleep(1000)
    record = run_case(setup, friction=friction, check=check, **rest)
    if mode == "cases" and friction == 0.7:
        record.signals["torsion"] = record.signals["torsion"] * np.nan
    if mode == "counted":
        with open(os.environ["COUNT"], "a") as file:
            file.write("a case\n")
    return record


def slip(*_: Any) -> None:
    if mode == "exit1":
        sys.exit()
    raise LookupError("a slip")


if mode not in ("rank1", "exit1"):
    worker.run_case = poisoned
    watchdog.PATIENCE = 1.0
elif launch().rank == 1:
    worker.Worker.work = slip  # type: ignore[method-assign]
main()
