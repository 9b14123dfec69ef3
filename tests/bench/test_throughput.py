"""What a case costs by several integrators in one run on one core, and how far each is off; whole studies."""

import math
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from closed_form import read_rig, simulate
from rivals import STEP
from rivals import run as run_rival
from set_ups import prepared

import rubhpc
from rubhpc.integrate import case as case_module
from rubhpc.integrate.case import run_case
from rubhpc.integrate.marches import event_driven as event_driven_march
from rubhpc.integrate.periodic_motions import saltation
from rubhpc.rig.reading import with_keys
from rubhpc.study.study import Recording

pytestmark = pytest.mark.bench

PER_REVOLUTION, TRANSIENT, REVOLUTIONS = 256, 120, 64
CASES = {  # speed ratio, the stator's modulus (Pa), clearance (m)
    "r = 0.75, Es 3 GPa, g 84 um": (0.75, 3e9, 84e-6),
    "r = 2, Es 30 GPa, g 90 um": (2.0, 30e9, 90e-6),
}
LEAST = {"r = 0.75, Es 3 GPa, g 84 um": 1500, "r = 2, Es 30 GPa, g 90 um": 800}
DENSE_STEP_TIME = 1.45e-6  # s, of a dense compiled step on a quiet machine
FRICTION = 0.3
MAP = Path(__file__).parents[2] / "jobs" / "map.toml"


def set_up(rig, speed, **integrator):
    return prepared(rig, speed, samples=PER_REVOLUTION, **integrator)


def least(function, rounds):
    """Least wall time of some calls, s, and what the last returned."""
    times = []
    for _ in range(rounds):
        began = time.perf_counter()
        found = function()
        times.append(time.perf_counter() - began)
    return min(times), found


def error(found, known):
    """Root mean square distance over that of the known signal's fluctuation."""
    return float(np.sqrt(np.mean((found - known) ** 2)) / np.std(known))


@pytest.mark.parametrize("name", CASES)
def test_modal_case_against_what_else_there_is(benchmark, capsys, name):
    """The usual case of 120 and 64 revolutions; of slower integrators a part, and errors over the first two.

    "converged" is the modal scheme with every mode kept.
    """
    ratio, modulus, clearance = CASES[name]
    rig = with_keys(read_rig("mokhtar2017"), {"stator.youngs_modulus": modulus})
    speed = ratio * 2 * math.pi * 31.5596
    turn = 2 * math.pi / speed
    whole = (TRANSIENT + REVOLUTIONS) * turn
    beginning = Recording(transient=0, revolutions=2, keep=("waveform",))

    def case(setup, recording):
        return run_case(setup, clearance=clearance, friction=FRICTION, recording=recording)

    exact = case(set_up(rig, speed, accuracy=1e-12), beginning).vertical
    rows = {}  # s a simulated second, error

    setup = set_up(rig, speed)
    usual = Recording(transient=TRANSIENT, revolutions=REVOLUTIONS, keep=())
    off = error(case(setup, beginning).vertical, exact)
    seconds, _ = benchmark.pedantic(lambda: least(lambda: case(setup, usual), 20), rounds=1)
    rows["modal, set-up shared by a study"] = seconds / whole, off
    seconds, _ = least(lambda: simulate(rig, speed=speed, clearance=clearance, friction=FRICTION), 5)
    rows["modal, one rubhpc.simulate"] = seconds / whole, off

    central = set_up(rig, speed, method="central-difference", step=STEP)
    seconds, record = least(lambda: case(central, beginning), 2)
    rows["central difference"] = seconds / (2 * turn), error(record.vertical, exact)

    per_sample = math.ceil(turn / PER_REVOLUTION / STEP)
    step = turn / PER_REVOLUTION / per_sample
    n_step = 2 * PER_REVOLUTION * per_sample
    for label, is_compiled in (("dense central difference, numba", True), ("the same, plain NumPy", False)):
        seconds, vertical = run_rival(
            rig, speed, clearance, FRICTION, n_step, step=step, is_compiled=is_compiled
        )
        rows[label] = seconds / step, error(vertical[::per_sample], exact)

    modal_cost = rows["modal, set-up shared by a study"][0]
    lines = [
        f"\n{name}, {TRANSIENT} + {REVOLUTIONS} revolutions, one core",
        f"{'':34} {'s a simulated s':>16} {'cases a core-s':>15} {'ratio':>8} {'error':>9}",
    ]
    for label, (seconds, off) in rows.items():
        per_core, ratio = 1 / (seconds * whole), seconds / modal_cost
        lines.append(f"{label:34} {seconds:16.5f} {per_core:15.3f} {ratio:8.1f} {off:9.1e}")
    dense = rows["dense central difference, numba"][0]
    nominal = DENSE_STEP_TIME / STEP / modal_cost
    lines.append(f"dense step {dense * STEP * 1e6:.2f} us; against one of 1.45 us the ratio is {nominal:.0f}")
    with capsys.disabled():
        print("\n".join(lines))
    benchmark.extra_info |= {label: {"s a simulated second": s, "error": e} for label, (s, e) in rows.items()}
    assert max(off for _, off in rows.values()) < 1e-3
    assert nominal > LEAST[name]
    assert DENSE_STEP_TIME / STEP / rows["modal, one rubhpc.simulate"][0] > (700 if ratio < 1 else 300)


def test_whole_study_with_little_around_the_kernel(benchmark, capsys, tmp_path, monkeypatch):
    """The map of `jobs/map.toml`: cases a core-second, and what takes them."""
    inside = {"kernel": 0.0, "FFT": 0.0}

    def watched(function, name):
        def call(*given):
            began = time.process_time()
            found = function(*given)
            inside[name] += time.process_time() - began
            return found

        return call

    study = rubhpc.read_study(MAP, output=tmp_path / "map.zarr")
    small = replace(study, recording=Recording(transient=1, revolutions=1, keep=()))
    rubhpc.run(replace(small, output=tmp_path / "warm.zarr"), quiet=True)  # imports and compiles
    monkeypatch.setattr(event_driven_march, "advance", watched(event_driven_march.advance, "kernel"))
    monkeypatch.setattr(saltation, "carry_pieces", watched(saltation.carry_pieces, "kernel"))
    monkeypatch.setattr(case_module, "amplitude_spectrum", watched(case_module.amplitude_spectrum, "FFT"))
    began = time.process_time()
    summary = benchmark.pedantic(lambda: rubhpc.run(study, quiet=True), rounds=1)
    seconds = time.process_time() - began
    n_case = summary.computed
    outside = 1 - sum(inside.values()) / seconds
    with capsys.disabled():
        print(
            f"\n{n_case} cases of {TRANSIENT} + {REVOLUTIONS} revolutions, waveforms not kept:"
            f" {n_case / seconds:.0f} cases a core-second; kernel {inside['kernel'] / seconds:.0%},"
            f" FFT {inside['FFT'] / seconds:.0%}, all else {outside:.0%}"
        )
    benchmark.extra_info |= {"cases a core-second": n_case / seconds, "outside": outside}
    assert n_case == 1980
    assert n_case / seconds > 70
    assert outside < 0.3
