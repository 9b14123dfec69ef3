"""Matrices of rotor and stators set up another way, for `tests/reference.py`.

Element matrices come from the force method (flexibility and equilibrium) and bending is set up in the complex
plane. Of the product it takes only the numbers of a rig.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

PER_PAIR = 5  # degrees of a contact pair: disc v, w, torsion; tip axial, lateral


def beam_element(length, flexural_rigidity, shear_rigidity, mass, rotary_inertia):
    """Translational mass, rotary mass and stiffness, (4, 4), of deflection and rotation at both ends.

    The first end is clamped and the other loaded by a force and a moment: flexibility gives stiffness by
    equilibrium, and the deflection under these loads the shapes that the mass is integrated over.
    """
    L, EI, GA = length, flexural_rigidity, shear_rigidity
    flexibility = np.array([[L**3 / (3 * EI) + L / GA, L**2 / (2 * EI)], [L**2 / (2 * EI), L / EI]])
    equilibrium = np.array([[-1.0, 0.0], [-L, -1.0], [1.0, 0.0], [0.0, 1.0]])
    loads = np.linalg.solve(flexibility, equilibrium.T)  # (2, 4), for unit displacements
    translational, rotary = np.zeros((2, 4, 4))
    points, weights = np.polynomial.legendre.leggauss(4)
    for x, weight in zip(L * (points + 1) / 2, L * weights / 2, strict=True):
        deflection = np.array([1, x, 0, 0]) + loads.T @ [
            (L * x**2 / 2 - x**3 / 6) / EI + x / GA,
            x**2 / (2 * EI),
        ]
        rotation = np.array([0, 1, 0, 0]) + loads.T @ [(L * x - x**2 / 2) / EI, x / EI]
        translational += weight * mass * np.outer(deflection, deflection)
        rotary += weight * rotary_inertia * np.outer(rotation, rotation)
    return translational, rotary, equilibrium @ loads


def bar_element(length, rigidity, inertia):
    """Mass and stiffness, (2, 2), of tension or torsion."""
    return (
        inertia * length * (np.ones((2, 2)) + np.eye(2)) / 6,
        rigidity / length * np.array([[1.0, -1.0], [-1.0, 1.0]]),
    )


def chain(elements, per_node):
    """Matrices of elements joined end to end."""
    size = per_node * (len(elements) + 1)
    joined = np.zeros((size, size))
    for i, element in enumerate(elements):
        rows = slice(per_node * i, per_node * (i + 2))
        joined[rows, rows] += element
    return joined


def cowper_circle(nu, bore):
    """Cowper's coefficient of a hollow circle, `bore` its inner over its outer diameter (1966, Table 1)."""
    m = bore
    return 6 * (1 + nu) * (1 + m**2) ** 2 / ((7 + 6 * nu) * (1 + m**2) ** 2 + (20 + 12 * nu) * m**2)


@dataclass
class Bodies:
    """All bodies in one: rotor in y-x, in z-x, in torsion, then each stator, axial and lateral."""

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    unbalance: np.ndarray  # (2, n), cosine and sine part of the force, N
    rows: np.ndarray  # (q, 5); -1 where a degree is held
    output: np.ndarray  # (3,)


def rotor_matrices(rotor):
    """M, G, K of bending in one plane, the bearings in two, and M, K of torsion."""
    bending, torsion = [], []
    for section in rotor.shaft:
        L = section.length / section.elements
        outer, inner = section.outer_diameter, section.inner_diameter
        area, second = math.pi * (outer**2 - inner**2) / 4, math.pi * (outer**4 - inner**4) / 64
        E, shear, rho = section.youngs_modulus, section.shear_modulus, section.density
        coefficient = cowper_circle(E / (2 * shear) - 1, inner / outer) if section.shear else math.inf
        bending += [
            beam_element(L, E * second, coefficient * shear * area, rho * area, rho * second)
        ] * section.elements
        torsion += [bar_element(L, shear * 2 * second, rho * 2 * second)] * section.elements
    M = chain([t + r for t, r, _ in bending], 2)
    G = chain([2 * r for _, r, _ in bending], 2)
    K = chain([k for *_, k in bending], 2)
    MT, KT = chain([m for m, _ in torsion], 1), chain([k for _, k in torsion], 1)
    for disc in rotor.disc:
        mass, diametral, polar = disc.inertia
        at = 2 * (disc.node - 1)
        M[at, at] += mass
        M[at + 1, at + 1] += diametral
        G[at + 1, at + 1] += polar
        MT[disc.node - 1, disc.node - 1] += polar
    return M, G, K, MT, KT


