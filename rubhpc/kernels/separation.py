"""Two neighbouring motions of one case by the exact integrator: how far they part over a span."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_sum
from rubhpc.kernels.contact_modes import FINISHED, N_EVENT, PHASE, TIME, WANTED, Clock, Phases, Reduced, dot
from rubhpc.kernels.event_loop import advance

if TYPE_CHECKING:
    from rubhpc.kernels.accumulators import Samples, Tally
    from rubhpc.kernels.measuring import Recorder

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

DISPLACED = 1e-5  # of the motion: far above the resolution of events, far below the motion's features
LOST = 1e-6  # of the displacement: what is left is rounding


class Pair(NamedTuple):
    """A motion and its neighbour, m modal coordinates and n reduced degrees."""

    progress: Ints  # (2, N_PROGRESS), as `kernels.phases` has it
    z: Floats  # (2, 2, m)
    z_next: Floats  # (2, m), work space
    motion: Floats  # (2, 2 n), reduced displacements and velocities where a phase is to be entered
    size: Floats  # (1,), of the displacement that a span begins with; 0: none yet
    ratio: Floats  # (n_span,), distance at a span's end over that at its beginning
    n_done: Ints  # (1,), spans passed


@jit_sum
def part(
    phases: Phases,
    reduced: Reduced,
    clock: Clock,
    n_tick: int,
    pair: Pair,
    recorder: Recorder,
    samples: Samples,
    tally: Tally,
) -> int:
    """Advance both motions by spans of `n_tick`, whole revolutions, until `pair.ratio` is full.

    After each span the neighbour is brought back to where it began. Distance is the root of
    v'v + spin^2 u'u in reduced coordinates, in which the mass matrix is the identity.

    Returns
    -------
    int
        An outcome of `kernels.modal.advance`; with PHASE_WANTED call again once the phase is tabulated.
    """
    progress = pair.progress
    if pair.size[0] == 0.0:
        read_motion(phases, progress[0, PHASE], pair.z[0], pair.motion[0])
        displace(phases, clock.spin, pair)
    while pair.n_done[0] < pair.ratio.size:
        for k in range(2):
            if progress[k, TIME] < n_tick or progress[k, WANTED] >= 0:
                outcome = advance(
                    phases,
                    reduced,
                    clock,
                    progress[k, TIME],
                    n_tick,
                    False,
                    progress[k],
                    pair.z[k],
                    pair.z_next,
                    pair.motion[k],
                    recorder,
                    samples,
                    tally,
                )
                if outcome != FINISHED:
                    return outcome
        for k in range(2):
            read_motion(phases, progress[k, PHASE], pair.z[k], pair.motion[k])
        ratio = distance(pair.motion, clock.spin) / pair.size[0]
        pair.ratio[pair.n_done[0]] = ratio
        pair.n_done[0] += 1
        if ratio > LOST:
            bring_back(phases, ratio, pair)
        else:
            displace(phases, clock.spin, pair)
        progress[:, TIME], progress[:, N_EVENT] = 0, 0
    return FINISHED


@jit_sum
def read_motion(phases: Phases, p: int, z: Floats, motion: Floats) -> None:
    """Fill `motion` (2 n,) from the modal coordinates of phase p."""
    for k in range(motion.size):
        motion[k] = dot(phases.motion_re[p, k], phases.motion_im[p, k], z[0], z[1])


@jit_sum
def distance(motion: Floats, spin: float) -> float:
    """Root of v'v + spin^2 u'u of the difference of two motions (2, 2 n)."""
    n = motion.shape[1] // 2
    square = 0.0
    for k in range(n):
        u, v = motion[1, k] - motion[0, k], motion[1, n + k] - motion[0, n + k]
        square += v * v + spin * spin * u * u
    return float(np.sqrt(square))


@jit_sum
def displace(phases: Phases, spin: float, pair: Pair) -> None:
    """Make the neighbour the motion itself, a little faster, so that closed gaps stay closed."""
    n = pair.motion.shape[1] // 2
    for k in range(n):
        pair.motion[1, k] = pair.motion[0, k]
        pair.motion[1, n + k] = (1.0 + DISPLACED) * pair.motion[0, n + k]
    pair.size[0] = distance(pair.motion, spin)
    pair.progress[1, WANTED] = phases.mask[pair.progress[0, PHASE]]


@jit_sum
def bring_back(phases: Phases, ratio: float, pair: Pair) -> None:
    """Take the neighbour to 1 / ratio of its distance from the motion, and the contact forces with it."""
    wanted = 0
    for i in range(phases.switch_re.shape[1]):
        force = 0.0
        for k in range(2):
            p = pair.progress[k, PHASE]
            if (phases.mask[p] >> i) & 1:
                share = 1.0 / ratio if k == 1 else 1.0 - 1.0 / ratio
                force += share * dot(
                    phases.switch_re[p, i], phases.switch_im[p, i], pair.z[k, 0], pair.z[k, 1]
                )
        if force > 0.0:
            wanted |= 1 << i
    for k in range(pair.motion.shape[1]):
        pair.motion[1, k] = pair.motion[0, k] + (pair.motion[1, k] - pair.motion[0, k]) / ratio
    pair.progress[1, WANTED] = wanted
