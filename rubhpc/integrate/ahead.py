"""A second process that compiles the kernels a case needs last, while the first compiles those needed first.

They share the cache on the disk: each loads what the other has compiled. The kernels that follow a motion for
the proof of its period share only the events with those that march through transient and record.
"""

from __future__ import annotations

import atexit
import fcntl
import gc
import os
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numba

from rubhpc.children import command, environment
from rubhpc.integrate.marches.closed_form import closed_form_march
from rubhpc.integrate.marches.friction import FrictionMarch
from rubhpc.integrate.measuring.samples import new_accumulator
from rubhpc.integrate.modal_setup import ModalSetup
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
from rubhpc.integrate.periodic_motions.shooting import shoot
from rubhpc.integrate.record import State
from rubhpc.integrate.scheme import Scheme
from rubhpc.integrate.setup import prepare
from rubhpc.kernels._jit import cache_of, plain
from rubhpc.kernels.force_average import add_force
from rubhpc.kernels.laws import FRICTION_LAWS, is_penalty
from rubhpc.kernels.shooting import search_period
from rubhpc.rig.reading import read_rig
from rubhpc.study.study import Contact, Integrator

if TYPE_CHECKING:
    from rubhpc.integrate.setup import Setup

_asked: set[type] = set()  # marches
_SOFT = {"law": "penalty", "stiffness": 1e8, "damping": 0.0}


def compile_ahead(setup: Setup) -> None:
    """Compile the kernels of periodic motions in a second process, if a cache lacks them.

    There is at most one such process per cache, and none with one processor or without an interpreter to
    start. Kernels that it has not compiled are compiled here when they are needed.
    """
    if not isinstance(setup, ModalSetup) or setup.scheme is not Scheme.EVENT_DRIVEN:
        return
    march = closed_form_march(setup)
    if march in _asked:
        return
    _asked.add(march)
    kernels = (search_period, march.take_change)[: 1 + issubclass(march, FrictionMarch)]
    is_known = all(cache_of(kernel).exists() for kernel in kernels)
    if not is_known and len(os.sched_getaffinity(0)) > 1 and Path(sys.executable).stem.startswith("python"):
        with suppress(OSError):  # another process has the lock, or no process can be started
            _start(FRICTION_LAWS[setup.law.friction_law], is_soft=plain(is_penalty)(setup.law))


def _start(friction_law: str, *, is_soft: bool) -> None:
    """Start the process. It holds the lock, and ends with this process, which holds its input."""
    path = cache_of(search_period).parent / "ahead.lock"
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        started = subprocess.Popen(
            command(__name__, friction_law, *(["soft"] if is_soft else [])),
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=environment(NUMBA_CACHE_DIR=numba.config.CACHE_DIR),  # type: ignore[attr-defined]
            pass_fds=[lock.fileno()],
        )
    atexit.register(_end, started)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End the process; the cache never contains a partial kernel."""
    process.kill()
    process.communicate()


def _compile(friction_law: str, *, is_soft: bool) -> None:
    """Compile the kernels that follow a motion from event to event, on a rotor without contact.

    Under set-valued friction an event has its own kernel. The kernels that the march needs last are compiled
    first: both processes then end at about the same time.
    """
    seen = new_accumulator(1)
    add_force(0, 0.0, 0.0, 0.0, 0.0, 0.0, seen.origin, seen.force_piece, seen.force_held, seen.peak_force)
    contact = Contact(friction_law=friction_law, **(_SOFT if is_soft else {}))  # type: ignore[arg-type]
    setup = prepare(
        read_rig("mokhtar2017"), 150.0, contact=contact, integrator=Integrator(), samples_per_revolution=32
    )
    assert isinstance(setup, ModalSetup)
    motion = PiecewiseMotion(setup, 1.0, 0.3, State.at_rest(setup.model))
    if motion.has_states:
        motion.march.change(motion.states, 1, 0.0, motion.start.copy())
    shoot(motion, motion.start, motion.states, 1)


def _end_with_parent() -> None:
    sys.stdin.buffer.read()
    os._exit(1)


if __name__ == "__main__":
    gc.disable()  # the process ends before it needs the memory
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _compile(sys.argv[1], is_soft="soft" in sys.argv[2:])
