"""What the collocation integrator works on: bodies and pairs, tables of steps, state and work space.

Between contacts the bodies are linear: real coordinates `x` (nx,) of their modes with every pair open, the
real parts of the complex modes, their imaginary parts, then the real modes. The response to the unbalance
is a complex mode of its own, on which no load acts. Each pair has local motions: `ALONG` the axis of its
stator and `ACROSS` it (tip against disc), the `TWIST` of the rim (r_d theta), and the `BENDING` amplitudes,
whose squares add up to twice the foreshortening of a beam. The local motions of all pairs are R rows.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numba import config
from numpy.typing import NDArray

from rubhpc.kernels._struct import Struct
from rubhpc.kernels.laws import Law  # noqa: TC001 - part of a kernel's signature

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Ints = NDArray[np.int64]

ALONG, ACROSS, TWIST, BENDING = range(4)
FIXED, ROUND = range(2)  # gap: along the axis of the stator, or along the line of centres, also of a bore
OPEN, FORWARD, BACKWARD, STICKING = 0, 1, -1, 2  # state of a pair; slip is positive in steady sliding
NORMAL, FRICTION = range(2)  # force of a pair, and event of a pair
JAMMED, UNCONVERGED, ENDLESS, SINGULAR = range(1, 5)  # why a case cannot continue (`Memory.why`)


class Nodes(Struct):
    """Lobatto's s nodes on [0, 1], the first at 0 and the last at 1, and what polynomials on them need."""

    at: Floats  # (s,)
    power: Floats  # (s, s), coefficients of node j's basis polynomial: of 1, x, x^2...
    integral: Floats  # (s, s), of node j's basis polynomial from 0 to node i
    end_slope: Floats  # (s,), derivative of node j's basis polynomial at 1
    legendre: Floats  # (s, s), coefficients of Legendre's polynomials on [0, 1] from values at the nodes
    bernstein: Floats  # (s, s), those of Bernstein's
    hermite: Floats  # (s + 2, s + 2), powers from values at the nodes and slopes at both ends


class Bodies(Struct):
    """Modes with every pair open, and the pairs of a case."""

    exponent: Complexes  # (nm,), 1/s: complex modes first
    n_complex: int
    n_local: int  # local motions of a pair
    local: Floats  # (3 R, nx), local motions, their velocities and free accelerations
    load: Complexes  # (R, nm), rate of each mode by a unit load on a local motion
    kick: Floats  # (R, nx), the same of the coordinates
    bend: Floats  # (R, nm), bound on the acceleration of a local motion by a unit mode, 1/s2
    compliance: Floats  # (R, R), acceleration of a local motion by a unit load, 1/kg
    reach: Floats  # (R, R), the sum of what each mode contributes to it, in size
    kind: Ints  # (q,), FIXED or ROUND
    is_straight: bool  # all gaps are linear in the local motions
    radius: Floats  # (q,), of the rim, m; of a bore its clearance, negative
    clearance: Floats  # (q,), along the axis at rest, m
    aside: Floats  # (q,), of the tip at rest from the axis through the disc, m
    space: Floats  # (q, 2, 2), up and horizontally (rows), of what is along the axis and across it
    rim_speed: Floats  # (q,), m/s, not negative
    friction: Floats  # (q,), coefficient
    normal_law: Ints  # (q,), of `laws.NORMAL_LAWS`
    stiffness: Floats  # (q,), N/m, or N/m^1.5 of Hertz
    damping: Floats  # (q,), N s/m, or s/m of Hertz
    restitution: Floats  # (q,)
    law: Law  # of friction
    may_stick: bool  # friction may stick and reverse
    depends_on_slip: bool  # the coefficient of friction depends on the slip
    translations: Floats  # (t, nx), displacements that are compared with the limit
    displacement_limit: float  # m


class Tables(Struct):
    """Steps of 2^(first_level + slot) ticks, filled when first taken.

    Rows y of a step: of each pair the local displacements at the nodes after the first, velocities at the
    last node, then at those between, and accelerations at the last (`tables.row_of`).
    """

    first_level: int
    tick: float  # s
    fading_time: float  # s, in which the error fades with which a closed gap begins a step
    is_filled: NDArray[np.bool_]  # (k,)
    turn: Complexes  # (k, nm), exponential over the step
    free: Floats  # (k, ny, nx), y from the coordinates
    forced: Floats  # (k, s R, ny), y from the loads at the nodes
    end: Floats  # (k, s R, nx), coordinates at the end from the loads
    fade: Floats  # (k, s, 4), of an error of the gap, of its rate, and the rates of both, at the nodes


GAP, RATE, SLIP, TURNED, WIDENED, BEND = range(6)  # of a pair at a node: columns of `seen` and `changed`
OF_RATE, OF_SLIP, OF_BEND = range(3)  # their slopes in the local displacements: rows of `bent`
BY_GAP, BY_RATE, BY_GAP_TWICE, BY_BOTH = range(4)  # slopes of a spring law: columns of `slope`
RATIO, RATIO_SLOPE = 0, 1  # of friction: columns of `ratio`
MATRIX, N_NEAR = range(2)  # the matrix, and how many pairs are closed or may touch: items of `used`


