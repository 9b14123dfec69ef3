"""From a case of a study to the set-up and arguments of its integration."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from rubhpc.integrate.periodic_motions.family import CLEARANCES, SPEEDS, Operation
from rubhpc.integrate.setup import prepare
from rubhpc.study.drive_law import DriveLaw

if TYPE_CHECKING:
    from rubhpc.fem.model import Model
    from rubhpc.integrate.setup import Setup
    from rubhpc.study.cases import Case, CaseGrid
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
