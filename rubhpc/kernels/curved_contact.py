"""Closed contacts with curved gaps: the rim is round, and bending draws a stator's tip back.

The gap of a pair is the gap along its stator's axis plus a height h from curvature. While the pair is closed,
h depends on the tangential and bending displacements alone. The tables of the fixed normal are valid for the
motion plus E h, where E changes one gap and no contact force. Three quantities act on the coordinates as
loads: h, its rate, and the changes of the forces by the turning normal. The loads are polynomials of degree 4
in time over a step. The response to them is exact, and the loads are found by iteration: collocation at
Lobatto's five points, of order 8.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked_sum
from rubhpc.kernels._struct import Struct

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Motions of a pair, in this order: tip against disc along the stator's axis and across it (with the rim);
# the bending displacements, whose squares add up to twice the foreshortening; last the twist of the disc.
ALONG, ACROSS, BENDING = range(3)
# Loads of a pair: h, its rate, and the changes of the contact force along, across and on each bending.
HEIGHT, HEIGHT_RATE, LOAD_ALONG, LOAD_ACROSS, LOAD_BENDING = range(5)
ALL = -1  # set of all pairs
N_NODE = 5  # of a step, including its ends
_ASIDE = 0.5 * np.sqrt(3.0 / 7.0)
NODES = np.array([0.0, 0.5 - _ASIDE, 0.5, 0.5 + _ASIDE, 1.0])  # over its length (Lobatto)
# Coefficients of the Lagrange polynomials of the nodes, by powers of time.
LAGRANGE = np.ascontiguousarray(np.linalg.inv(NODES[:, None] ** np.arange(N_NODE)).T)
# Their integrals over the step, and from each node to the next.
LOBATTO = np.array([1.0 / 20.0, 49.0 / 180.0, 16.0 / 45.0, 49.0 / 180.0, 1.0 / 20.0])
PARTS = np.ascontiguousarray(
    np.diff(NODES[:, None] ** np.arange(1, N_NODE + 1) / np.arange(1, N_NODE + 1), axis=0) @ LAGRANGE.T
)
# Indices of `CurvedWork.span`: length of the step from which loads are extrapolated (0: none); largest force
# of the contact; time that resolves force and slip; steps before a longer one is allowed; time since the
# beginning of the step from which loads are extrapolated; sweeps of the last step; level of the steps for
# which `system` is valid (a single pair); whether `follow` is valid for the closed pairs (several); pace
# above which modes go on as they were where a mode is entered next, 1/s (0: none do).
BEFORE, LARGEST, RESOLVED, PATIENCE, PAST, SWEEPS, SOLVED, SLOPED, KEPT = range(9)


class CurvedPairs(Struct):
    """Pairs with a curved gap: q pairs, n reduced degrees, b bending displacements of each."""

    row: Floats  # (q, 3 + b, n), motions of each pair; rad/m^0.5 of a bending displacement, twist in rad
    gram: Floats  # (q, 3 + b, q, 3 + b), products of the rows: response of one to unit loads on another, 1/kg
    output: Floats  # (3, o, n), outputs of `ModeTables`, of displacements, velocities and accelerations
    skew: Floats  # (n, n), skew part of the stiffness; no rows where it is zero
    radius: Floats  # (q,), m
    clearance: Floats  # (q,), at rest, m
    aside: Floats  # (q,), lateral offset of a tip at rest from its axis through the disc, m
    friction: Floats  # (q,), coefficient, with the sign of the spin
    stiffness: Floats  # (q,), converts a gap to a force in the error control, N/m
    leverage: Floats  # (q, b), m^-0.5, converts a load on the bending to a lateral force on the tip
    is_round: bool  # the normal follows the line of centres; else it is the stator's axis
    sense: float  # 1 or -1, of the spin


class CurvedTables(Struct):
    """Further tables of p contact modes for curved gaps; m coordinates, d = 2 + b motions and twist."""

    used: Ints  # (p,), number of coordinates that are not padding
    read_re: Floats  # (p, q, 3 d + 1, m), motions, their rates, the rate of twist, their accelerations free
    read_im: Floats
    bound: Floats  # (p, q, d, m), bound on the second time derivative of a motion for a unit coordinate
    shift: Floats  # (p, q, n), motion E of each closed pair, subtracted for a unit h
    moved: Floats  # (p, q, d + 1, q), motions subtracted for a unit h of each closed pair
    accel: Floats  # (p, q, d, q), 1/s2, free accelerations by a unit h
    accel_rate: Floats  # (p, q, d, q), 1/s, by a unit rate of h
    load_re: Floats  # (p, q, 4 + b, m), rates of the coordinates under unit loads
    load_im: Floats
    exponent_re: Floats  # (p, m), 1/s
    exponent_im: Floats
    # Of steps of each length, filled as the first one is taken (`curved_levels`):
    is_filled: NDArray[np.bool_]  # (p, n_level)
    node_re: Floats  # (p, n_level, 4, m), exponential of each coordinate up to the nodes after the first
    node_im: Floats
    weight_re: Floats  # (p, n_level, 4, 5, m), s, response at those nodes to loads at all of them
    weight_im: Floats
    # Readings of a single pair at those nodes, with what unit loads give of each coordinate; no columns where
    # there are more pairs.
    seen_re: Floats  # (p, 4 + b, 3 d + 1, m)
    seen_im: Floats
    lone: Floats  # (p, n_level, 2, m, 4 (3 d + 1)), from real and imaginary parts at the beginning
    reach: Floats  # (p, n_level, 5 (4 + b), 4 (3 d + 1)), from the loads
    reached: Floats  # (p, n_level, 4 (3 d + 1), 4 (4 + b)), the same transposed, for the unknown loads
    inverse_re: Floats  # (p, m), s, inverse of each exponent; 0 where that is 0
    inverse_im: Floats
    drain: Floats  # (p, 2, m, r + 2), from real and imaginary parts: roots of the loss by damping, then
    # the force of the unbalance times the velocities, with the cosine and the sine of the shaft's angle
    sign: Floats  # (p, r), of the squares
    drain_moved: Floats  # (p, r + 2, q), subtracted for a unit rate of h


class CurvedWork(Struct):
    """Work space, and the state of closed contacts between steps."""

    h: Floats  # (5, q), m, at the nodes of the step
    rate: Floats  # (5, q), m/s
    force: Floats  # (5, q), N
    slip: Floats  # (5, q), m/s
    load: Floats  # (5, q, 4 + b)
    loads: Floats  # the same, flat
    before: Floats  # (5, q, 4 + b), loads of the step from which they are extrapolated
    gap: Floats  # (2, 5, q), of open pairs at the nodes, m, and their rates
    span: Floats  # (9,), see above
    motion: Floats  # (3, q, 3 + b), displacements, rates and free accelerations at a node
    free: Floats  # (4 (3 d + 1),), readings of a single pair at the nodes, without the unknown loads
    normal: Floats  # (2, q), along and across
    jacobian: Floats  # (q, 3 + b), of the gaps in the motions
    direction: Floats  # (q, 3 + b), of the forces
    matrix: Floats  # (q, q)
    opening: Floats  # (q,)
    active: NDArray[np.bool_]  # (q,)
    elimination: Floats  # (q, q + 1)
    course: Floats  # (5,), coefficients of the function whose zero in a step is sought
    ahead: Floats  # (4, 5), weights of the loads of the step before at the nodes
    point: Floats  # (6, 4 q (4 + b)), rows of `curved_loads`
    transient: Floats  # (2, m), coordinates without the quasi-static response to the loads
    seen: Floats  # (r + 2,), of `CurvedTables.drain`
    whole: Floats  # (4 (3 d + 1),), readings with the unknown loads
    power: Floats  # (5, 2), W, of damping and of the unbalance at the nodes
    state: Floats  # (2 n,), displacements and velocities at a node
    acceleration: Floats  # (n,), at a sample
    response: Floats  # (5, 2, m), rates of the coordinates under the loads at the nodes
    middle: Floats  # (2, m), coordinates at a node
    shape: Floats  # (2, q, n), Jacobian and directions of an event
    # For `curved_newton`, at the nodes after the first, for the three states (h, rate, force) of a single
    # pair:
    part: Floats  # (6, 3 + b), derivatives at a node
    slope: Floats  # (4, 3, 3 d + 1), derivatives of the states by the readings
    lever: Floats  # (4, 2 + b), loads by a unit of force
    answer: Floats  # (12, 4 (4 + b)), derivatives of the states by the loads
    system: Floats  # (12, 12)
    order: Ints  # (12,), row exchanges
    unknown: Floats  # (12 q,), of any number of pairs
    # For `curved_joint`, of several pairs (else no rows); states and forces are those of the closed pairs:
    systems: Floats  # (n_level, 12 q, 12 q), for steps of each length
    orders: Ints  # (n_level, 12 q)
    is_solved: NDArray[np.bool_]  # (n_level,), whether they are valid for the closed pairs
    exchanged: Ints  # (q,)
    follow: Floats  # (4, 3 q, 2, m), derivatives of the states by the coordinates
    push: Floats  # (4, q, 2, m), rates of the coordinates by a unit of force
    levers: Floats  # (4, q, 2 + b), loads by a unit of force
    base: Floats  # (4, 2, m), coordinates at the nodes under the loads of the step's beginning alone
    right: Floats  # (q, 2, m)
    steep: Floats  # (q, 2 + b), derivatives of h by the motions
    steeper: Floats  # (q, 2 + b), of its rate
    turn: Floats  # (q, 2 + b), of the angle of the normal
    mutual: Floats  # (q, q)
    inverse: Floats  # (q, q)
    bending: Floats  # (q, 2 + b), derivatives of the force balance of a pair by the motions of all
    balance: Floats  # (4, 3 + b), likewise by rates and free accelerations; intermediate results


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
        span=np.zeros(9),
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


@linked_sum
def is_closed(mask: int, i: int) -> bool:
    """Whether pair i is closed."""
    return (mask >> i) & 1 == 1