class Solution(Struct):
    """Work space of a step. Matrices are kept for each length of step, with the states of the pairs."""

    start: Floats  # (3 R,), local motions, velocities and free accelerations at the beginning
    y: Floats  # (ny,)
    y_free: Floats  # (ny,), without loads
    place: Floats  # (s, R), local displacements at the nodes, by which the loads turn
    load: Floats  # (s R,)
    gap: Floats  # (s q,), m
    curvature: Floats  # (s q,), of the locus of zero gap, 1/m
    unit: Floats  # (s q, 2), normal along the axis and across it
    normal: Floats  # (s q, n_local), slope of the gap
    tangent: Floats  # (s q, n_local), less the slope of the slip
    normal_bend: Floats  # (n_local, n_local), derivative of the normal
    tangent_bend: Floats  # (n_local, n_local)
    seen: Floats  # (s q, 6), see `GAP`
    slope: Floats  # (s q, 4), see `BY_GAP`
    ratio: Floats  # (s q, 2)
    bent: Floats  # (s q, 3, n_local), see `OF_RATE`
    turning: Floats  # (s q, n_local, n_local), change of a load with the local motions
    direction: Floats  # (s q, 2, n_local), of unknown forces
    residual: Floats  # (n,)
    closed: Ints  # (q,), the closed pairs, then open ones that may touch in the step
    size: Floats  # (nm,), of modes
    answer: Floats  # (n,), change of the unknowns
    rows: Floats  # (n, 2 n), a matrix beside the identity
    matrix: Floats  # (k m, n, n), inverses, transposed: m of each length of step
    states: Ints  # (k m,), states of the pairs with which a matrix was made, as one number; 0: none
    noise: Floats  # (k m,), force that the rounding of displacements causes, N
    used: Ints  # (2,), of the last step: see `MATRIX`
    change: Floats  # (ny,), of y
    moved: Floats  # (s, R), of `place`
    begun: Floats  # (3 R,), of `start`
    pushed: Floats  # (q, 2, s), of the forces
    changed: Floats  # (s, 6), of what is seen of a pair
    guess: Floats  # (q, 2, s), forces
    weight: Floats  # (s,)
    instant: Floats  # (q, 2), forces
    turned: Floats  # (3, q), smallest gap where it turns in flight; gap and rate at the last look
    looked: Ints  # (1,), tick of that look
    touching: NDArray[np.bool_]  # (q,), pairs that an impact may press
    kept: NDArray[np.bool_]  # (q,), those of them that were closed before
    bound: NDArray[np.bool_]  # (q,), those of them that an impact does not open
    waiting: NDArray[np.bool_]  # (q,), pairs that may stick or slip
    event: Floats  # (q, 2, s), event functions
    after: Floats  # (nx,)
    held: Floats  # (nx,), coordinates at the last look of a flight
    turn: Complexes  # (nm,)
    impulse: Floats  # (q, 2)
    speed: Floats  # (q, 2), gap rate and slip before an impact


class CaseState(Struct):
    """State of a case between kernel calls."""

    x: Floats  # (nx,)
    state: Ints  # (q,)
    force: Floats  # (q, 2, s), polynomials of the last step
    lasting: Floats  # (q,), s, of the last contact of each pair
    since: Ints  # (q,), tick at which a pair has closed, or opened


class Memory(Protocol):
    """Numbers of a case that one kernel call leaves for the next (a record, changed in place)."""

    slot: int  # of the next step
    length: int  # ticks of the last step; 0: forces are constants
    part: float  # of that step that was taken
    scale: float  # N, largest force of the contact so far
    fastest: float  # m/s, largest rate of approach
    unseen: int  # ticks of a flight that are taken without looking for a touch
    n_at_once: int  # events at one tick
    event_tick: int  # of the last one
    is_new: int  # what is to be found as a case begins: `march.KNOWN`
    least: float  # m/s, rate of approach below which the last impact had no restitution
    has_impulses: int  # whether the last event had impulses
    why: int  # why the case cannot continue, such as JAMMED


_RECORD = np.dtype(
    [(name, np.float64 if kind == "float" else np.int64) for name, kind in Memory.__annotations__.items()]
)


def new_memory() -> NDArray[np.void]:
    """Numbers (1,) of a case that begins."""
    memory = np.zeros(1, _RECORD)
    return memory.view(np.recarray) if config.DISABLE_JIT else memory  # type: ignore[attr-defined]


def _lobatto(s: int) -> Floats:
    inner = np.polynomial.legendre.Legendre.basis(s - 1).deriv().roots()
    return np.concatenate([[0.0], (np.sort(inner.real) + 1.0) / 2.0, [1.0]])


def lobatto_nodes(s: int) -> Nodes:
    """Polynomials on s nodes."""
    at, order = _lobatto(s), np.arange(s)
    power: Floats = np.linalg.inv(np.vander(at, increasing=True)).T.astype(float)
    comb = np.array(
        [[math.comb(i, m) / math.comb(s - 1, m) if m <= i else 0.0 for m in order] for i in order]
    )
    values = np.vander(at, s + 2, increasing=True)
    slopes = np.array([np.eye(s + 2)[1], np.arange(s + 2.0)])
    legendre: Floats = np.linalg.inv(np.polynomial.legendre.legvander(2.0 * at - 1.0, s - 1)).astype(float)
    integral = (at[:, None] ** (order + 1) / (order + 1)) @ power.T
    return Nodes(
        at=at,
        power=np.ascontiguousarray(power),
        integral=integral,
        end_slope=power @ order.astype(float),
        legendre=np.ascontiguousarray(legendre),
        bernstein=comb @ power.T,
        hermite=np.linalg.inv(np.vstack([values, slopes])),
    )
