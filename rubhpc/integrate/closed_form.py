"""Which march follows a law from event to event."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rubhpc.integrate.event_driven_march import EventDrivenMarch
from rubhpc.integrate.friction_march import FrictionMarch
from rubhpc.integrate.penalty_march import PenaltyMarch
from rubhpc.kernels.laws import is_penalty, is_set_valued

if TYPE_CHECKING:
    from rubhpc.kernels.laws import Law


def closed_form_march(law: Law) -> type[EventDrivenMarch]:
    """Return the march whose pairs have the states of a law."""
    if is_set_valued(law):
        return FrictionMarch
    return PenaltyMarch if is_penalty(law) else EventDrivenMarch
