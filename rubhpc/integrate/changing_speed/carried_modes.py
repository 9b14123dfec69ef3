"""Fast modes from one range of speeds to the next, or to another acceleration.

The speed changes evenly, so that fast modes do not ring for it: within a range they go on with their
coordinates (`kernels.pieces.begin_piece`). In the modes of another range these are the coordinates
of the same free motion. A sudden change of the acceleration makes them ring by what it changes
at this speed: matrices, unbalance force and sag.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.changing_speed.range_library import RangeLibrary
from rubhpc.kernels.pieces import FAST

if TYPE_CHECKING:
    from rubhpc.integrate.changing_speed.mode_courses import Eigenmodes
    from rubhpc.integrate.changing_speed.piece_setup import PieceSetup
    from rubhpc.integrate.marches.event_driven import EventDrivenMarch

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


NEARLY_FAST = 0.8 * FAST  # frequency of a mode over the spin, above which its motion is taken over


class Ended(NamedTuple):
    """End of a piece."""

    setup: PieceSetup
    library: RangeLibrary
    left: tuple[int, Floats]  # as of `EventDrivenMarch.reached_in`
    time: float  # s, since the piece began
    acceleration: float  # rad/s^2


def carried(before: Ended, jump: float, march: EventDrivenMarch, setup: PieceSetup) -> Floats | None:
    """Coordinates (2, m) of the end of a piece in the modes of the next one; None where they have none.

    Parameters
    ----------
    jump : float, rad/s^2
        Sudden change of the acceleration.
    march : EventDrivenMarch
        At the beginning of the next piece.
    """
    (mask, z), old, next_ = before.left, before.setup, march.library
    if mask != march.moved_by(march.mask) or not isinstance(next_, RangeLibrary):
        return None
    place = _inside(setup.held.within(old.spin))
    common = setup.held.reduced.spin + place * setup.held.reach
    modes = next_.eigenmodes(march.mask, place)
    known = before.library.eigenmodes(march.mask, _inside(old.held.within(common)))
    if modes is None or known is None:
        return None
    fast = np.flatnonzero(np.abs(known.exponent) > NEARLY_FAST * abs(setup.spin))
    entered = modes.enter @ (known.motion[:, fast] @ (z[0, fast] + 1j * z[1, fast])).real
    if jump:
        entered = entered + _rung(modes, before, jump, setup)
    found = np.zeros((2, next_.width))
    found[:, : entered.size] = entered.real, entered.imag
    return found


def _rung(modes: Eigenmodes, before: Ended, jump: float, setup: PieceSetup) -> Complexes:
    """What a sudden change of the acceleration adds to coordinates (m,) by sag, force and stiffness."""
    old, n = before.setup, modes.motion.shape[0] // 2
    turning = complex(old.clock.growth, old.spin)
    factor, force = complex(old.speeds.factor[old.place]), old.spin**2 - 1j * before.acceleration
    project = setup.reduced.project[:, : setup.held.lean.size]
    moved = -jump * np.concatenate([project @ setup.held.lean, project @ setup.held.slope])
    none = np.zeros(len(modes.constant))
    found = modes.entered(moved, none, turning, -1j * jump / force * factor, before.time)
    whirl = modes.response(turning, factor)[:n] * np.exp(turning * before.time)
    pushed = 0.5 * modes.enter[:, n:] @ (jump * setup.held.momentum)
    by_whirl = pushed @ whirl / (turning - modes.exponent)
    found += by_whirl + pushed @ whirl.conj() / (turning.conjugate() - modes.exponent)
    return found


def _inside(place: float) -> float:
    """The place in a range that is nearest."""
    return min(max(place, -1.0), 1.0)
