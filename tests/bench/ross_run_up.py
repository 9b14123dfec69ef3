"""Run-ups without contact against ROSS's time response with an array of speeds (theory, run-ups).

    python tests/bench/ross_run_up.py

Needs ROSS 3 (Python 3.12). The packaged rotor, and one with its disc overhung, start from rest. Printed for
displacements at the disc and at a bearing: error over the motion, peak, and amplitude and lag of 1X over six
revolutions.
"""

from __future__ import annotations

import math
import sys
import time
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

sys.path[:0] = [str(Path(__file__).resolve().parent)]

from rivals import ross_rotor  # noqa: E402

from rubhpc import read_rig, run_up  # noqa: E402
from rubhpc.study.speed_law import SpeedLaw  # noqa: E402

STEP, SECONDS, PER_REVOLUTION, WINDOW = 1e-4, 4.0, 128, 6  # s, s, samples, revolutions


def overhung(rig):
    """The rig with its disc at the free end, and the second bearing at node 11."""
    rotor = rig.rotor
    (disc,), (first, second), (unbalance,) = rotor.disc, rotor.bearing, rotor.unbalance
    end, bearing = rotor.shaft[0].elements + 1, replace(second, node=11)
    rotor = replace(
        rotor,
        disc=(replace(disc, node=end),),
        bearing=(first, bearing),
        unbalance=(replace(unbalance, node=end),),
    )
    return replace(rig, rotor=rotor, stator=tuple(replace(s, node=end) for s in rig.stator))


def ross_response(rig, law):
    """Times and displacements (n_time, n_dof) of ROSS, and the time that it takes, s."""
    rotor, (unbalance,) = ross_rotor(rig), rig.rotor.unbalance
    times = np.arange(0.0, SECONDS + 0.5 * STEP, STEP)
    rate = law.acceleration[0]
    speed, angle = law.speed[0] + rate * times, law.speed[0] * times + 0.5 * rate * times**2
    force = unbalance.mass * unbalance.radius * (speed**2 - 1j * rate) * np.exp(1j * angle)
    forces = np.zeros((times.size, rotor.ndof))
    first = rotor.number_dof * (unbalance.node - 1)
    forces[:, first], forces[:, first + 1] = force.real, force.imag
    gyroscopic, began = rotor.G(), time.process_time()
    damping = rig.rotor.damping.alpha * rotor.M(0.0)
    found = rotor.run_time_response(
        speed, forces, times, method="newmark", C=damping, K=rotor.K(0.0), Ksdt=gyroscopic
    )
    return times, found.yout, time.process_time() - began


def first_order(signal):
    """Phasors of 1X, over windows of revolutions."""
    turns = signal.size // PER_REVOLUTION - WINDOW
    turning = np.exp(-2j * np.pi * np.arange(WINDOW * PER_REVOLUTION) / PER_REVOLUTION)
    return np.array([signal[k * PER_REVOLUTION :][: turning.size] @ turning for k in range(turns)])


def main() -> None:
    """Print a line for each signal."""
    warnings.filterwarnings("ignore")
    packaged = read_rig("mokhtar2017")
    rpm = math.pi / 30.0
    for name, rig, law in (
        ("packaged", packaged, SpeedLaw(time=(0.0, SECONDS), speed=(1200 * rpm, 2400 * rpm))),
        ("overhung", overhung(packaged), SpeedLaw(time=(0.0, SECONDS), speed=(60.0, 180.0))),
    ):
        places = {"disc": (rig.rotor.disc[0].node, 0), "disc, across": (rig.rotor.disc[0].node, 1)}
        places["bearing"] = rig.rotor.bearing[1].node, 0
        probes = [
            {"name": f"p{i}", "node": node, "angle": axis * math.pi / 2}
            for i, (node, axis) in enumerate(places.values())
        ]
        case = {"clearance": 1.0, "friction": 0.0, "initial": {"from": "rest"}, "probes": probes}
        case |= {"speed_law": list(zip(law.time, law.speed, strict=True))}
        for _ in range(2):  # the first one compiles
            began = time.process_time()
            found = run_up(rig, samples_per_revolution=PER_REVOLUTION, **case)
            own_time = time.process_time() - began
        times, response, ross_time = ross_response(rig, law)
        print(f"{name}: {own_time:.2f} s, ROSS {ross_time:.1f} s")
        for i, (place, (node, axis)) in enumerate(places.items()):
            own = found[f"probe_p{i}"].values
            at = law.at_angle(2.0 * np.pi * np.arange(own.size) / PER_REVOLUTION)[0]
            other = CubicSpline(times, response[:, 6 * (node - 1) + axis])(at)
            error = np.linalg.norm(own - other) / np.linalg.norm(other)
            peak = np.abs(own).max() / np.abs(other).max() - 1.0
            ours, theirs = first_order(own), first_order(other)
            amplitude = np.abs(ours).max() / np.abs(theirs).max() - 1.0
            is_large = np.abs(theirs) > 0.1 * np.abs(theirs).max()
            lag = np.degrees(np.abs(np.angle(ours / theirs))[is_large].max())
            print(
                f"    {place}: {error:.3%}, peak {peak:+.3%}, 1X {amplitude:+.3%}, lag within {lag:.3f} deg"
            )


if __name__ == "__main__":
    main()
