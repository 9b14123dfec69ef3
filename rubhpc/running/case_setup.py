"""From a case of a study to the set-up and arguments of its integration."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.modal_setup import ModalSetup
from rubhpc.integrate.periodic_motions.family import CLEARANCES, SPEEDS, Operation
from rubhpc.integrate.setup import prepare
from rubhpc.storage.resume import missing_share
from rubhpc.study.drive_law import DriveLaw

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.setup import Setup
    from rubhpc.rig.rig import Rig
    from rubhpc.study.cases import Case, CaseGrid
    from rubhpc.study.contact_keys import Contact
    from rubhpc.study.study import Study

_ENOUGH_STATORS = 2  # a single pair is treated differently from several


def set_up(study: Study, case: Case, model: Model | None = None) -> Setup:
    """Set-up that the cases of this rig, speed and contact share; `model` is the assembled rig, if known."""
    drive = case.speed_law if isinstance(case.speed_law, DriveLaw) else None
    return prepare(
        case.rig,
        case.speed,
        contact=case.contact,
        integrator=study.integrator,
        samples_per_revolution=study.recording.samples_per_revolution,
        model=model if drive is None else None,  # its driven end is not free
        probes=study.recording.probe,
        drive=drive,
    )


def set_up_for_kernels(study: Study, case: Case) -> Setup:
    """Set-up that calls the kernels of this case at little cost (`case_for_kernels`)."""
    return set_up(study, case_for_kernels(study, case))


def case_for_kernels(study: Study, case: Case) -> Case:
    """The case with the first stators of a ring, which calls the same kernels at little cost.

    Even two revolutions in a large ring may take as long as kernels take to load, for its contact modes.
    """
    probed = (probe.stator or 0 for probe in study.recording.probe)
    if case.rig.carrier or max(probed, default=0) > _ENOUGH_STATORS:
        return case
    return replace(case, rig=replace(case.rig, stator=case.rig.stator[:_ENOUGH_STATORS]))


def operation_of(grid: CaseGrid, case: Case) -> Operation:
    """Operation of the rig of a case, with speed and clearance as given by the axes."""
    axes = grid.study.axes
    given = dict(zip([axis.name for axis in axes], grid.points.at(case.index), strict=True))
    return Operation(
        rig=case.rig,
        **{name: given.get(name) for name in (*SPEEDS, *CLEARANCES)},
        friction=case.friction,
        contact=case.contact,
        integrator=grid.study.integrator,
        samples_per_revolution=grid.study.recording.samples_per_revolution,
    )


MOST_SETUPS = 4  # a block shares one, and neighbours often do
MOST_BYTES = 2**30  # of contact modes, without those of the current case; those of 32 stators fill a gigabyte
_MOST_COUNTED = 2_000  # cases whose set-ups are counted


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


def count_set_ups(grid: CaseGrid, missing: NDArray[np.bool_]) -> float:
    """How many set-ups a rank makes that computes all missing cases, in the order of a run.

    Of many cases the first stand for the others.
    """
    n_counted, n_set_up = 0, 0
    kept: OrderedDict[tuple[float, ...], None] = OrderedDict()
    for block in (b for sequence in grid.sequences() for b in sequence if missing_share(b, missing)):
        if n_counted >= _MOST_COUNTED:
            break
        window = tuple(slice(s, s + n) for s, n in zip(block.start, block.shape, strict=True))
        for place in np.argwhere(missing[window]) + np.array(block.start):
            key, _ = grid.setup_values(place.tolist())
            n_set_up += key not in kept
            kept[key] = None
            if len(kept) > MOST_SETUPS:
                kept.popitem(last=False)
            n_counted += 1
    return n_set_up * int(missing.sum()) / max(n_counted, 1)
