"""Compiled kernels for tests in parallel: compiled once, then a copy of the cache for each worker."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

ROOT = Path(__file__).parents[2]
KERNELS = ROOT / "rubhpc" / "kernels"
CACHES = ROOT / ".pytest_cache" / "kernels"
SCHEMES = (
    "events",
    "neighbours",
    "periodic",
    "run-up",
    "collocation",
    "central differences",
)


def compile_once() -> None:
    """Compile the kernels into the cache beside their sources, unless it is up to date."""
    stamp = CACHES / "compiled"
    if _is_current(stamp):
        return
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(Path(__file__).parent)])}
    environment.pop("NUMBA_CACHE_DIR", None)
    command = [sys.executable, __file__, *SCHEMES]
    if subprocess.run(command, env=environment, cwd=ROOT, check=False).returncode:
        raise SystemExit("the kernels could not be compiled")
    _mark(stamp)


def use(scheme: str) -> None:
    """Compute a short case that needs the kernels of a scheme."""
    from closed_form import periodic, run_up, simulate

    case = {"speed_ratio": 0.75, "transient": 1, "samples_per_revolution": 32}
    options = {
        "events": {},
        "collocation": {"normal": "updated"},
        "central differences": {"method": "central-difference"},
    }
    if scheme == "neighbours":
        _use_neighbours()
    elif scheme == "run-up":
        run_up("mokhtar2017", start="1500 rpm", stop="1600 rpm", time="0.1 s", clearance="0.1 mm")
    elif scheme == "periodic":
        periodic("mokhtar2017", **case, clearance_ratio=0.9)
    else:
        simulate("mokhtar2017", **case, clearance_ratio=0.7, revolutions=2, **options[scheme])


def _use_neighbours() -> None:
    import numpy as np
    from closed_form import Contact, read_rig

    from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
    from rubhpc.integrate.record import State
    from rubhpc.integrate.setup import prepare
    from rubhpc.study.study import Integrator

    shared = {"contact": Contact(), "integrator": Integrator(), "samples_per_revolution": 32}
    setup = prepare(read_rig("mokhtar2017"), 150.0, **shared)
    motion = PiecewiseMotion(setup, 1e-4, 0.3, State.at_rest(setup.model))
    motion.go_on(np.eye(2 * motion.n)[:, :1])


def use_own_cache(worker: str) -> None:
    """Make this process, and those it starts, use the cache of a worker; before numba is imported."""
    folder = CACHES / worker
    os.environ["NUMBA_CACHE_DIR"] = str(folder)
    if not _is_current(folder / "compiled"):
        shutil.rmtree(folder, ignore_errors=True)
        _copy_to(folder)
        _mark(folder / "compiled")


def _copy_to(folder: Path) -> None:
    """Copy the cache to where the kernels of a worker look for it."""
    shutil.copytree(KERNELS / "__pycache__", folder, ignore=shutil.ignore_patterns("*.pyc"))


def _sources() -> str:
    stats = [(path.name, path.stat()) for path in sorted(KERNELS.rglob("*.py"))]
    return repr(
        [sys.version, version("numba"), *((name, stat.st_mtime_ns, stat.st_size) for name, stat in stats)]
    )


def _is_current(stamp: Path) -> bool:
    return stamp.exists() and stamp.read_text() == _sources()


def _mark(stamp: Path) -> None:
    stamp.parent.mkdir(parents=True, exist_ok=True)
    stamp.write_text(_sources())


if __name__ == "__main__":
    for name in sys.argv[1:]:
        use(name)
    if not sys.argv[1:]:
        compile_once()
