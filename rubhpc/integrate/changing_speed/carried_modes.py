"""Higher modes from one range of speeds to the next, or to another acceleration, without artificial ringing.

The quasi-static response of a fast mode changes gradually with the speed, but the modes of two ranges differ.
In the modes `l` of the next matrices, a motion `exp(m t)` that continued unchanged would excite each mode. A
linear change from the time `-a` before to `b` after excites it by the mean of `exp((m - l) s)` over these
times, which is 1 for slow motions and vanishes for fast ones. Powers of its modulus represent a change that
begins and ends smoothly; a motion that decays within these times has no effect. After a contact, ringing
higher modes continue unchanged. Ringing by a sudden change of the acceleration is real, and kept.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.changing_speed.range_library import RangeLibrary
from rubhpc.integrate.marches.modal import Place
from rubhpc.kernels.pieces import FAST, QUICK

if TYPE_CHECKING:
    from rubhpc.integrate.changing_speed.piece_setup import PieceSetup
    from rubhpc.integrate.marches.event_driven import EventDrivenMarch

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

LOWEST = 3.0  # frequency of a mode over the spin; lower modes take part in contact
TOUCH = 0.25  # revolutions, at most, before and after a change in motions with contact
SLOW = 1e-6  # exponent times time, below which a change is immediate


class Standing(NamedTuple):
    """End of a piece, in its own matrices."""

    setup: PieceSetup
    library: RangeLibrary
    end: Place
    constants: Floats  # values of the coordinates that do not move
    time: float  # s, since the piece began


class Change(NamedTuple):
    """How the speed changes where a range ends."""

    ahead: float  # s, duration of the next piece
    jump: float = 0.0  # rad/s^2, sudden change of the acceleration


class Parts(NamedTuple):
    """A motion as a sum of exponentials, each the real part of its shape."""

    exponent: Complexes  # (p,), 1/s
    shape: Complexes  # (2 n, p)


def standing(march: EventDrivenMarch, setup: PieceSetup, end: Place, time: float) -> Standing | None:
    """End of a piece by a march; None where modes are not carried over."""
    library = march.library
    if not isinstance(library, RangeLibrary):
        return None
    return Standing(setup, library, end, march.constants, time)


def carried(
    before: Standing, change: Change, march: EventDrivenMarch, setup: PieceSetup, begun: Place
) -> Place:
    """The start of a piece, without the ringing that its new matrices would cause.

    Parameters
    ----------
    before : Standing
        At the same instant.
    march : EventDrivenMarch
        It has no valid state afterwards, until it begins again.
    begun : Place
        The start without this correction.
    """
    march.begin(setup, begun)
    library, mask = march.library, march.mask
    assert isinstance(library, RangeLibrary)
    was = before.library.eigenmodes(mask, before.setup.within)
    now = library.eigenmodes(mask, setup.within)
    if was is None or now is None:
        return begun
    old, factor = _turning(before.setup)
    z = was.entered(before.end.motion, before.constants, old, factor, before.time)
    factor = factor * np.exp(old * before.time)
    forced = was.response(old, factor)
    still = march.begun_motion - (was.motion @ z).real - forced.real
    parts = Parts(
        np.concatenate([was.exponent, [0.0, old]]),
        np.column_stack([was.motion * z, still, forced]),
    )
    has_touched = any(march.met)
    spin = abs(setup.spin)
    if change.jump:
        fast = np.abs(now.exponent.imag) > LOWEST * spin
    else:  # as from piece to piece
        fast = np.abs(now.exponent) > max(FAST * spin, QUICK / max(before.time, change.ahead))
    exponent, enter = now.exponent[fast], now.enter[fast]
    left = 0.5 * np.stack([enter @ parts.shape, enter @ parts.shape.conj()])  # (2, modes, parts)
    direct, mirrored = now.forced(old, factor)
    left[0, :, -1] -= direct[fast]
    left[1, :, -1] -= mirrored[fast]
    left[0, :, -2] -= (march.constants @ now.constant)[fast]
    real = np.zeros_like(left)  # really sudden changes
    if change.jump:
        slow = np.append(np.abs(was.exponent) <= LOWEST * spin, [True, True])
        pushing = Parts(parts.exponent[slow], parts.shape[:, slow])
        real[..., slow] = _pushed(pushing, exponent, enter, change.jump * setup.held.momentum)
    # The speed changes evenly: a revolution before and after parts slow from fast.
    span = (TOUCH if mask else 1.0) * 2.0 * np.pi / spin
    taken = 1.0 - left_over(_apart(parts, exponent), span, has_touched=has_touched)
    if has_touched:
        taken[..., :-2] *= np.abs(was.exponent) <= LOWEST * spin
    off = -((left - real) * taken).sum(axis=(0, 2))
    motion = march.begun_motion + (now.motion[:, fast] @ off).real
    return Place(motion, setup.model.sag, begun.contact_force)


def left_over(exponent: Complexes, span: float, *, has_touched: bool) -> Complexes:
    """Factor of a gradual change from a time before to as long after, s, relative to a sudden one.

    `exponent` (1/s) is that of the motion minus that of the excited mode.
    """
    x = exponent * span
    x = np.where(np.abs(x) < SLOW, SLOW, x)
    dying = 2.0 * np.abs(x.real)
    mean = (np.exp(x - dying) - np.exp(-x - dying)) / (2.0 * x)
    smooth: Complexes = mean**3 if has_touched else np.where(np.abs(x.imag) < np.pi, mean, mean**2)
    return smooth


def _pushed(parts: Parts, exponent: Complexes, enter: Complexes, stiffness: Floats) -> Complexes:
    """Excitation of each mode by each part and its conjugate, (2, modes, p), as a stiffness acts at once."""
    n = len(stiffness)
    given = 0.5 * (enter[:, n:] @ stiffness) @ np.stack([parts.shape[:n], parts.shape[:n].conj()])
    pushed: Complexes = given / _apart(parts, exponent)
    return pushed


def _apart(parts: Parts, exponent: Complexes) -> Complexes:
    """Exponents of the parts and of their conjugates minus those of the modes, (2, modes, p)."""
    both = np.stack([parts.exponent, parts.exponent.conj()])
    apart: Complexes = both[:, np.newaxis] - exponent[:, np.newaxis]
    return apart


def _turning(setup: PieceSetup) -> tuple[complex, complex]:
    """Exponent of the unbalance force of a piece (1/s) and the factor of its unbalance (1/s^2)."""
    return complex(setup.clock.growth, setup.spin), complex(setup.speeds.factor[setup.place])
