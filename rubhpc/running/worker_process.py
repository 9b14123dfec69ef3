"""`python -m rubhpc.running.worker_process`: a worker of a run, started by `running.workers`."""

from __future__ import annotations

import sys

from rubhpc.errors import RubError
from rubhpc.running.stopping import Stopping
from rubhpc.running.workers import join


def main(arguments: list[str]) -> None:
    """Take part in the run until it ends; its parent reports to the user."""
    try:
        with Stopping() as stopping:  # before the imports below, which take a second
            pool = join(arguments)
            pool.part()(pool, stopping)
    except RubError as error:
        sys.exit(error.exit_code)


if __name__ == "__main__":
    main(sys.argv[1:])
