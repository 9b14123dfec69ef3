"""Modal form of the linear system with a given set of contacts closed, and its propagation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_inline_sum, jit_sum

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Rows of `Phases.output_*`: displacements and rates of the output node, its torsional acceleration, then
# three rows a stator tip: axial and lateral displacement, lateral rate.
N_ROTOR_ROW = 7
TWIST_ACCELERATION_ROW = 6
LATERAL_ROW, LATERAL_RATE = 1, 2


FINISHED, DIVERGED, CONTACT_UNSOLVED, PHASE_WANTED, NODES_FULL = range(5)  # outcomes

# What a call leaves in `progress` (7,) for the next one.
TIME, PHASE, WANTED, N_STEP, SAMPLED, N_NODE, ENTERED = range(7)


class Phases(NamedTuple):
    """Modal form of every set of closed contacts met so far; complex arrays as (real, imaginary) pairs.

    p phases, m modes (padded), q pairs, n reduced degrees, o output rows.
    """

    mask: Ints  # (p,), bit i set: pair i is closed
    n_mode: Ints  # (p,), the modes proper; then the unbalance response, then the constant
    switch_re: Floats  # (p, q, m), gap of an open pair, m; force of a closed one, N
    switch_im: Floats
    rate_re: Floats  # (p, q, m), its time derivative
    rate_im: Floats
    bound: Floats  # (p, q, m), bound on its second time derivative for a unit coordinate
    power_re: Floats  # (p, n_level, m), exponential of each mode over 2^level ticks
    power_im: Floats
    output_re: Floats  # (p, o, m)
    output_im: Floats
    slip_re: Floats  # (p, q, m), slip speed, m/s
    slip_im: Floats
    motion_re: Floats  # (p, 2 n, m), reduced displacements, then velocities
    motion_im: Floats
    enter_re: Floats  # (p, 2 n, m), modal coordinates of a unit displacement or velocity
    enter_im: Floats
    enter_cosine: Floats  # (p, 2, m), part of the unbalance response to take off, times cos(angle)
    enter_sine: Floats  # (p, 2, m), times sin(angle)
    enter_constant: Floats  # (p, 2, m)


class Nodes(NamedTuple):
    """Instants kept for what is measured later: every sample, and both ends of every step in contact."""

    tick: Ints  # (n_node,)
    phase: Ints  # (n_node,)
    is_sample: NDArray[np.bool_]  # (n_node,)
    is_entry: NDArray[np.bool_]  # (n_node,), the phase begins here: no step leads to it
    z: Floats  # (n_node, 2, m), modal coordinates


class Reduced(NamedTuple):
    """The linear bodies in a basis in which the mass matrix is the identity."""

    stiffness: Floats  # (n, n)
    damping: Floats  # (n, n), D + spin G
    circulation: Floats  # (n, n), skew part of K
    force_cosine: Floats  # (n,)
    force_sine: Floats  # (n,)
    push: Floats  # (q, n), rate of a gap with the motion
    pull: Floats  # (q, n), force on the motion of a unit contact force, friction included
    answer: Floats  # (q, q), push @ pull.T, 1/kg
    friction: Floats  # (q,), coefficient, not negative
    radius: Floats  # (q,), m


class Clock(NamedTuple):
    """How time is counted."""

    spin: float  # rad/s
    tick: float  # s
    ticks_per_sample: int
    samples_per_revolution: int
    blind_level: int  # steps up to 2^level ticks need no bound; they are checked at their end
    contact_level: int  # longest step with a pair closed while recording
    end_tick: int  # the record's end


@jit_inline_sum
def dot(re: Floats, im: Floats, z_re: Floats, z_im: Floats) -> float:
    """Real part of a row's product with the modal coordinates."""
    total = 0.0
    for k in range(z_re.size):
        total += re[k] * z_re[k] - im[k] * z_im[k]
    return total


@jit_inline_sum
def bounded(weight: Floats, z_re: Floats, z_im: Floats) -> float:
    """Bound on a second derivative: the modes' sizes, weighted, however their phases fall."""
    total = 0.0
    for k in range(z_re.size):
        total += weight[k] * (abs(z_re[k]) + abs(z_im[k]))
    return total


@jit_inline_sum
def propagate(re: Floats, im: Floats, z_re: Floats, z_im: Floats, next_re: Floats, next_im: Floats) -> None:
    """Modal coordinates after a tabulated step."""
    for k in range(z_re.size):
        a, b = z_re[k], z_im[k]
        next_re[k] = re[k] * a - im[k] * b
        next_im[k] = re[k] * b + im[k] * a


@jit_sum
def enter(phases: Phases, p: int, cosine: float, sine: float, motion: Floats, z: Floats) -> None:
    """Modal coordinates `z` (2, m) in phase p of a motion (2 n,) at the shaft's angle."""
    for part in range(2):
        rows = phases.enter_re[p] if part == 0 else phases.enter_im[p]
        target = z[part]
        target[:] = (
            -phases.enter_cosine[p, part] * cosine
            - phases.enter_sine[p, part] * sine
            - phases.enter_constant[p, part]
        )
        for row in range(motion.size):
            value = motion[row]
            source = rows[row]
            for k in range(target.size):
                target[k] += source[k] * value
    first = phases.n_mode[p]
    z[0, first], z[1, first] = cosine, sine
    z[0, first + 1], z[1, first + 1] = 1.0, 0.0


@jit_sum
def find_phase(mask: Ints, wanted: int) -> int:
    """Index of the phase with the wanted set of closed pairs; -1 where it is not tabulated yet."""
    for p in range(mask.size):
        if mask[p] == wanted:
            return p
    return -1


@jit_inline_sum
def keep_node(
    tick: Ints,
    phase: Ints,
    is_sample: NDArray[np.bool_],
    is_entry: NDArray[np.bool_],
    kept: Floats,
    progress: Ints,
    t: int,
    p: int,
    sampled: bool,
    entered: bool,
    z: Floats,
) -> None:
    """Append an instant to the nodes, whose fields come one by one for speed."""
    k = progress[N_NODE]
    tick[k], phase[k], is_sample[k], is_entry[k] = t, p, sampled, entered
    for part in range(2):
        for i in range(z.shape[1]):
            kept[k, part, i] = z[part, i]
    progress[N_NODE] = k + 1


@jit_inline_sum
def floor_log2(count: int) -> int:
    """Largest level with 2^level <= count; count at least 1."""
    level = 0
    while count >> (level + 1) > 0:
        level += 1
    return level


@jit_inline_sum
def proved_time(
    switch_re: Floats,
    switch_im: Floats,
    rate_re: Floats,
    rate_im: Floats,
    bound: Floats,
    p: int,
    z_re: Floats,
    z_im: Floats,
) -> float:
    """Time, s, in which no switch function of phase p can reach zero; tables come one by one for speed."""
    proved = np.inf
    for i in range(switch_re.shape[1]):
        s = dot(switch_re[p, i], switch_im[p, i], z_re, z_im)
        rate = dot(rate_re[p, i], rate_im[p, i], z_re, z_im)
        b = bounded(bound[p, i], z_re, z_im)
        if not s > 0.0:
            proved = 0.0
        elif b > 0.0:
            proved = min(proved, (rate + np.sqrt(rate * rate + 2.0 * b * s)) / b)
        elif rate < 0.0:
            proved = min(proved, -s / rate)
    return proved
