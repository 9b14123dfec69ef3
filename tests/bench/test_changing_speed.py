"""What a run-up costs over as many revolutions at constant speeds, law by law, in processor time."""

import math
import time

import numpy as np
import pytest
from closed_form import Contact, read_rig
from equal_stators import in_ring
from overhung_pump import pump
from set_ups import prepared

from rubhpc.integrate.case import run_case
from rubhpc.integrate.changing_speed.case import record_run_up
from rubhpc.study.initial import CONTACT_FREE, Initial
from rubhpc.study.speed_law import SpeedLaw
from rubhpc.study.study import Recording
from rubhpc.threads import on_one_thread

pytestmark = pytest.mark.bench
RPM = math.pi / 30.0
SAMPLES = 256
CASE = {"clearance": 1e-4, "friction": 0.2, "initial": Initial(from_=CONTACT_FREE)}
STEADY = (1300, 1500, 1700, 1900, 2100, 2300)  # rpm, of the range of the run-up
PENALTY, COULOMB = {"law": "penalty", "stiffness": 1e6}, {"friction_law": "coulomb"}
LAWS = {"sliding": {}, "Coulomb": COULOMB, "penalty": PENALTY, "Coulomb, penalty": COULOMB | PENALTY}
LAWS["updated normal"] = {"normal": "updated"}
REPEATED = 4


def setup_at(law, speed, rig=None):
    rig, contact = rig or read_rig("mokhtar2017"), Contact(**law)
    return prepared(rig, speed, samples=SAMPLES, contact=contact)


def seconds_of(integrate, setup, recording, *law, case=CASE):
    began = time.process_time()
    integrate(setup, *law, recording=recording, **case)
    return time.process_time() - began


@pytest.mark.parametrize("seconds", [20.0, 4.0])
@on_one_thread
def test_a_run_up_over_constant_speed(seconds, capsys):
    """From 1200 to 2400 rpm, contact from 1400 rpm on. Signals, orders, and measures."""
    speed_law = SpeedLaw(time=(0.0, seconds), speed=(1200 * RPM, 2400 * RPM))
    recording = Recording(transient=0, revolutions=speed_law.n_revolution, samples_per_revolution=SAMPLES)
    lines, ratios = [], {}
    for name, law in LAWS.items():
        steady = [setup_at(law, speed * RPM) for speed in STEADY]
        rising = setup_at(law, 2400 * RPM)
        held, changing = [], []
        for _ in range(1 + REPEATED):  # the first one compiles, and solves contact modes
            held.append([seconds_of(run_case, s, recording) for s in steady])
            changing.append(seconds_of(record_run_up, rising, recording, speed_law))
        at_constant, rise = np.min(held[1:], axis=0).mean(), min(changing[1:])
        ratios[name] = rise / at_constant
        lines.append(f"{name:18} {1e3 * rise:7.1f} ms for {1e3 * at_constant:6.1f}: {ratios[name]:.2f}")
    with capsys.disabled():
        print(f"\n{speed_law.n_revolution} revolutions in {seconds:g} s\n" + "\n".join(lines))
    assert max(ratios.values()) < 7.0


@pytest.mark.parametrize("count", [8, 16])
@on_one_thread
def test_an_overhung_pump_in_a_ring(count, capsys):
    """Gyroscopic terms matter: matrices are held over few ranges of speed, each with sets of contacts."""
    rig = in_ring(pump(), count, first=0.2)
    speed_law = SpeedLaw(time=(0.0, 8.0), speed=(300.0, 360.0))
    recording = Recording(transient=0, revolutions=speed_law.n_revolution, samples_per_revolution=SAMPLES)
    case = CASE | {"clearance": 1.5e-4, "friction": 0.05}
    lines, ratios = [], {}
    for name, law in LAWS.items():
        if name == "updated normal":
            continue
        law = law | {"damping": 50.0} if "law" in law else law
        steady = [setup_at(law, speed, rig) for speed in (305.0, 320.0, 335.0, 350.0)]
        rising = setup_at(law, 360.0, rig)
        held, changing = [], []
        for _ in range(3):  # the first one solves contact modes
            held.append([seconds_of(run_case, s, recording, case=case) for s in steady])
            changing.append(seconds_of(record_run_up, rising, recording, speed_law, case=case))
        at_constant, rise = np.min(held[1:], axis=0).mean(), min(changing[1:])
        ratios[name] = rise / at_constant
        lines.append(
            f"{name:18} {1e3 * rise:7.1f} ms, {1e3 * changing[0]:.0f} at first, "
            f"for {1e3 * at_constant:6.1f}: {ratios[name]:.2f}"
        )
    with capsys.disabled():
        print(f"\nring of {count}\n" + "\n".join(lines))
    assert max(ratios.values()) < 3.0