def set_up(rig, spin):
    """Matrices of a rig at a speed.

    Bending in the complex plane: with `r = v + i w` and the slope `thz - i thy`, a spinning rotor obeys
    `M r'' - i spin G r' + D r' + K r = f`; parted into real and imaginary part, G couples the planes.
    """
    rotor = rig.rotor
    M, G, K, MT, KT = rotor_matrices(rotor)
    n = len(M)
    mass, stiffness, dampers = block_diag(M, M), block_diag(K, K), np.zeros((2 * n, 2 * n))
    for bearing in rotor.bearing:
        at = 2 * (bearing.node - 1)
        seat = np.ix_([at, n + at], [at, n + at])
        stiffness[seat] += bearing.stiffness_matrix
        dampers[seat] += bearing.damping_matrix
    turn = np.zeros((2 * n, 2 * n))
    turn[:n, n:], turn[n:, :n] = G, -G
    twist_dampers = np.zeros_like(MT)
    free = list(range(len(MT)))
    drive = rotor.torsion
    if drive.fixed_node is not None:
        free.remove(drive.fixed_node - 1)
    else:
        KT[drive.node - 1, drive.node - 1] += drive.stiffness or 0.0
        twist_dampers[drive.node - 1, drive.node - 1] += drive.damping
    alpha, beta = rotor.damping.alpha, rotor.damping.beta
    bodies = [
        (mass, alpha * mass + beta * stiffness + dampers + spin * turn, stiffness),
        tuple(m[np.ix_(free, free)] for m in (MT, alpha * MT + beta * KT + twist_dampers, KT)),
    ]
    n_rotor = 2 * n + len(free)

    def twist_row(node):
        return 2 * n + free.index(node - 1) if node - 1 in free else -1

    rows = []
    first = n_rotor
    for stator in rig.stator:
        L, E, nu, rho = stator.length, stator.youngs_modulus, stator.poissons_ratio, stator.density
        area = stator.width * stator.height
        second = stator.width * stator.height**3 / 12
        shear_rigidity = 10 * (1 + nu) / (12 + 11 * nu) * E / (2 * (1 + nu)) * area  # Cowper's rectangle
        axial = bar_element(L / stator.elements, E * area, rho * area)
        beam = beam_element(L / stator.elements, E * second, shear_rigidity, rho * area, rho * second)
        parts = [[chain([part] * stator.elements, 1)[1:, 1:] for part in axial]]
        if stator.lateral:
            parts.append([chain([p] * stator.elements, 2)[2:, 2:] for p in (beam[0] + beam[1], beam[2])])
        at = 2 * (stator.node - 1)
        tip = [first + stator.elements - 1, -1]
        for m, k in parts:
            bodies.append((m, stator.damping.alpha * m + stator.damping.beta * k, k))
            first += len(m)
        if stator.lateral:
            tip[1] = first - 2
        rows.append([at, n + at, twist_row(stator.node), *tip])
    M, C, K = (block_diag(*part) for part in zip(*bodies, strict=True))
    force = np.zeros((2, len(M)))
    for unbalance in rotor.unbalance:
        at = 2 * (unbalance.node - 1)
        pull = spin**2 * unbalance.mass * unbalance.radius * np.exp(1j * unbalance.phase)
        force[:, at] += [pull.real, -pull.imag]  # Re and Im of pull * exp(i spin t)
        force[:, n + at] += [pull.imag, pull.real]
    rows = np.array(rows)
    return Bodies(M, C, K, force, rows, rows[0, :3])
