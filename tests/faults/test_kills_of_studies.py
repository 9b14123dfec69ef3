"""Studies of each kind are killed on their way, again and again, on workers and ranks: the bytes stay."""

from __future__ import annotations

import random
import time

import pytest
from running import run, start, stored_bytes
from study_texts import BRANCHES, RUN_UPS

from rubhpc.schema import INFERRED
from rubhpc.storage.status import read_status
from rubhpc.storage.verify import verify

DRIVES = """
rig = "mokhtar2017"
[drive]
start = "1500 rpm"
revolutions = 120
inertia = "0.02 kg m^2"
[grid]
"drive.torque" = ["-0.2 N m", "0.3 N m", "1 N m"]
clearance = ["60 um", "100 um", "5 mm"]
friction = [0.1, 0.2]
[contact]
normal = "fixed"
friction_law = "coulomb"
[override]
"stator.geometry" = "linear"
[record]
samples_per_revolution = 64
[run]
block = 1
"""
REFINED = """
rig = "mokhtar2017"
[grid]
speed_ratio = { start = 0.9, stop = 2.0, num = 9 }
clearance_ratio = [0.7, 0.85]
friction = { start = 0.0, stop = 0.4, num = 9 }
[contact]
model = "mokhtar2017"
[refine]
coarse = 4
[record]
transient = 5
revolutions = 2
samples_per_revolution = 32
keep = ["section"]
"""
SLABS = REFINED.replace("coarse = 4", 'coarse = 4\naxes = ["friction"]')
SLOW = """
[contact]
model = "mokhtar2017"
[integrator]
method = "central-difference"
step = "2 us"
[record]
transient = 20
revolutions = 2
samples_per_revolution = 32
keep = ["section"]
"""
CHAINS = f"""
rig = "mokhtar2017"
[grid]
speed_ratio = {{ values = [0.9, 1.2, 1.6, 2.0], sweep = "both" }}
clearance_ratio = [0.7, 0.85]
friction = 0.2
{SLOW}
[run]
block = 1
"""
SAMPLE = f"""
rig = "mokhtar2017"
[grid]
speed_ratio = {{ start = 4.0, stop = 5.0 }}
clearance_ratio = [0.7, 0.85]
friction = {{ start = 0.05, stop = 0.5, scale = "log" }}
{SLOW}
[sample]
method = "lhs"
n = 12
seed = 1
[run]
block = 3
"""
MORE_RUN_UPS = (
    RUN_UPS.replace('"0.5 s"]', '"0.5 s", "1.5 s"]')
    .replace('"5 mm"', '"120 um", "5 mm"')
    .replace("friction = 0.2", "friction = [0.1, 0.2]")
    .replace("block = 1", "block = 2")
)
KINDS = {
    "branches": BRANCHES.replace("[0.74, 0.75]", "[0.73, 0.74, 0.75, 0.76]"),
    "run_ups": MORE_RUN_UPS,
    "drives": DRIVES,
    "refined": REFINED,
    "slabs": SLABS,
    "chains": CHAINS,
    "sample": SAMPLE,
}


@pytest.mark.parametrize(
    ("kind", "options", "ranks"),
    [
        pytest.param(kind, *how, marks=[] if (kind, how[1]) == ("chains", 2) else [pytest.mark.long])
        for kind in KINDS
        for how in ((("--workers", "2"), 0), ((), 2))
    ],
)
def test_kills_leave_the_same_bytes(tmp_path, kind, options, ranks):
    whole, study, store = (tmp_path / name for name in ("whole.toml", "killed.toml", "killed.zarr"))
    for path in (whole, study):
        path.write_text(f'title = "killed"\noutput = "{path.with_suffix(".zarr")}"\n{KINDS[kind]}')
    began = time.monotonic()
    assert run(whole).returncode == 0
    taken = time.monotonic() - began
    moments = random.Random(3)
    n_killed = 0
    journals = store / ".rubhpc" / "journal"
    for _ in range(3):
        n_before = len(list(journals.glob("*.journal")))
        job = start(study, *options, ranks=ranks)
        while job.poll() is None and len(list(journals.glob("*.journal"))) == n_before:
            time.sleep(0.02)
        time.sleep(moments.uniform(0.0, 0.2) * taken)  # it computes since a journal of its own is there
        n_killed += job.poll() is None
        job.kill()
        job.communicate()
        time.sleep(1.0)
        assert not verify(store)
    assert n_killed
    assert run(study, *options, ranks=ranks).returncode == 0
    assert read_status(store).counts[INFERRED] > 0 or "refine" not in KINDS[kind]
    assert stored_bytes(store) == stored_bytes(tmp_path / "whole.zarr")
