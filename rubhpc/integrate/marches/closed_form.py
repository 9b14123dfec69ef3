"""The event-driven march of each law."""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

from rubhpc.integrate.marches.event_driven import EventDrivenMarch
from rubhpc.integrate.marches.friction import FrictionMarch
from rubhpc.integrate.marches.penalty import PenaltyMarch
from rubhpc.integrate.marches.penalty_friction import PenaltyFrictionMarch
from rubhpc.kernels._jit import plain
from rubhpc.kernels.laws import is_penalty, is_set_valued

if TYPE_CHECKING:
    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.kernels.laws import Law

_MARCHES: WeakKeyDictionary[ModalSetup, type[EventDrivenMarch]] = WeakKeyDictionary()


def closed_form_march(setup: ModalSetup) -> type[EventDrivenMarch]:
    """Return the event-driven march for a set-up's law."""
    if setup not in _MARCHES:
        _MARCHES[setup] = _march_of(setup.law)
    return _MARCHES[setup]


def _march_of(law: Law) -> type[EventDrivenMarch]:
    is_soft = plain(is_penalty)(law)
    if plain(is_set_valued)(law):
        return PenaltyFrictionMarch if is_soft else FrictionMarch
    return PenaltyMarch if is_soft else EventDrivenMarch
