"""Sets of closed contacts of a case and their change at an event: the interface for periodic motions."""

from __future__ import annotations

from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from rubhpc.integrate.marches.modal import ModalMarch
from rubhpc.integrate.measuring.samples import no_record
from rubhpc.kernels.contact_modes import FORCED_LEVEL
from rubhpc.kernels.mode_change import EventWork, change_contacts, event_work

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.marches.met_modes import MetModes
    from rubhpc.integrate.reduced_model.mode_library import ModeLibrary
    from rubhpc.kernels.accumulators import Accumulator

    Floats = NDArray[np.float64]


class ContactSets(ModalMarch):
    """A case that passes through sets of closed contacts, or of states of its pairs."""

    take_change: ClassVar[Callable[..., int]] = staticmethod(change_contacts)  # kernel that takes an event

    _modes: MetModes

    @property
    def library(self) -> ModeLibrary:
        """Contact modes of the case."""
        return self._modes.library

    @property
    def mask(self) -> int:
        """Present set of closed pairs, or of the states of all pairs under set-valued friction."""
        return int(self.tables.mask[self._bare_progress["mode"]])

    def moved_by(self, mask: int) -> int:
        """Part of a set of contacts that determines the motion: all but the bits of lifted pairs."""
        return mask

    def touching(self) -> NDArray[np.bool_]:
        """Whether each pair is closed, (q,)."""
        return self.closed(self.mask)

    def closed(self, mask: int) -> NDArray[np.bool_]:
        """Whether each pair is closed in a contact mode, (q,)."""
        return _are_set(mask, self._clearance.size)

    def opened(self, mask: int) -> NDArray[np.bool_]:
        """Whether each pair is open in a contact mode, with its gap monitored, (q,)."""
        return ~self.closed(mask)

    def gaps_watched(self, mask: int) -> int:
        """Bits of the switch functions that are gaps in a contact mode."""
        stride = self.tables.switch_re.shape[1] // self._clearance.size
        return sum(1 << stride * int(i) for i in np.flatnonzero(self.opened(mask)))

    @property
    def given(self) -> Floats:
        """Normal and tangential impulses (2, q), N s, of the last event by `change`."""
        return self.change_work[0].given

    def forces(self, mode: int, z: Floats) -> Floats:
        """Forces (q,), N, at coordinates (2, m) of a contact mode, given by its index in the tables."""
        is_closed = self.closed(int(self.tables.mask[mode]))
        if not is_closed.any():
            return np.zeros(is_closed.size)
        force = self.tables.switch_re[mode] @ z[0] - self.tables.switch_im[mode] @ z[1]
        return np.where(is_closed, force, 0.0)

    def exponents(self, mask: int) -> tuple[Floats, Floats]:
        """Exponents of the coordinates of a contact mode and their drift (`ModeLibrary.exponents`)."""
        return self.library.exponents(mask)

    @property
    def derived(self) -> dict[int, Any]:
        """Derived data of the contact modes, kept with their tables (`ModeLibrary.derived`)."""
        return self.library.derived

    @property
    def moment(self) -> float:
        """Time, s: a pair that would part for less than that at an event stays closed."""
        return float(self.clock.tick * 2**FORCED_LEVEL)

    def change(
        self, mask: int, crossing: int, angle: float, motion: Floats, moment: float | None = None
    ) -> int:
        """Compute an event: `motion` (2 n,) after it, in place; returns the contact mode afterwards, or -1.

        `crossing` are the switch functions that vanish, `angle` (rad) is that of the shaft; `moment` (s) is
        by default `self.moment`.
        """
        return int(
            self.take_change(
                self.bodies,
                mask,
                crossing,
                self.clock.spin,
                self.moment if moment is None else moment,
                np.cos(angle),
                np.sin(angle),
                motion,
                False,
                *self.change_work,
            )
        )

    @cached_property
    def change_work(self) -> tuple[EventWork, Accumulator]:
        """Work space of `change` (`change_contacts`)."""
        return event_work(self._clearance.size), self._unrecorded

    @property
    def _unrecorded(self) -> Accumulator:
        """Accumulator for events that are not recorded."""
        return no_record(self.n_place, self._clearance.size)[1]


@lru_cache
def _are_set(mask: int, q: int) -> NDArray[np.bool_]:
    """Whether each of the lowest bits is set, (q,)."""
    found = np.array([bool(mask >> i & 1) for i in range(q)])
    found.flags.writeable = False
    return found
