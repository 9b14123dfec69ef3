"""Higher modes carried over a change of the matrices, which else would make them ring.

With the speed a mode's shape and its static part change evenly; matrices that are held change at once,
and a motion that goes on unchanged then holds each mode by another amount. Over an even change that takes
the time T the amplitude of a mode of frequency w takes of a mode of frequency w' but `sin(a) / a` of its
share in it, with `a = (w - w') T / 2`, and as much of the jump of its own static part, where w' is the spin.
The rest is taken off here. Modes of one frequency, as equal stators have them, so pass into one another as
they are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.changing_speed.retuned_modes import RetunedLibrary
from rubhpc.integrate.marches.modal import Place

if TYPE_CHECKING:
    from rubhpc.integrate.changing_speed.piece_setup import PieceSetup
    from rubhpc.integrate.marches.event_driven import EventDrivenMarch

Floats = NDArray[np.float64]

LOWEST = 3.0  # frequency of a mode over the spin; lower ones take part in contact


class Standing(NamedTuple):
    """Where a piece has ended, in its own matrices."""

    setup: PieceSetup
    library: RetunedLibrary
    end: Place
    constants: Floats  # values of the coordinates that do not move
    time: float  # s, since the piece began


def standing(march: EventDrivenMarch, setup: PieceSetup, end: Place, time: float) -> Standing | None:
    """Where a march has ended a piece; None where modes are not carried over."""
    library = march.library
    if not isinstance(library, RetunedLibrary):
        return None
    return Standing(setup, library, end, march.constants, time)


def carried(
    before: Standing, lasted: float, march: EventDrivenMarch, setup: PieceSetup, begun: Place
) -> Place:
    """The place from which a piece begins, with what its matrices would make ring taken off.

    Parameters
    ----------
    before : Standing
        At the same instant.
    lasted : float, s
        Since when the matrices before were held.
    march : EventDrivenMarch
        Which stands nowhere afterwards, until it begins anew.
    begun : Place
        From which the piece would begin.
    """
    march.begin(setup, begun)
    library, mask = march.library, march.mask
    assert isinstance(library, RetunedLibrary)
    was, now = before.library.eigenmodes(mask), library.eigenmodes(mask)
    if was is None or now is None or was.exponent.size != now.exponent.size:
        return begun
    old, new = before.setup, setup
    z_before = was.entered(before.end.motion, before.constants, *_turning(old), before.time)
    z = now.entered(march.begun_motion, march.constants, *_turning(new), 0.0)
    pairs = np.flatnonzero(now.is_pair & (np.abs(now.exponent.imag) > LOWEST * abs(new.spin)))
    frequency, others = now.exponent.imag[pairs, np.newaxis], was.exponent.imag
    held = 0.5 * (now.enter[pairs] @ was.motion) * z_before
    mirrored = 0.5 * (now.enter[pairs] @ was.motion.conj()) * z_before.conj()
    still = z[pairs] - (held + mirrored).sum(axis=1)
    jump = (held * _lost((frequency - others) * lasted)).sum(axis=1)
    jump += (mirrored * _lost((frequency + others) * lasted)).sum(axis=1)
    jump += still * _lost((np.abs(frequency[:, 0]) - abs(new.spin)) * lasted)
    motion = march.begun_motion - (now.motion[:, pairs] @ jump).real
    return Place(motion, setup.model.sag, begun.contact_force)


def _lost(turned: Floats) -> Floats:
    """Share that a change of amplitude loses over a time in which its phase turns, rad."""
    lost: Floats = 1.0 - np.sinc(turned / (2.0 * np.pi))
    return lost


def _turning(setup: PieceSetup) -> tuple[complex, complex]:
    """Exponent of the unbalance force of a piece (1/s) and the factor of its unbalance (1/s^2)."""
    return complex(setup.clock.growth, setup.spin), complex(setup.speeds.factor[setup.place])
