"""Closed contacts whose gap is curved: the rim is round, and a bent stator draws its tip back.

The gap of a pair is that along its stator's axis, plus h, which curvature adds. While the pair is closed, h
follows from the tangential and the bending displacements alone. The tables of the fixed normal hold for the
motion plus E h, where E moves one gap and no force of contact; h, its rate and what a turning normal changes
of the forces act on their coordinates as loads, which are quadratic in time over a step. Their response is
exact, and the loads are found by iteration: collocation at the beginning, the middle and the end (Lobatto),
of order 4.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_inline_sum

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Motions of a pair, in this order: tip against disc along the stator's axis and across it (with the rim);
# the bending displacements, whose squares add up to twice the foreshortening; last the twist of the disc.
ALONG, ACROSS, BENDING = range(3)
# Loads of a pair: h, its rate, and the changes of the contact force along, across and on each bending.
HEIGHT, HEIGHT_RATE, LOAD_ALONG, LOAD_ACROSS, LOAD_BENDING = range(5)
N_NODE = 3  # beginning, middle and end of a step
BEFORE, LARGEST, RESOLVED = range(3)  # of `CurvedWork.span`; last the time that resolves force and slip, s


class CurvedPairs(NamedTuple):
    """Pairs with a curved gap: q pairs, n reduced degrees, b bending displacements of each."""

    row: Floats  # (q, 3 + b, n), motions of each pair; rad/m^0.5 of a bending displacement, twist in rad
    gram: Floats  # (q, 3 + b, q, 3 + b), products of the rows: what unit loads on one do to another, 1/kg
    output: Floats  # (3, o, n), outputs of `ModeTables`, of displacements, velocities and accelerations
    resisting: Floats  # (n, n), symmetric part of the damping
    skew: Floats  # (n, n), skew part of the stiffness; without rows where there is none
    radius: Floats  # (q,), m
    clearance: Floats  # (q,), at rest, m
    aside: Floats  # (q,), how far a tip at rest stands aside of its axis through the disc, m
    friction: Floats  # (q,), coefficient, with the sign of the spin
    stiffness: Floats  # (q,), that turns a gap into a force for the control of errors, N/m
    leverage: Floats  # (q, b), m^-0.5, that turns a load on the bending into a lateral force on the tip
    is_round: bool  # the normal follows the line of centres; else it is the stator's axis
    sense: float  # 1 or -1, of the spin


class CurvedTables(NamedTuple):
    """What the tables of p contact modes lack for curved gaps; m coordinates, d = 2 + b motions and twist."""

    read_re: Floats  # (p, q, 3 d + 1, m), motions, their rates, the rate of twist, their accelerations free
    read_im: Floats
    bound: Floats  # (p, q, d, m), bound on the second time derivative of a motion for a unit coordinate
    shift: Floats  # (p, q, n), motion E of each closed pair that a unit h takes off
    moved: Floats  # (p, q, d + 1, q), motions that a unit h of each closed pair takes off
    accel: Floats  # (p, q, d, q), 1/s2, free accelerations that a unit h adds
    accel_rate: Floats  # (p, q, d, q), 1/s, that a unit rate of h adds
    load_re: Floats  # (p, q, 4 + b, m), rates of the coordinates under unit loads
    load_im: Floats
    weight_re: Floats  # (p, n_level, 2, 3, m), s, response in the middle and at the end to loads at the nodes
    weight_im: Floats
    reach: Floats  # (p, n_level, 2, 3, 3 d + 1, 4 + b), what the loads add to what is read of a lone pair
    half_re: Floats  # (p, m), exponential of each coordinate over half a tick
    half_im: Floats
    inverse_re: Floats  # (p, m), s, inverse of each exponent; 0 where that is 0
    inverse_im: Floats


class CurvedWork(NamedTuple):
    """Work space, and what a closed contact carries from step to step."""

    h: Floats  # (3, q), m, at the nodes of the step
    rate: Floats  # (3, q), m/s
    force: Floats  # (3, q), N
    slip: Floats  # (3, q), m/s
    load: Floats  # (3, q, 4 + b)
    before: Floats  # (3, q, 4 + b), loads of the step before
    gap: Floats  # (2, 3, q), of open pairs at the nodes, m, and their rates
    span: Floats  # (3,), s, length of the step before (0: none); largest force of the contact, N; `RESOLVED`
    motion: Floats  # (3, q, 3 + b), displacements, rates and free accelerations at a node
    free: Floats  # (2, 3 d + 1), what is read in the middle and at the end without the loads, of one pair
    normal: Floats  # (2, q), along and across
    jacobian: Floats  # (q, 3 + b), of the gaps in the motions
    direction: Floats  # (q, 3 + b), of the forces
    matrix: Floats  # (q, q)
    opening: Floats  # (q,)
    active: NDArray[np.bool_]  # (q,)
    elimination: Floats  # (q, q + 1)
    last: Floats  # (q, 4 + b), loads at a node before they are computed again
    transient: Floats  # (2, m), coordinates that go on by themselves, of the motion that loads leave
    later: Floats  # (2, m), the same at a later node
    driven: Floats  # (2, m), the others, at a node
    power: Floats  # (3, 2), W, of damping and of the unbalance at the nodes, in the driven motion
    crossed: Floats  # (3, 2, m), power that damping takes of the transient for a unit of each coordinate
    state: Floats  # (2 n,), displacements and velocities at a node
    acceleration: Floats  # (n,), at a sample
    response: Floats  # (3, 2, m), rates of the coordinates under the loads at the nodes
    middle: Floats  # (2, m)
    shape: Floats  # (2, q, n), Jacobian and directions of an event


def curved_work(q: int, n_row: int, n: int, m: int) -> CurvedWork:
    """Work space for q pairs of `n_row` motions, n reduced degrees and m coordinates."""
    nodes = np.zeros((4, N_NODE, q))
    return CurvedWork(
        h=nodes[0].copy(),
        rate=nodes[1].copy(),
        force=nodes[2].copy(),
        slip=nodes[3].copy(),
        load=np.zeros((N_NODE, q, n_row + 1)),
        before=np.zeros((N_NODE, q, n_row + 1)),
        gap=np.zeros((2, N_NODE, q)),
        span=np.zeros(3),
        motion=np.zeros((3, q, n_row)),
        free=np.zeros((2, 3 * n_row - 2)),
        normal=np.zeros((2, q)),
        jacobian=np.zeros((q, n_row)),
        direction=np.zeros((q, n_row)),
        matrix=np.zeros((q, q)),
        opening=np.zeros(q),
        active=np.zeros(q, dtype=np.bool_),
        elimination=np.zeros((q, q + 1)),
        last=np.zeros((q, n_row + 1)),
        transient=np.zeros((2, m)),
        later=np.zeros((2, m)),
        driven=np.zeros((2, m)),
        power=np.zeros((N_NODE, 2)),
        crossed=np.zeros((N_NODE, 2, m)),
        state=np.zeros(2 * n),
        acceleration=np.zeros(n),
        response=np.zeros((N_NODE, 2, m)),
        middle=np.zeros((2, m)),
        shape=np.zeros((2, q, n)),
    )


@jit_inline_sum
def is_closed(mask: int, i: int) -> bool:
    """Whether pair i is among the closed ones."""
    return (mask >> i) & 1 == 1
