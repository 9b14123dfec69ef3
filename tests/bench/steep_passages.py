"""What steep passages of a rotor in three tabulated bearings cost and err by (guide, performance).

    python tests/bench/steep_passages.py

Cost: in a ring of eight, over as many revolutions at constant speeds, first cases over first cases, in
processor time; each solves contact modes of its own. Errors of accelerations: without contact, against
stepping of all degrees, in the mean up to order 10 and at their worst over the peak.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

TESTS = Path(__file__).resolve().parents[1]
sys.path += [str(TESTS / "integrate" / "changing_speed"), str(TESTS / "support")]

from set_ups import prepared  # noqa: E402
from test_steep_run_ups import (  # noqa: E402
    PER_REVOLUTION,
    PROBES,
    RUB,
    error,
    machine,
    stepped,
    without_contact,
)

from rubhpc.integrate.case import run_case  # noqa: E402
from rubhpc.integrate.changing_speed.case import record_run_up  # noqa: E402
from rubhpc.study.initial import CONTACT_FREE, Initial  # noqa: E402
from rubhpc.study.speed_law import SpeedLaw  # noqa: E402
from rubhpc.study.study import Recording  # noqa: E402
from rubhpc.threads import on_one_thread  # noqa: E402

STEADY = 5  # constant speeds
ROUNDS = 3  # of which the least counts
LAWS = {
    "five bends, up to 450 rad/s2": SpeedLaw(
        time=(0.0, 0.1, 0.14, 0.24, 0.3, 0.46, 0.54), speed=(300.0, 302.0, 320.0, 323.0, 332.0, 334.0, 352.0)
    ),
    "90 rad/s2": SpeedLaw(time=(0.0, 0.5), speed=(300.0, 345.0)),
    "6 rad/s2": SpeedLaw(time=(0.0, 2.0), speed=(300.0, 312.0)),
}


def seconds_of(integrate, speed, recording, *law):
    """Processor time of the first case of a set-up."""
    setup = prepared(machine(8), speed, samples=PER_REVOLUTION)
    began = time.process_time()
    integrate(setup, *law, recording=recording, initial=Initial(from_=CONTACT_FREE), **RUB)
    return time.process_time() - began


def print_errors(law):
    """Errors of a passage without contact."""
    found, expected = without_contact(machine(), law), stepped(machine(), law)
    for probe, signal in zip(PROBES, expected, strict=True):
        own = found[f"probe_{probe.name}"].values
        worst = np.abs(own - signal).max() / np.abs(signal).max()
        print(f"    node {probe.node}: {error(own, signal):.2%}, {worst:.1%} of the peak")


@on_one_thread
def main() -> None:
    """Print a line for each law."""
    for i, (name, law) in enumerate([next(iter(LAWS.items())), *LAWS.items()]):
        recording = Recording(
            transient=0, revolutions=law.n_revolution, samples_per_revolution=PER_REVOLUTION
        )
        speeds = np.linspace(law.speed[0], law.speed[-1], STEADY)
        steady, passage = [], []
        for _ in range(ROUNDS if i else 1):  # the first law compiles
            steady.append([seconds_of(run_case, speed, recording) for speed in speeds])
            passage.append(seconds_of(record_run_up, max(law.speed), recording, law))
        if i:
            least = min(passage)
            ratio = least / np.min(steady, axis=0).mean()
            print(f"{name}: {law.n_revolution} revolutions {least:.2f} s, {ratio:.1f} times")
            print_errors(law)


if __name__ == "__main__":
    main()
