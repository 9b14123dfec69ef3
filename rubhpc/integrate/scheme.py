"""Integration schemes, and the scheme that contact and integrator of a case require."""

from __future__ import annotations

from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING

from rubhpc.schema import SCHEMES
from rubhpc.study.tables import check_method

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.rig.stators import AnyStator
    from rubhpc.study.contact_keys import Contact
    from rubhpc.study.tables import Integrator


class Scheme(Enum):
    """Integration scheme of a case."""

    EVENT_DRIVEN = "event-driven"  # closed-form motion from event to event
    COLLOCATION = "collocation"  # closed-form flights, contact forces as polynomials on nodes
    CENTRAL_DIFFERENCE = "central-difference"  # the paper's

    @cached_property
    def flag(self) -> int:
        """The scheme's number in a store."""
        return SCHEMES.index(self.value.replace("-", "_"))


def scheme_of(
    contact: Contact,
    integrator: Integrator,
    *,
    is_bent: bool = False,
    is_updated: bool = False,
    has_harmonics: bool = False,
    stators: Sequence[AnyStator] = (),
) -> Scheme:
    """Return the initial scheme of a case.

    Parameters
    ----------
    is_bent : bool
        Whether a stator has second-order geometry.
    is_updated : bool
        Whether a normal turns.
    has_harmonics : bool
        Whether forces act at multiples of the spin.
    stators : sequence
        Of the rig.

    Raises
    ------
    InputError
        For an integrator that knows no such stator or law.
    """
    check_method(contact, integrator, is_bent=is_bent, stators=stators)
    if integrator.method == "central-difference":
        return Scheme.CENTRAL_DIFFERENCE
    is_own = any(stator.has_own_contact for stator in stators)
    is_general = is_bent or is_updated or is_own or has_harmonics or not contact.are_laws_closed
    return Scheme.COLLOCATION if is_general else Scheme.EVENT_DRIVEN
