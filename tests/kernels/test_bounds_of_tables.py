"""Kernels as plain Python, where an index beyond the end of a table is an error, give the same numbers."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

CASES = """
import json, sys
import numpy as np
from trial_rig import trial_rig

from rubhpc.kernels import case_progress

np.seterr(all="ignore")
if sys.argv[1] == "plain":  # attributes of records, which numba has by itself
    case_progress.bare = lambda progress: progress

from rubhpc import run_up, simulate
from rubhpc.integrate.reduced_model import mode_library

law = json.loads(sys.argv[2])
case = {"clearance": 4e-5, "friction": 0.2, "samples_per_revolution": 64} | law
found = []
for mode_library.FEW_PAIRS in (5, 2):  # many pairs have tables of few levels
    record = simulate(trial_rig(3), speed=170.0 + mode_library.FEW_PAIRS, transient=1, revolutions=1, **case)
    found += [*record.peak_contact_force, *record.contact_impulse, *record.friction_work]
rise = run_up(trial_rig(1), start=165.0, stop=175.0, time=0.08, **case)
found += [float(rise["peak_contact_force"].max()), float(rise["friction_work"].sum())]
print(json.dumps(found))
"""
LAWS = [{}, {"law": "penalty", "stiffness": 1e6, "friction_law": "coulomb"}]  # closed form, collocation


@pytest.mark.parametrize("law", LAWS, ids=lambda law: " ".join(map(str, law.values())))
def test_no_kernel_reads_beyond_its_tables(law):
    support = str(Path(__file__).parents[1] / "support")
    found = {}
    for way, switch in (("compiled", "0"), ("plain", "1")):
        environment = os.environ | {"NUMBA_DISABLE_JIT": switch, "PYTHONPATH": support}
        done = subprocess.run(
            [sys.executable, "-c", CASES, way, json.dumps(law)],
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr[-2000:]
        found[way] = json.loads(done.stdout)
    assert any(found["plain"])
    assert found["plain"] == pytest.approx(found["compiled"], rel=1e-6)
