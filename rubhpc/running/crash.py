"""Errors of the program itself: the traceback goes into a log file, the user gets one line."""

from __future__ import annotations

import os
import tempfile
import time
import traceback
from pathlib import Path

from rubhpc.errors import RubError
from rubhpc.running.launch import launch


class Crashed(RubError):  # noqa: N818 - the error that caused it is in the log
    """An error that is the program's own."""

    exit_code = 70


def crash(error: BaseException, directory: Path | None = None) -> Crashed:
    """Log the traceback of `error`, in `directory` or among the temporary files; what to raise instead."""
    name = f"rubhpc-crash-{time.strftime('%Y%m%d-%H%M%S')}-{os.getpid()}.log"
    try:
        is_there = directory is not None and directory.is_dir()
        log = (directory if directory is not None and is_there else Path(tempfile.gettempdir())) / name
        lines = "".join(traceback.format_exception(error))
        log.write_text(lines, encoding="utf-8", errors="backslashreplace")
        place = f"the traceback is in {log}"
    except OSError as trouble:
        place = f"its traceback could not be written ({trouble})"
    what = ": ".join(filter(None, (type(error).__name__, " ".join(str(error).split()))))
    return Crashed(f"rank {launch().rank}: {what}; {place}; please report it")
