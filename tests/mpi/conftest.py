"""What this machine does not have is not collected."""

from __future__ import annotations

from running import LAUNCHERS

collect_ignore = [] if any(launcher.is_open_mpi for launcher in LAUNCHERS) else ["test_survivors.py"]
