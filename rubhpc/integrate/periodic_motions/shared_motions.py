"""The motions that starts at one operating point may reach, found from a fixed set of starts.

They depend on the operating point alone, not on the cases that ask for them nor on their order.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import replace
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

from rubhpc.errors import InputError
from rubhpc.integrate.marches.event_driven import EventDrivenMarch
from rubhpc.integrate.marches.met_modes import NoClosedForm
from rubhpc.integrate.periodic_motions.direct import pass_directly
from rubhpc.integrate.periodic_motions.known_motions import KnownMotions
from rubhpc.integrate.start import start_of
from rubhpc.study.initial import CONTACT_FREE, REST, Initial

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rubhpc.integrate.marches.march import March
    from rubhpc.integrate.modal_setup import ModalSetup
    from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
    from rubhpc.integrate.record import State
    from rubhpc.study.study import Recording

SPEEDS, DIRECTIONS = (1.0, 3.0), 4  # of the output node, over spin times clearance; and their directions
MOST_POINTS = 16  # operating points of a set-up whose motions are kept
LONGEST = 128  # revolutions in which a fixed start must reach its motion
MOST_VAIN = 3  # consecutive starts without a motion: where motions are not periodic, all fail

_Kept = OrderedDict[tuple[float, float, "Recording"], KnownMotions]
_KEPT: WeakKeyDictionary[ModalSetup, _Kept] = WeakKeyDictionary()


def shared_motions(
    setup: ModalSetup,
    clearance: float,
    friction: float,
    recording: Recording,
    start: Callable[[State], March],
    solve_from: Callable[[State | None, EventDrivenMarch], PiecewiseMotion],
) -> tuple[KnownMotions, bool]:
    """Return the stable periodic motions that a fixed set of starts reaches, and whether they are new.

    These are the contact-free motion and rest, and the first of them with the output node moving up, left,
    down and right at one and at three times the spin times the clearance; the search ends after three
    consecutive starts without a motion.

    Parameters
    ----------
    clearance : float, m
        Radial clearance at rest.
    start, solve_from : callable
        As for `direct.pass_directly`.
    """
    kept = _KEPT.setdefault(setup, OrderedDict())
    key = clearance, friction, recording
    is_new = key not in kept
    if is_new:
        known = KnownMotions(setup)
        limit = min(LONGEST, recording.longest_transient)
        n_vain = 0
        for state in _starts(setup, clearance):
            has_settled = _add(known, state, replace(recording, transient_limit=limit), start, solve_from)
            n_vain = 0 if has_settled else n_vain + 1
            if n_vain == MOST_VAIN:
                break
        kept[key] = known
        if len(kept) > MOST_POINTS:
            kept.popitem(last=False)
    return kept[key], is_new


def _add(
    known: KnownMotions,
    state: State,
    recording: Recording,
    start: Callable[[State], March],
    solve_from: Callable[[State | None, EventDrivenMarch], PiecewiseMotion],
) -> bool:
    """Add the motion that a start reaches, if it is not known; returns whether it reaches one."""
    try:
        march = start(state)
        assert isinstance(march, EventDrivenMarch)
        passed = pass_directly(march, solve_from, recording, known)
        if passed.found is not None:
            known.add(passed.found)
    except NoClosedForm:
        return False
    return passed.found is not None or passed.reached is not None


def _starts(setup: ModalSetup, clearance: float) -> Iterator[State]:
    """The fixed starts that the rig allows."""
    least = clearance + min(stator.clearance_offset for stator in setup.model.stators)
    unit = abs(setup.spin * least)
    based: list[str] = []
    for word in (CONTACT_FREE, REST):
        try:
            yield start_of(Initial(from_=word), setup, clearance)
        except InputError:
            continue  # the rotor is unstable
        based.append(word)
    for share in SPEEDS:
        for k in range(DIRECTIONS):
            angle = 2.0 * math.pi * k / DIRECTIONS
            moved = Initial(
                from_=based[0],
                vertical_velocity=round(math.cos(angle)) * share * unit,
                horizontal_velocity=round(math.sin(angle)) * share * unit,
            )
            try:
                yield start_of(moved, setup, clearance)
            except InputError:
                continue  # the output node is constrained in that direction
