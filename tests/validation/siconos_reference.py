"""Reference motions by Siconos: a disc on springs between stators, each a mass on springs.

    python3 tests/validation/siconos_reference.py

computes them again with the interpreter for which Siconos is installed (Debian: python3-siconos, 4.4.0) and
writes tests/data/siconos_4.4.0.npz. Moreau and Jean's time stepping, theta = 1/2, with the contact problem of
each step solved by its NSGS solver to 1e-13 (V. Acary, F. Perignon, https://github.com/siconos/siconos). What
differs from the product: the law of impact alone decides in the normal direction too, at the level of
velocities, nothing closes gaps that have drifted, and the spin is a degree of freedom of its own, that of a
flywheel of 1e12 kg m2.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

STORED = Path(__file__).parents[1] / "data" / "siconos_4.4.0.npz"
STEP = 2.5e-7  # s
N_SAMPLE = 400

DISC = {
    "mass": (2.0, 2.0, 5e-3),  # kg, kg, kg m2: vertical, horizontal, torsion
    "stiffness": (8e4, 8e4, 3e3),  # N/m, N/m, N m/rad
    "damping": (40.0, 40.0, 0.2),  # N s/m, N s/m, N m s/rad
}
RADIUS, CLEARANCE = 0.06, 1e-4  # m


def stator(angle):
    """Mass (kg), stiffness (N/m) and damping (N s/m), axial and lateral, at an angle (rad)."""
    return {"angle": angle, "mass": 0.02, "stiffness": (1e6, 5e4), "damping": (40.0, 10.0)}


# Samples a revolution, of which N_SAMPLE are 0.06 s; friction, restitution, stators (rad), unbalance (kg m)
# and velocity at the start.
DURATION = 0.06
CASES = {
    "sliding": (210, 0.3, 0.0, (0.3,), 3.6e-4, (0.3, 0.1, 0.0)),
    "reversal": (4000, 0.3, 0.0, (0.3,), 0.0, (0.5, -1.5, -30.0)),
    "stick": (20_000, 0.9, 0.0, (0.3,), 0.0, (0.8, 0.3, -8.0)),
    "two stators": (4000, 0.4, 0.0, (0.3, 1.5), 0.0, (0.6, 0.9, -30.0)),
    "restitution": (4000, 0.3, 0.6, (0.3, 1.5), 0.0, (0.6, 0.9, -30.0)),
}


def spin_of(per_revolution):
    """Spin, rad/s, at which a revolution has so many samples."""
    return 2 * np.pi * N_SAMPLE / (per_revolution * DURATION)


def solve(per_revolution, friction, restitution, angles, unbalance, velocity, step):
    """Vertical, horizontal, torsion, then axial and lateral of each stator, (1 + n_step, 3 + 2 q)."""
    from siconos import kernel, numerics

    spin = spin_of(per_revolution)
    stators = [stator(angle) for angle in angles]
    n = 4 + 2 * len(stators)  # the fourth is the flywheel

    def diagonal(name, flywheel):
        return np.diag([*DISC[name], flywheel, *(x for s in stators for x in np.broadcast_to(s[name], 2))])

    start = np.array([*velocity, spin, *np.zeros(2 * len(stators))])
    bodies = kernel.LagrangianLinearTIDS(
        np.zeros(n), start, diagonal("mass", 1e12), diagonal("stiffness", 0.0), diagonal("damping", 0.0)
    )
    system = kernel.NonSmoothDynamicalSystem(0.0, DURATION)
    system.insertDynamicalSystem(bodies)
    for i, one in enumerate(stators):
        normal = np.array([np.cos(one["angle"]), np.sin(one["angle"])])
        H = np.zeros((2, n))
        H[0, :2], H[0, 4 + 2 * i] = -normal, 1.0
        H[1, :2], H[1, 2], H[1, 3], H[1, 5 + 2 * i] = (-normal[1], normal[0]), RADIUS, RADIUS, -1.0
        relation = kernel.LagrangianLinearTIR(H, np.array([CLEARANCE, 0.0]))
        law = kernel.NewtonImpactFrictionNSL(restitution, 0.0, friction, 2)
        system.link(kernel.Interaction(law, relation), bodies)
    problem = kernel.FrictionContact(2, numerics.SICONOS_FRICTION_2D_NSGS)
    problem.numericsSolverOptions().dparam[0] = 1e-13
    problem.numericsSolverOptions().iparam[0] = 10_000
    simulation = kernel.TimeStepping(
        system, kernel.TimeDiscretisation(0.0, step), kernel.MoreauJeanOSI(0.5), problem
    )
    motion = np.zeros((1 + round(DURATION / step), n))
    for i in range(len(motion) - 1):
        angle = spin * (i + 0.5) * step
        force = np.zeros(n)
        force[:2] = unbalance * spin**2 * np.array([np.cos(angle), np.sin(angle)])
        bodies.setFExtPtr(force)
        simulation.computeOneStep()
        motion[i + 1] = bodies.q()
        simulation.nextStep()
    return np.delete(motion, 3, axis=1)


def sampled(motion):
    """Every one of N_SAMPLE equal intervals' ends, the first at rest."""
    return motion[:: (len(motion) - 1) // N_SAMPLE]


if __name__ == "__main__":
    found = {}
    for name, case in CASES.items():
        fine, coarse = (sampled(solve(*case, step)) for step in (STEP, 2 * STEP))
        found[name] = fine
        found[f"{name}, error"] = abs(fine - coarse).max(axis=0)  # of first order: that of the finer one
    np.savez_compressed(STORED, **found)
