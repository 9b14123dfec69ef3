"""What `rubhpc plan` predicts against what a run takes, in processor time."""

import re
import resource
import subprocess

import pytest
from running import ROOT, command, environment

pytestmark = pytest.mark.bench

# Of one name each; `large_map`, two minutes of it, is `map` at another resolution.
STUDIES = (
    "quickstart",
    "cascade",
    "map",
    "sensitivity",
    "indicators",
    "hysteresis",
    "gravity",
    "basins",
    "run_up",
    "branches/chaos",
)
WORST = 1.5  # times as much or as little
FRICTION, SLIDING = 'friction_law = "coulomb"', 'friction_law = "sliding"'
SMALL = """
title = "Small"
rig = "{rig}"
output = "small.zarr"
[grid]
speed_ratio = {{ start = 0.8, stop = 3.0, step = 0.2 }}
clearance_ratio = [0.5, 0.7, 0.9]
friction = [0.1, 0.3]
[contact]
normal = "fixed"
{contact}
[override]
"stator.geometry" = "linear"
[record]
transient = 60
revolutions = 32
"""
CONTACTS = {
    "coulomb": FRICTION,
    "restitution": SLIDING + "\nrestitution = 0.5",
    "both": FRICTION + "\nrestitution = 0.5",
    "penalty": SLIDING + '\nlaw = "penalty"\nstiffness = 1e7',
    "ring of 8": SLIDING,
}


def processor_time(*arguments):
    """Seconds of a command, and what it prints."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command(*arguments), env=environment(), check=True, capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, done.stdout


def small_study(folder, name):
    rig = "mokhtar2017"
    if name == "ring of 8":
        text = (ROOT / "rubhpc" / "rigs" / "mokhtar2017.toml").read_text()
        rig = folder / "ring.toml"
        rig.write_text(text.replace("lateral = true", "lateral = true\ncount = 8"))
    path = folder / "small.toml"
    path.write_text(SMALL.format(rig=rig, contact=CONTACTS[name]))
    return path


@pytest.mark.parametrize("name", [*STUDIES, *CONTACTS])
def test_plan_predicts_the_processor_time_of_a_run(name, tmp_path, capsys):
    path = small_study(tmp_path, name) if name in CONTACTS else ROOT / "jobs" / f"{name}.toml"
    store = tmp_path / "store.zarr"
    _, out = processor_time("plan", path, "--output", store)
    found = re.search(r"steps, (\S+) core-hours", out)
    predicted = 3600.0 * float(found[1])
    taken, _ = processor_time(path, "--output", store, "--quiet")
    with capsys.disabled():
        print(f"\n{name:12} plan {predicted:6.1f} s, taken {taken:6.1f} s, ratio {predicted / taken:.2f}")
    assert taken / WORST < predicted < WORST * taken
