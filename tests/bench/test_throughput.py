"""What a simulated second costs by three integrators, in one run on one core, and how far each is off.

The third is what one would write first: the paper's Eqs. 20 to 24 with NumPy, dense over both bodies.
"""

import math
import time

import numpy as np
import pytest
from scipy.linalg import block_diag

from rubhpc.fem.assemble import assemble
from rubhpc.integrate.case import run_case
from rubhpc.integrate.packing import degrees_of
from rubhpc.integrate.prepare import prepare
from rubhpc.rig import read_rig
from rubhpc.study import Contact, Integrator, Recording

pytestmark = pytest.mark.bench

SPEED, CLEARANCE, FRICTION = 148.7, 84e-6, 0.3  # r = 0.75
TURN = 2 * math.pi / SPEED
PER_REVOLUTION = 256


def timed(rig, revolutions, transient=0, rounds=3, **integrator):
    """Least wall time (s) of a case, set-up apart, and its record."""
    setup = prepare(
        rig,
        SPEED,
        contact=Contact(),
        integrator=Integrator(**integrator),
        samples_per_revolution=PER_REVOLUTION,
    )
    keep = ("waveform",) if transient == 0 else ()
    recording = Recording(transient=transient, revolutions=revolutions, keep=keep)
    records = [
        run_case(setup, clearance=CLEARANCE, friction=FRICTION, recording=recording) for _ in range(rounds)
    ]
    return min(record.wall_time for record in records), records[0]


def plain_numpy(rig, revolutions, steps_per_sample):
    """Eqs. 20 to 24 step by step; wall time (s) and the vertical motion at the samples, m."""
    model = assemble(rig)
    bodies = (model.rotor, model.stators[0].body)
    mass, stiffness = (block_diag(*(getattr(b, name) for b in bodies)) for name in ("mass", "stiffness"))
    damping = block_diag(*(b.damping + SPEED * b.gyroscopic for b in bodies))
    v, w, torsion, axial, lateral = degrees_of(model)[0]
    push, pull = np.zeros((2, len(mass)))  # the stator stands upright: n = y
    push[[v, axial]] = -1.0, 1.0
    pull[[v, w, torsion, axial, lateral]] = (
        -1.0,
        -FRICTION,
        -FRICTION * model.stators[0].radius,
        1.0,
        FRICTION,
    )
    h = TURN / PER_REVOLUTION / steps_per_sample
    inverse = np.linalg.inv(mass / h**2 + damping / (2 * h))
    now, before = inverse @ (2 * mass / h**2 - stiffness), inverse @ (damping / (2 * h) - mass / h**2)
    force = np.zeros((len(mass), 2))
    force[: model.rotor.n_dof] = SPEED**2 * np.column_stack([model.unbalance_cosine, model.unbalance_sine])
    force, kick = inverse @ force, inverse @ pull
    compliance = push @ kick
    began = time.perf_counter()
    n_step = revolutions * PER_REVOLUTION * steps_per_sample
    vertical = np.empty(revolutions * PER_REVOLUTION)
    # From rest: the displacement a step earlier has half the first step's acceleration in it.
    u, earlier = np.zeros(len(mass)), 0.5 * force[:, 0]
    for i in range(n_step):
        if i % steps_per_sample == 0:
            vertical[i // steps_per_sample] = u[v]
        angle = SPEED * h * i
        free = now @ u + before @ earlier + force @ (math.cos(angle), math.sin(angle))
        gap = CLEARANCE + push @ free
        if gap < 0.0:
            free -= kick * (gap / compliance)
        u, earlier = free, u
    return time.perf_counter() - began, vertical


def error(found, known):
    return np.sqrt(np.mean((found - known) ** 2)) / np.std(known)


def test_modal_case_is_hundreds_of_times_as_fast(benchmark):
    """The usual case of 120 and 64 revolutions by the modal scheme; of the others, two revolutions."""
    rig = read_rig("mokhtar2017")
    fine = timed(rig, 2, rounds=1, method="central-difference", step=0.125e-6)[1].vertical
    timed(rig, 1, rounds=1, method="modal")  # compiles
    wall, record = benchmark.pedantic(lambda: timed(rig, 64, transient=120, rounds=10), rounds=1)
    cost = {"modal": wall / (184 * TURN)}
    off = {"modal": error(timed(rig, 2)[1].vertical, fine)}
    short, record = timed(rig, 2, method="central-difference", step=0.5e-6)
    cost["central difference"], off["central difference"] = short / (2 * TURN), error(record.vertical, fine)
    steps = math.ceil(TURN / PER_REVOLUTION / 0.5e-6)
    plain, vertical = plain_numpy(rig, 2, steps)
    cost["plain NumPy"], off["plain NumPy"] = plain / (2 * TURN), error(vertical, fine)
    print(f"\n{'':20} {'s a simulated s':>16} {'cases a core-s':>15} {'ratio':>7} {'error':>9}")
    for name, seconds in cost.items():
        ratio = seconds / cost["modal"]
        print(
            f"{name:20} {seconds:16.4f} {1 / (seconds * 184 * TURN):15.3f} {ratio:7.0f} {off[name]:9.1e}",
        )
        benchmark.extra_info[name] = {"s a simulated second": seconds, "ratio": ratio, "error": off[name]}
    assert max(off.values()) < 1e-4
    assert cost["central difference"] / cost["modal"] > 400
    assert cost["plain NumPy"] / cost["modal"] > 1000
