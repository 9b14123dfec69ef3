"""Set-ups that a rank keeps for cases to come, within a bound on their memory."""

from __future__ import annotations

from collections import OrderedDict
from typing import TYPE_CHECKING

from rubhpc.integrate.modal_setup import ModalSetup
from rubhpc.running.case_setup import set_up
from rubhpc.study.drive_law import DriveLaw

if TYPE_CHECKING:
    from rubhpc.integrate.setup import Setup
    from rubhpc.rig.rig import Rig
    from rubhpc.study.cases import Case
    from rubhpc.study.contact_keys import Contact
    from rubhpc.study.study import Study

MOST_SETUPS = 4  # a block shares one, and neighbours often do
MOST_BYTES = 2**30  # of contact modes, without those of the current case; those of 32 stators fill a gigabyte


class KeptSetups:
    """The latest set-ups of a study."""

    def __init__(self, study: Study) -> None:
        self._study = study
        self._kept: OrderedDict[tuple[int, float, Contact, float], tuple[Rig, Setup]] = OrderedDict()

    def of(self, case: Case) -> Setup:
        """Set-up that the cases of this rig, speed and contact share."""
        key = (
            id(case.rig),
            case.speed,
            case.contact,
            case.speed_law.inertia or 0.0 if isinstance(case.speed_law, DriveLaw) else 0.0,
        )  # a rig that is kept here keeps its id; hashing it takes as long as a block
        if key in self._kept:
            setup = self._kept[key][1]
        else:
            model = next((kept.model for rig, kept in self._kept.values() if rig is case.rig), None)
            setup = set_up(self._study, case, model)
            self._kept[key] = (case.rig, setup)
            if len(self._kept) > MOST_SETUPS:
                self._kept.popitem(last=False)
        if isinstance(setup, ModalSetup) and len(setup.model.stators) > 1:
            self._make_room(setup, case.friction)
        return setup

    def _make_room(self, setup: Setup, friction: float) -> None:
        """Free contact modes that the case does not need, the oldest set-up's first, until few are left.

        Those that are met again are solved again, with the same bits.
        """
        held = [kept for _, kept in self._kept.values() if isinstance(kept, ModalSetup)]
        n_byte = {(i, mu): n for i, kept in enumerate(held) for mu, n in kept.n_byte.items()}
        total = sum(n_byte.values())
        for (i, mu), n in n_byte.items():
            if total > MOST_BYTES and not (held[i] is setup and mu == friction):
                held[i].forget(mu)
                total -= n
