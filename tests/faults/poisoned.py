"""The program with something wrong in it, or with its cases counted.

Run as `python poisoned.py MODE STUDY...`, where MODE is one of

- cases: friction 0.3 raises, 0.5 never ends, 0.7 yields what is no number;
- segfault, killed: friction 0.3 ends its process by a fatal signal, by SIGKILL as for want of memory;
- stuck: friction 0.3 never comes back to be asked whether its time is over;
- rank1, exit1: the second rank has a slip in the program itself, or calls `sys.exit()`;
- counted: every case that has been computed is a line in the file COUNT.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

from rubhpc.running.launch import end_with_launcher, launch

end_with_launcher()  # before what takes long, as the command does

from rubhpc.cli import main  # noqa: E402
from rubhpc.running import worker  # noqa: E402

FOLDER = Path(__file__).with_name("poison")
mode = sys.argv.pop(1)


def slip(*_: Any) -> None:
    if mode == "exit1":
        sys.exit()
    raise LookupError("a slip")


if mode not in ("rank1", "exit1"):
    # Processes that this one starts find `sitecustomize` in the folder, which poisons them too.
    os.environ["POISON"] = mode
    os.environ["PYTHONPATH"] = os.pathsep.join([str(FOLDER), os.environ.get("PYTHONPATH", "")])
    sys.path.insert(0, str(FOLDER))
    import poison

    poison.install(mode)
    worker.PATIENCE = 1.0
elif launch().rank == 1:
    worker.Worker.work = slip  # type: ignore[method-assign]
main()
