"""What else one could use: the paper's scheme with NumPy, and the same compiled.

Both follow Eqs. 20 to 24 of the paper, dense over both bodies together, for one upright stator.
"""

import math
import time
from dataclasses import dataclass

import numba
import numpy as np
from scipy.linalg import block_diag

from rubhpc.fem.assemble import assemble
from rubhpc.integrate.packing import degrees_of

STEP = 0.5e-6  # s, the paper's


@dataclass(frozen=True)
class Dense:
    """Matrices of a step: u[n+1] = now u[n] + before u[n-1] + force (cos, sin) - kick gap / compliance."""

    now: np.ndarray  # (n_dof, n_dof)
    before: np.ndarray  # (n_dof, n_dof)
    force: np.ndarray  # (n_dof, 2), m
    gap_jacobian: np.ndarray  # (n_dof,), the gap's rate with displacement
    kick: np.ndarray  # (n_dof,), displacement for a unit contact force, m/N
    vertical: int


def dense(rig, speed, friction, step):
    """The scheme's matrices for a rig at a speed, rad/s."""
    model = assemble(rig)
    bodies = (model.rotor, model.stators[0].body)
    mass, stiffness = (block_diag(*(getattr(b, name) for b in bodies)) for name in ("mass", "stiffness"))
    damping = block_diag(*(b.damping + speed * b.gyroscopic for b in bodies))
    v, w, torsion, axial, lateral = degrees_of(model)[0]
    gap_jacobian, force_direction = np.zeros((2, len(mass)))  # the stator stands upright: n = y
    gap_jacobian[[v, axial]] = -1.0, 1.0
    force_direction[[v, w, torsion, axial, lateral]] = (
        -1.0,
        -friction,
        -friction * model.stators[0].radius,
        1.0,
        friction,
    )
    inverse = np.linalg.inv(mass / step**2 + damping / (2 * step))
    force = np.zeros((len(mass), 2))
    force[: model.rotor.n_dof] = speed**2 * np.column_stack([model.unbalance_cosine, model.unbalance_sine])
    return Dense(
        now=inverse @ (2 * mass / step**2 - stiffness),
        before=inverse @ (damping / (2 * step) - mass / step**2),
        force=inverse @ force,
        gap_jacobian=gap_jacobian,
        kick=inverse @ force_direction,
        vertical=v,
    )


def march(now, before, force, gap_jacobian, kick, place, clearance, turn, n_step, vertical):
    """Step by step from rest; fills `vertical` (n_step,), m."""
    compliance = gap_jacobian @ kick
    # From rest: the displacement a step earlier has half the first step's acceleration in it.
    u, earlier = np.zeros(len(gap_jacobian)), 0.5 * force[:, 0]
    for i in range(n_step):
        vertical[i] = u[place]
        free = (
            now @ u + before @ earlier + force[:, 0] * math.cos(turn * i) + force[:, 1] * math.sin(turn * i)
        )
        gap = clearance + gap_jacobian @ free
        if gap < 0.0:
            free -= kick * (gap / compliance)
        u, earlier = free, u


compiled = numba.njit(march)


def run(rig, speed, clearance, friction, n_step, *, step, is_compiled):
    """Wall time a step (s), and the vertical motion at each, m."""
    scheme = dense(rig, speed, friction, step)
    given = (scheme.now, scheme.before, scheme.force, scheme.gap_jacobian, scheme.kick)
    vertical = np.empty(n_step)
    function = compiled if is_compiled else march
    if is_compiled:
        function(*given, scheme.vertical, clearance, speed * step, 10, vertical)
    began = time.perf_counter()
    function(*given, scheme.vertical, clearance, speed * step, n_step, vertical)
    return (time.perf_counter() - began) / n_step, vertical
