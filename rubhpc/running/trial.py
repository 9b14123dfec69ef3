"""A suspect case is computed in a process of its own first: this one survives, and knows that it died alone.

After a SIGKILL nobody can say whether a case or a user ended the rank: a kill of launcher and ranks at once
leaves the same traces. A process whose parent outlives it was not part of such a kill.
"""

from __future__ import annotations

import pickle
import re
import signal
import subprocess
import tempfile
import time
from os import getpid
from typing import TYPE_CHECKING

from rubhpc.children import command, environment
from rubhpc.storage.in_progress import oom_kills

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from rubhpc.study.cases import Case
    from rubhpc.study.study import Study

_LOOK = 0.05  # s between looks at the process
_SETTLED = 1.0  # s until a kill of all processes has reached this one too


class CaseDied(Exception):  # noqa: N818 - becomes the reason of a failed case
    """A case has ended the process that computed it."""


def try_apart(study: Study, case: Case, state: NDArray[np.float64] | None, check: Callable[[], None]) -> None:
    """Compute a case in a process of its own, and drop the result.

    Parameters
    ----------
    study : Study
    case : Case
    state : (n_degree,) float, optional
        Stored state from which it starts.
    check : callable
        Called 20 times a second; what it raises ends the process.

    Raises
    ------
    CaseDied
        A signal ended the process, and this one goes on. An exit for any other reason proves nothing.
    """
    n_kill = oom_kills()
    with tempfile.TemporaryFile() as given, tempfile.TemporaryFile() as said:
        pickle.dump((study, case, state), given)
        given.seek(0)
        process = subprocess.Popen(
            command(f"{__package__}.trial_process", getpid()),
            stdin=given,
            stdout=subprocess.DEVNULL,
            stderr=said,
            env=environment(PYTHONFAULTHANDLER="1"),
            start_new_session=True,
        )
        try:
            while process.poll() is None:
                check()
                time.sleep(_LOOK)
        finally:
            process.kill()
            process.wait()
        if process.returncode < 0:
            time.sleep(_SETTLED)
            said.seek(0)
            fatal = re.search(r"Fatal Python error: (.*)", said.read().decode(errors="replace"))
            cause = (
                fatal[1].lower()
                if fatal
                else "killed, because the machine ran out of memory"
                if oom_kills() > n_kill
                else f"killed by {signal.Signals(-process.returncode).name}"
            )
            raise CaseDied(f"it ends the process that computes it: {cause}")
