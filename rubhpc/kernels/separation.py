"""Two neighbouring motions of one case by the exact integrator: how far they part over a span."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit_lean_sum
from rubhpc.kernels.case_progress import FINISHED, Clock
from rubhpc.kernels.contact_modes import ModeTables, Reduced, dot
from rubhpc.kernels.event_loop import advance

if TYPE_CHECKING:
    from rubhpc.kernels.accumulators import Accumulator, Samples
    from rubhpc.kernels.event_loop import EventWork
    from rubhpc.kernels.measuring import Recorder

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

DISPLACED = 1e-5  # of the motion: far above the resolution of events, far below the motion's features
LOST = 1e-6  # of the displacement: what is left is rounding


class Pair(NamedTuple):
    """A motion and its neighbour, m modal coordinates and n reduced degrees."""

    progress: Any  # (2,), records as `kernels.case_progress.Progress`
    z: Floats  # (2, 2, m)
    z_next: Floats  # (2, m), work space
    motion: Floats  # (2, 2 n), reduced displacements and velocities where a mode is to be entered
    size: Floats  # (1,), of the displacement that a span begins with; 0: none yet
    ratio: Floats  # (n_span,), distance at a span's end over that at its beginning
    n_done: Ints  # (1,), spans passed


@jit_lean_sum
def part(
    tables: ModeTables,
    reduced: Reduced,
    clock: Clock,
    n_tick: int,
    pair: Pair,
    work: EventWork,
    recorder: Recorder,
    samples: Samples,
    accumulator: Accumulator,
) -> int:
    """Advance both motions by spans of `n_tick`, whole revolutions, until `pair.ratio` is full.

    After each span the neighbour is brought back to where it began. Distance is the root of
    v'v + spin^2 u'u in reduced coordinates, in which the mass matrix is the identity.

    Returns
    -------
    int
        An outcome of `kernels.event_loop.advance`; with MODE_WANTED call again once the mode is tabulated.
    """
    progress = pair.progress
    is_recorded = n_tick < 0  # never; `advance` would be compiled once more for a literal
    if pair.size[0] == 0.0:
        read_motion(tables, progress[0].mode, pair.z[0], pair.motion[0])
        displace(tables, clock.spin, pair)
    while pair.n_done[0] < pair.ratio.size:
        for k in range(2):
            if progress[k].tick < n_tick or progress[k].wanted >= 0:
                outcome: int = advance(
                    tables,
                    reduced,
                    clock,
                    n_tick,
                    is_recorded,
                    progress[k],
                    pair.z[k],
                    pair.z_next,
                    pair.motion[k],
                    work,
                    recorder,
                    samples,
                    accumulator,
                )
                if outcome != FINISHED:
                    return outcome
        for k in range(2):
            read_motion(tables, progress[k].mode, pair.z[k], pair.motion[k])
        ratio = distance(pair.motion, clock.spin) / pair.size[0]
        pair.ratio[pair.n_done[0]] = ratio
        pair.n_done[0] += 1
        if ratio > LOST:
            bring_back(tables, ratio, pair)
        else:
            displace(tables, clock.spin, pair)
        for k in range(2):
            progress[k].tick, progress[k].n_event = 0, 0
    return FINISHED


@jit_lean_sum
def read_motion(tables: ModeTables, mode: int, z: Floats, motion: Floats) -> None:
    """Fill `motion` (2 n,) from the modal coordinates of contact mode `mode`."""
    for k in range(motion.size):
        motion[k] = dot(tables.motion_re[mode, k], tables.motion_im[mode, k], z[0], z[1])


@jit_lean_sum
def distance(motion: Floats, spin: float) -> float:
    """Root of v'v + spin^2 u'u of the difference of two motions (2, 2 n)."""
    n = motion.shape[1] // 2
    square = 0.0
    for k in range(n):
        u, v = motion[1, k] - motion[0, k], motion[1, n + k] - motion[0, n + k]
        square += v * v + spin * spin * u * u
    return float(np.sqrt(square))


@jit_lean_sum
def displace(tables: ModeTables, spin: float, pair: Pair) -> None:
    """Make the neighbour the motion itself, a little faster, so that closed gaps stay closed."""
    n = pair.motion.shape[1] // 2
    for k in range(n):
        pair.motion[1, k] = pair.motion[0, k]
        pair.motion[1, n + k] = (1.0 + DISPLACED) * pair.motion[0, n + k]
    pair.size[0] = distance(pair.motion, spin)
    pair.progress[1].wanted = tables.mask[pair.progress[0].mode]


@jit_lean_sum
def bring_back(tables: ModeTables, ratio: float, pair: Pair) -> None:
    """Take the neighbour to 1 / ratio of its distance from the motion, and the contact forces with it."""
    wanted = 0
    for i in range(tables.switch_re.shape[1]):
        force = 0.0
        for k in range(2):
            mode = pair.progress[k].mode
            if (tables.mask[mode] >> i) & 1:
                share = 1.0 / ratio if k == 1 else 1.0 - 1.0 / ratio
                force += share * dot(
                    tables.switch_re[mode, i], tables.switch_im[mode, i], pair.z[k, 0], pair.z[k, 1]
                )
        if force > 0.0:
            wanted |= 1 << i
    for k in range(pair.motion.shape[1]):
        pair.motion[1, k] = pair.motion[0, k] + (pair.motion[1, k] - pair.motion[0, k]) / ratio
    pair.progress[1].wanted = wanted
