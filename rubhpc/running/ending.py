"""The end of a run on several processes: what one of them raises ends all, and is reported once."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from rubhpc.errors import RubError, StoppedEarly
from rubhpc.running.crash import crash
from rubhpc.running.pool import RankLost

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from rubhpc.running.pool import Pool


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
