"""Puts what is wrong into a process: see `poisoned.py`."""

from __future__ import annotations

import ctypes
import os
import signal
import time
from typing import Any

import numpy as np

from rubhpc.running import worker


def install(mode: str) -> None:
    run_case = worker.run_case

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

    worker.run_case = poisoned
