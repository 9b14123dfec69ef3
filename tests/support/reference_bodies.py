"""Matrices of rotor, carriers and stators set up another way, for `independent_contact`.

Element matrices come from the force method (flexibility and equilibrium) and bending is set up in the complex
plane. Of the product it takes only the numbers of a rig.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag


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
    """All in one: rotor in y-x, in z-x, in torsion, carriers, then each stator, axial and lateral."""

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    unbalance: np.ndarray  # (2, n), cosine and sine part of the force, N
    rows: np.ndarray  # (q, 5); -1 where a degree is held
    output: np.ndarray  # (3,)
    slopes: list  # per stator, (n, n): integral of the squared slope of its bending, 1/m; None of masses
    weight: np.ndarray  # (n,), gravity and constant loads, N


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


def squared_slope(stator):
    """Matrix (2 e + 2, 2 e + 2) of the integral of the squared slope, 1/m, counted from that of the root."""
    e = stator.elements
    L, nu = stator.length / e, stator.poissons_ratio
    area, second = stator.width * stator.height, stator.width * stator.height**3 / 12
    E = stator.youngs_modulus
    EI, GA = E * second, 10 * (1 + nu) / (12 + 11 * nu) * E / (2 * (1 + nu)) * area
    flexibility = np.array([[L**3 / (3 * EI) + L / GA, L**2 / (2 * EI)], [L**2 / (2 * EI), L / EI]])
    equilibrium = np.array([[-1.0, 0.0], [-L, -1.0], [1.0, 0.0], [0.0, 1.0]])
    loads = np.linalg.solve(flexibility, equilibrium.T)
    element = np.zeros((4, 4))
    for x, weight in zip(*np.polynomial.legendre.leggauss(6), strict=True):
        x, weight = L * (x + 1) / 2, L * weight / 2
        slope = np.array([0, 1, 0, 0]) + loads.T @ [(L * x - x**2 / 2) / EI + 1 / GA, x / EI]
        element += weight * np.outer(slope, slope)
    relative = np.eye(2 * e + 2)
    relative[:, :2] -= np.stack(
        [np.tile([1.0, 0.0], e + 1), np.ravel([[L * i, 1.0] for i in range(e + 1)])]
    ).T
    return relative.T @ chain([element] * e, 2) @ relative


def stator_parts(stator):
    """M, D, K of axial and of lateral motion, and how many degrees belong to the root, which come first."""
    if stator.is_bore:
        both = zip(stator.dampers, stator.springs, strict=True)
        spring = np.array([[1.0, -1.0], [-1.0, 1.0]])
        return [(np.diag([0.0, stator.mass]), c * spring, k * spring, 1) for c, k in both if not stator.rigid]
    if hasattr(stator, "rigid"):
        held = [(stator.mass, stator.damping, stator.stiffness)] * (not stator.rigid)
        if stator.lateral_stiffness is not None:
            mass = stator.mass if stator.lateral_mass is None else stator.lateral_mass
            held.append((mass, stator.lateral_damping, stator.lateral_stiffness))
        spring = np.array([[1.0, -1.0], [-1.0, 1.0]])
        return [(np.diag([0.0, m]), c * spring, k * spring, 1) for m, c, k in held]
    L, E, nu, rho = stator.length, stator.youngs_modulus, stator.poissons_ratio, stator.density
    area = stator.width * stator.height
    second = stator.width * stator.height**3 / 12
    shear_rigidity = 10 * (1 + nu) / (12 + 11 * nu) * E / (2 * (1 + nu)) * area  # Cowper's rectangle
    axial = bar_element(L / stator.elements, E * area, rho * area)
    beam = beam_element(L / stator.elements, E * second, shear_rigidity, rho * area, rho * second)
    parts = [(*(chain([part] * stator.elements, 1) for part in axial), 1)]
    if stator.lateral:
        parts.append((*(chain([p] * stator.elements, 2) for p in (beam[0] + beam[1], beam[2])), 2))
    alpha, beta = stator.damping.alpha, stator.damping.beta
    assert not (alpha and stator.carrier)  # which is of the motion relative to the carrier
    return [(m, alpha * m + beta * k, k, root) for m, k, root in parts]


def carrier_matrices(carrier):
    """M, D, K of a carrier alone, of v, w and, if it turns, of that."""
    across = carrier.stiffness if carrier.horizontal_stiffness is None else carrier.horizontal_stiffness
    lines = np.array(
        [
            [carrier.mass, carrier.mass, carrier.inertia or 0.0],
            [carrier.damping, carrier.damping, carrier.torsional_damping],
            [carrier.stiffness, across, carrier.torsional_stiffness or 0.0],
        ]
    )
    return tuple(np.diag(line if carrier.inertia else line[:2]) for line in lines)


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
    turns = list(range(len(MT)))
    drive = rotor.torsion
    if drive.fixed_node is not None:
        turns.remove(drive.fixed_node - 1)
    else:
        KT[drive.node - 1, drive.node - 1] += drive.stiffness or 0.0
        twist_dampers[drive.node - 1, drive.node - 1] += drive.damping
    alpha, beta = rotor.damping.alpha, rotor.damping.beta
    bodies = [
        (mass, alpha * mass + beta * stiffness + dampers + spin * turn, stiffness),
        tuple(m[np.ix_(turns, turns)] for m in (MT, alpha * MT + beta * KT + twist_dampers, KT)),
    ]
    n_rotor = 2 * n + len(turns)

    def twist_row(node):
        return 2 * n + turns.index(node - 1) if node - 1 in turns else -1

    carriers = {}
    first = n_rotor
    for carrier in rig.carrier:
        bodies.append(carrier_matrices(carrier))
        carriers[carrier.name] = range(first, first + len(bodies[-1][0]))
        first += len(bodies[-1][0])
    rows, bent, follow = [], [], {}  # what roots are of carriers, by their degrees
    for stator in rig.stator:
        at = 2 * (stator.node - 1)
        tip = [-1, -1]
        bent.append(None)
        reach, c, s = rig.contact_radius(stator), math.cos(stator.angle), math.sin(stator.angle)
        reach += getattr(stator, "length", 0.0)
        for i, (*part, root) in enumerate(stator_parts(stator)):
            motion = [[c, s, 0.0]] if i == 0 else [[-s, c, reach], [0.0, 0.0, -1.0]][:root]
            for k, line in enumerate(motion):
                follow[first + k] = dict(zip(carriers.get(stator.carrier, ()), line, strict=False))
            if i == 1 and getattr(stator, "geometry", "linear") == "second_order":
                bent[-1] = first, squared_slope(stator)
            bodies.append(part)
            first += len(part[0])
            tip[i] = first - root
        rows.append([at, n + at, twist_row(stator.node), *tip])
    free = [i for i in range(first) if i not in follow]
    place = {i: k for k, i in enumerate(free)} | {-1: -1}
    shape = np.zeros((first, len(free)))
    shape[free, range(len(free))] = 1.0
    for i, line in follow.items():
        for j, share in line.items():
            shape[i, j] = share
    rows = [[place[i] for i in line] for line in rows]
    M, C, K = (shape.T @ block_diag(*part) @ shape for part in zip(*bodies, strict=True))
    slopes = []
    for of in bent:
        rooted = shape[of[0] : of[0] + len(of[1])] if of else None
        slopes.append(rooted.T @ of[1] @ rooted if of else None)
    force = np.zeros((2, len(M)))
    for unbalance in rotor.unbalance:
        at = 2 * (unbalance.node - 1)
        pull = spin**2 * unbalance.mass * unbalance.radius * np.exp(1j * unbalance.phase)
        force[:, at] += [pull.real, -pull.imag]  # Re and Im of pull * exp(i spin t)
        force[:, n + at] += [pull.imag, pull.real]
    weight = np.zeros(len(M))
    weight[: 2 * n] = -rotor.gravity * mass[:, :n:2].sum(axis=1)
    for load in rotor.load:
        weight[[2 * load.node - 2, n + 2 * load.node - 2]] += load.vertical, load.horizontal
    rows = np.array(rows)
    return Bodies(M, C, K, force, rows, rows[0, :3], slopes, weight)
