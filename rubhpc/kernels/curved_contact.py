"""Closed contacts whose gap is curved: the rim is round, and a bent stator draws its tip back.

The gap of a pair is that along its stator's axis, plus h, which curvature adds. While the pair is closed, h
follows from the tangential and the bending displacements alone. The tables of the fixed normal hold for the
motion plus E h, where E moves one gap and no force of contact; h, its rate and what a turning normal changes
of the forces act on their coordinates as loads, which are polynomials of degree 4 in time over a step. Their
response is exact, and the loads are found by iteration: collocation at Lobatto's five points, of order 8.
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
ALL = -1  # set of all pairs
N_NODE = 5  # of a step, its beginning and end among them
_ASIDE = 0.5 * np.sqrt(3.0 / 7.0)
NODES = np.array([0.0, 0.5 - _ASIDE, 0.5, 0.5 + _ASIDE, 1.0])  # over its length (Lobatto)
# Coefficients of the polynomials that are 1 at a node each and 0 at the others, by powers of time.
LAGRANGE = np.ascontiguousarray(np.linalg.inv(NODES[:, None] ** np.arange(N_NODE)).T)
# Their integrals over the step, and from each node to the next.
LOBATTO = np.array([1.0 / 20.0, 49.0 / 180.0, 16.0 / 45.0, 49.0 / 180.0, 1.0 / 20.0])
PARTS = np.ascontiguousarray(
    np.diff(NODES[:, None] ** np.arange(1, N_NODE + 1) / np.arange(1, N_NODE + 1), axis=0) @ LAGRANGE.T
)
# Of `CurvedWork.span`: length of the step that loads are continued from (0: none), largest force of the
# contact, time that resolves force and slip, steps before one may be longer, time since the step that loads
# are continued from began, how often the last step moved its loads, level of the steps that `system` is of
# (an only pair), whether `follow` is of the closed pairs (several).
BEFORE, LARGEST, RESOLVED, PATIENCE, PAST, SWEEPS, SOLVED, SLOPED = range(8)


class CurvedPairs(NamedTuple):
    """Pairs with a curved gap: q pairs, n reduced degrees, b bending displacements of each."""

    row: Floats  # (q, 3 + b, n), motions of each pair; rad/m^0.5 of a bending displacement, twist in rad
    gram: Floats  # (q, 3 + b, q, 3 + b), products of the rows: what unit loads on one do to another, 1/kg
    output: Floats  # (3, o, n), outputs of `ModeTables`, of displacements, velocities and accelerations
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

    used: Ints  # (p,), coordinates that are anything
    read_re: Floats  # (p, q, 3 d + 1, m), motions, their rates, the rate of twist, their accelerations free
    read_im: Floats
    bound: Floats  # (p, q, d, m), bound on the second time derivative of a motion for a unit coordinate
    shift: Floats  # (p, q, n), motion E of each closed pair that a unit h takes off
    moved: Floats  # (p, q, d + 1, q), motions that a unit h of each closed pair takes off
    accel: Floats  # (p, q, d, q), 1/s2, free accelerations that a unit h adds
    accel_rate: Floats  # (p, q, d, q), 1/s, that a unit rate of h adds
    load_re: Floats  # (p, q, 4 + b, m), rates of the coordinates under unit loads
    load_im: Floats
    node_re: Floats  # (p, n_level, 4, m), exponential of each coordinate up to the nodes after the first
    node_im: Floats
    weight_re: Floats  # (p, n_level, 4, 5, m), s, response at those nodes to loads at all of them
    weight_im: Floats
    # What is read of an only pair at those nodes, without columns where there are more pairs.
    lone: Floats  # (p, n_level, 2, m, 4 (3 d + 1)), of real and imaginary parts at the beginning
    reach: Floats  # (p, n_level, 5 (4 + b), 4 (3 d + 1)), of the loads
    reached: Floats  # (p, n_level, 4 (3 d + 1), 4 (4 + b)), the same the other way round, those to be found
    inverse_re: Floats  # (p, m), s, inverse of each exponent; 0 where that is 0
    inverse_im: Floats
    drain: Floats  # (p, 2, m, r + 2), of real and imaginary parts: what squares to the loss by damping, and
    # the force of the unbalance times the velocities, with the cosine and the sine of the shaft's angle
    sign: Floats  # (p, r), of the squares
    drain_moved: Floats  # (p, r + 2, q), what a unit rate of h takes off


class CurvedWork(NamedTuple):
    """Work space, and what a closed contact carries from step to step."""

    h: Floats  # (5, q), m, at the nodes of the step
    rate: Floats  # (5, q), m/s
    force: Floats  # (5, q), N
    slip: Floats  # (5, q), m/s
    load: Floats  # (5, q, 4 + b)
    loads: Floats  # the same in one row
    before: Floats  # (5, q, 4 + b), loads of the step that they are continued from
    gap: Floats  # (2, 5, q), of open pairs at the nodes, m, and their rates
    span: Floats  # (8,), see above
    motion: Floats  # (3, q, 3 + b), displacements, rates and free accelerations at a node
    free: Floats  # (4 (3 d + 1),), what is read of one pair at the nodes, without the loads to be found
    normal: Floats  # (2, q), along and across
    jacobian: Floats  # (q, 3 + b), of the gaps in the motions
    direction: Floats  # (q, 3 + b), of the forces
    matrix: Floats  # (q, q)
    opening: Floats  # (q,)
    active: NDArray[np.bool_]  # (q,)
    elimination: Floats  # (q, q + 1)
    course: Floats  # (5,), coefficients of what crosses zero over a step
    ahead: Floats  # (4, 5), what the loads of the step before count for at the nodes
    point: Floats  # (6, 4 q (4 + b)), rows of `curved_loads`
    transient: Floats  # (2, m), coordinates but for what follows the loads
    seen: Floats  # (r + 2,), of `CurvedTables.drain`
    whole: Floats  # (4 (3 d + 1),), with them
    power: Floats  # (5, 2), W, of damping and of the unbalance at the nodes
    state: Floats  # (2 n,), displacements and velocities at a node
    acceleration: Floats  # (n,), at a sample
    response: Floats  # (5, 2, m), rates of the coordinates under the loads at the nodes
    middle: Floats  # (2, m), coordinates at a node
    shape: Floats  # (2, q, n), Jacobian and directions of an event
    # Of `curved_newton`, at the nodes after the first, for the three states (h, rate, force) of an only pair:
    part: Floats  # (6, 3 + b), derivatives at a node
    slope: Floats  # (4, 3, 3 d + 1), of the states in what is read
    lever: Floats  # (4, 2 + b), loads of a unit of force
    answer: Floats  # (12, 4 (4 + b)), of the states in the loads
    system: Floats  # (12, 12)
    order: Ints  # (12,), its rows as they were exchanged
    unknown: Floats  # (12 q,), of any number of pairs
    # Of `curved_joint`, for several pairs (else without rows); states and forces are of the closed ones:
    systems: Floats  # (n_level, 12 q, 12 q), for steps of each length
    orders: Ints  # (n_level, 12 q)
    is_solved: NDArray[np.bool_]  # (n_level,), whether they are of the closed pairs
    exchanged: Ints  # (q,)
    follow: Floats  # (4, 3 q, 2, m), of the states in the coordinates
    push: Floats  # (4, q, 2, m), rates of the coordinates under a unit of force
    levers: Floats  # (4, q, 2 + b), loads of a unit of force
    base: Floats  # (4, 2, m), coordinates at the nodes under the loads at the beginning of the step alone
    right: Floats  # (q, 2, m)
    steep: Floats  # (q, 2 + b), slopes of h in the motions
    steeper: Floats  # (q, 2 + b), of its rate
    turn: Floats  # (q, 2 + b), of the angle of the normal
    mutual: Floats  # (q, q)
    inverse: Floats  # (q, q)
    bending: Floats  # (q, 2 + b), of the force balance of a pair in the motions of all
    balance: Floats  # (4, 3 + b), likewise in its rates and free accelerations; and on the way to them


def curved_work(q: int, n_row: int, n: int, m: int, n_loss: int, n_level: int) -> CurvedWork:
    """Work space for q pairs of `n_row` motions, n reduced degrees, m coordinates, r losses, levels."""
    nodes = np.zeros((4, N_NODE, q))
    n_unknown = (N_NODE - 1) * q * (n_row + 1)
    n_state, n_motion = 3 * (N_NODE - 1), n_row - 1
    n_joint, width = (q, m) if q > 1 else (0, 0)
    load = np.zeros((N_NODE, q, n_row + 1))
    return CurvedWork(
        h=nodes[0].copy(),
        rate=nodes[1].copy(),
        force=nodes[2].copy(),
        slip=nodes[3].copy(),
        load=load,
        loads=load.reshape(-1),
        before=np.zeros((N_NODE, q, n_row + 1)),
        gap=np.zeros((2, N_NODE, q)),
        span=np.zeros(8),
        motion=np.zeros((3, q, n_row)),
        free=np.zeros((N_NODE - 1) * (3 * n_row - 2)),
        normal=np.zeros((2, q)),
        jacobian=np.zeros((q, n_row)),
        direction=np.zeros((q, n_row)),
        matrix=np.zeros((q, q)),
        opening=np.zeros(q),
        active=np.zeros(q, dtype=np.bool_),
        elimination=np.zeros((q, q + 1)),
        course=np.zeros(N_NODE),
        ahead=np.zeros((N_NODE - 1, N_NODE)),
        point=np.zeros((6, n_unknown)),
        transient=np.zeros((2, m)),
        seen=np.zeros(n_loss + 2),
        whole=np.zeros((N_NODE - 1) * (3 * n_row - 2)),
        power=np.zeros((N_NODE, 2)),
        state=np.zeros(2 * n),
        acceleration=np.zeros(n),
        response=np.zeros((N_NODE, 2, m)),
        middle=np.zeros((2, m)),
        shape=np.zeros((2, q, n)),
        part=np.zeros((6, n_row)),
        slope=np.zeros((N_NODE - 1, 3, 3 * n_row - 2)),
        lever=np.zeros((N_NODE - 1, n_motion)),
        answer=np.zeros((n_state, (N_NODE - 1) * (n_row + 1))),
        system=np.zeros((n_state, n_state)),
        order=np.zeros(n_state, dtype=np.int64),
        unknown=np.zeros(n_state * q),
        systems=np.zeros((n_level, n_state * n_joint, n_state * n_joint)),
        orders=np.zeros((n_level, n_state * n_joint), dtype=np.int64),
        is_solved=np.zeros(n_level, dtype=np.bool_),
        exchanged=np.zeros(n_joint, dtype=np.int64),
        follow=np.zeros((N_NODE - 1, 3 * n_joint, 2, width)),
        push=np.zeros((N_NODE - 1, n_joint, 2, width)),
        levers=np.zeros((N_NODE - 1, n_joint, n_motion)),
        base=np.zeros((N_NODE - 1, 2, width)),
        right=np.zeros((n_joint, 2, width)),
        steep=np.zeros((n_joint, n_motion)),
        steeper=np.zeros((n_joint, n_motion)),
        turn=np.zeros((n_joint, n_motion)),
        mutual=np.zeros((n_joint, n_joint)),
        inverse=np.zeros((n_joint, n_joint)),
        bending=np.zeros((n_joint, n_motion)),
        balance=np.zeros((4, n_row)),
    )


@jit_inline_sum
def is_closed(mask: int, i: int) -> bool:
    """Whether pair i is among the closed ones."""
    return (mask >> i) & 1 == 1
