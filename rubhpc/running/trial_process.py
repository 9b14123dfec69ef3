"""`python -m rubhpc.running.trial_process`: computes one case, started by `running.trial`."""

from __future__ import annotations

import pickle
import sys
from contextlib import suppress

from rubhpc.running.workers import end_with


def main(parent: int) -> None:
    """Compute the case that the parent has written; an error of it is found again, and reported, there."""
    end_with(parent)
    study, case, state = pickle.load(sys.stdin.buffer)  # noqa: S301 - from the parent
    from rubhpc.running.case_setup import KeptSetups
    from rubhpc.running.worker import record_of
    from rubhpc.study.cases import CaseGrid

    with suppress(Exception):
        record_of(CaseGrid(study), case, KeptSetups(study), state)


if __name__ == "__main__":
    main(int(sys.argv[1]))
