"""The end of a run on several processes: what one of them raises ends all, and is reported once."""

from __future__ import annotations

import os
import tempfile
import time
import traceback
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rubhpc.errors import RubError, StoppedEarly
from rubhpc.running.launch import launch
from rubhpc.running.pool import RankLost

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rubhpc.running.pool import Pool


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


@contextmanager
def ended_together(pool: Pool, logs: Callable[[], Path | None] = lambda: None) -> Iterator[None]:
    """Context of what the processes of a pool do together, to its end.

    Parameters
    ----------
    pool : Pool
    logs : callable
        Folder for the traceback of an error of the program itself; among the temporary files without one.
    """
    try:
        yield
    except RankLost as lost:  # and no rank can continue
        pool.abort(lost.exit_code)
        raise
    except RubError:  # raised on all ranks alike
        pool.close()
        raise
    except BaseException as error:
        if pool.size == 1 and not isinstance(error, Exception):
            raise
        # The others wait for this rank. Where a launcher ends it with them, `abort` does not return.
        if isinstance(error, KeyboardInterrupt):
            met: RubError = StoppedEarly("interrupted; run the same command again")
        else:
            met = crash(error, logs())
        pool.abort(met.exit_code, str(met))
        raise met from error
    pool.close()
