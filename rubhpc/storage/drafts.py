"""Drafts of stores: each is built next to its place and renamed, so that no store is ever incomplete."""

from __future__ import annotations

import os
import shutil
import socket
from pathlib import Path

from rubhpc.storage.lock import process_space, process_state


def draft_of(path: Path) -> Path:
    """Where this process builds the store at a path, which has no link in it."""
    return path.with_name(f".{path.name}.{socket.gethostname()}.{process_space()}.{os.getpid()}.draft")


def remove_drafts(path: Path, *, is_made: bool = False) -> None:
    """Remove drafts of this store that killed processes left that would be seen; once it is made, all.

    A process that still writes one of those finds the store when it cannot rename its draft.
    """
    path = Path(os.path.realpath(path))
    prefix, host = f".{path.name}.", socket.gethostname()
    for name in os.listdir(path.parent):  # no pattern: a store's name may hold anything
        if name.startswith(f"{prefix}{host}.") and name.endswith(".draft"):
            space, _, pid = name[len(f"{prefix}{host}.") : -len(".draft")].rpartition(".")
            is_near = space in ("", process_space())
            state = process_state(int(pid)) if pid.isdigit() else None
            if pid.isdigit() and (is_made or (is_near and (state is None or state[0] in "ZX"))):
                shutil.rmtree(path.parent / name, ignore_errors=True)
