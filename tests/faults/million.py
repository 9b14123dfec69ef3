"""A study of many cases with a stub in place of the physics; prints what it took, as JSON.

Run as `python million.py N_CASE FOLDER`. Times are of this process: other work on the machine does not count.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.rig.reading import read_rig
from rubhpc.running import case_setup, driver, job, plan, worker
from rubhpc.schema import DONE, case_measures
from rubhpc.storage.status import read_status
from rubhpc.study.axes import Axis
from rubhpc.study.study import Recording, Study

if TYPE_CHECKING:
    from collections.abc import Callable

measures = {v.name: np.ones(1) if "stator" in v.dims else 1 for v in case_measures()}
record = SimpleNamespace(
    status=DONE, reason="", remark="", signals={}, spectra={}, sections={}, measures=measures
)
stub = {
    "compile_kernels": lambda *_, **__: None,
    "run_case": lambda *_, **__: record,
    "prepare": lambda *_, **__: SimpleNamespace(model=None),
}


def peak_memory() -> float:
    """Most memory that this process has held, MB; what getrusage reports counts the one that started it."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.split("VmHWM:")[1].split()[0]) / 1000


for module in (case_setup, job, plan, worker):
    vars(module).update({name: value for name, value in stub.items() if name in vars(module)})


def axis(name: str, first: float, last: float, n: int) -> Axis:
    values = tuple(np.linspace(first, last, n).tolist())
    return Axis(name=name, dimension=name, unit="1", values=values, long_name=name)


def seconds(action: Callable[[], Any]) -> float:
    began = time.process_time()
    action()
    return time.process_time() - began


n_case, folder = int(sys.argv[1]), Path(sys.argv[2])
study = Study(
    title="many",
    rig=read_rig("mokhtar2017"),
    axes=(
        axis("speed_ratio", 0.9, 6, 10),
        axis("clearance_ratio", 0.5, 0.9, 100),
        axis("friction", 0.1, 0.5, n_case // 1000),
    ),
    recording=Recording(keep=()),
    output=folder / "many.zarr",
)
reported = {
    "plan": seconds(lambda: plan.make_plan(study)),
    "run": seconds(lambda: driver.run(study, quiet=True)),
    "plan_again": seconds(lambda: plan.make_plan(study)),
    "status": seconds(lambda: read_status(study.output)),
    "done": read_status(study.output).counts[DONE],
    "memory": peak_memory(),
}
print(json.dumps(reported))
