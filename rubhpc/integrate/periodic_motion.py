"""A periodic motion of a case, found from rest or from a state: solution, stability and record."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.errors import InputError, NoPeriodicMotion
from rubhpc.integrate.case import MARCHES, run_case
from rubhpc.integrate.marches.case_modes import NoClosedForm
from rubhpc.integrate.modal_setup import ModalSetup
from rubhpc.integrate.periodic_motions.collocated_motion import followed_motion
from rubhpc.integrate.periodic_motions.revolution import least_of
from rubhpc.integrate.periodic_motions.shooting import NotConverged, Orbit, shoot
from rubhpc.integrate.record import Record, State
from rubhpc.integrate.start import fit_to_gaps, start_of
from rubhpc.integrate.transient import pass_revolutions
from rubhpc.schema import REGIME
from rubhpc.spectra import amplitude_spectrum

if TYPE_CHECKING:
    from rubhpc.integrate.periodic_motions.collocated_motion import FollowedMotion
    from rubhpc.integrate.periodic_motions.piecewise_motion import Change
    from rubhpc.integrate.setup import Setup
    from rubhpc.study.initial import Initial
    from rubhpc.study.tables import Recording

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

SPANS = (30, 60, 120, 240)  # revolutions simulated further where no motion is found


class ContactEvent(NamedTuple):
    """An event of a motion.

    Attributes
    ----------
    time : float, s
        Since the shaft was at angle 0 at the beginning of the period.
    stator : int
        From 0.
    kind : {"touch", "release", "slip", "stick"}
        A gap closes; a force vanishes; a slip turns or begins; it ends.
    approach : float, m/s
        Speed with which the gap closes; NaN of other events.
    """

    time: float
    stator: int
    kind: Change
    approach: float


@dataclass(frozen=True, kw_only=True, eq=False)
class PeriodicMotion:
    """A motion that repeats itself exactly, stable or not.

    Attributes
    ----------
    period : int
        Revolutions: the shortest after which it repeats itself.
    state : State
        Motion with the shaft at its angle 0.
    record : Record
        As of a simulation that starts there: signals, spectra, sections and measures.
    multipliers : (n_state,)
        Floquet multipliers, complex, largest first: factors by which small disturbances grow in a period.
        n_state is twice the number of reduced degrees of freedom.
    is_stable : bool
        Whether all multipliers lie within the unit circle.
    monodromy : (n_state, n_state)
        The matrix whose eigenvalues they are, in reduced displacements (sqrt(kg) m) and velocities.
    residual : float
        Distance of the motion after a period from that before it, over its size.
    iterations : int
        Iterations of Newton's method.
    least_gap : (n_stator,), m
        Least gap of each stator where it turns between contacts: how far it is from touching once more; inf
        where none turns.
    least_force : (n_stator,), N
        Least force of each contact where it turns: how far it is from opening once more; inf where none does.
    events : tuple of ContactEvent
        Touches, releases and changes of slip over a period.
    """

    period: int
    state: State
    record: Record
    multipliers: Complexes
    is_stable: bool
    monodromy: Floats
    residual: float
    iterations: int
    least_gap: Floats
    least_force: Floats
    events: tuple[ContactEvent, ...]

    def __repr__(self) -> str:
        """One line: period, stability and contacts."""
        size, kind = abs(self.multipliers[0]), "stable" if self.is_stable else "unstable"
        touches = sum(event.kind == "touch" for event in self.events)
        about = f"period {self.period}, {kind} (largest multiplier {size:.4g}), {touches} touches"
        return f"<PeriodicMotion: {about}>"


def find_periodic_motion(
    setup: Setup,
    *,
    clearance: float,
    friction: float,
    period: int,
    repeat: int,
    recording: Recording,
    initial: State | Initial,
) -> PeriodicMotion:
    """Solve for a periodic motion and record it.

    With a state, the search begins there. Otherwise it begins at the end of a simulated transient, and takes
    the first stable motion. Where it fails, the simulation continues for up to 450 revolutions, and the
    search is repeated.

    Parameters
    ----------
    clearance : float, m
        Radial clearance at rest; a stator's `clearance_offset` is added.
    period : int
        Revolutions after which the motion is to repeat.
    repeat : int
        Periods recorded, whatever `recording.revolutions`.

    Raises
    ------
    InputError
        The laws of the case have no closed form.
    NoPeriodicMotion
        None was found; the message gives the reason.
    """
    if not isinstance(setup, ModalSetup):
        raise InputError('periodic: it needs [integrator] method = "modal"')
    try:
        piecewise, orbit = _search(setup, clearance, friction, period, recording, initial)
    except NoClosedForm:
        problem = "contacts open and close without end, or in too many combinations"
        raise NoPeriodicMotion(f"periodic: {problem}; use another case") from None
    multipliers, (least_gap, least_force) = orbit.multipliers, least_of(orbit.revolutions)
    state = piecewise.march.state_of(orbit.motion, piecewise.contact_force(orbit.states, orbit.motion))
    return PeriodicMotion(
        period=orbit.period,
        state=state,
        record=record_of_period(
            setup, clearance, friction, state, orbit.period, multipliers[0], repeat, recording
        ),
        multipliers=multipliers,
        is_stable=bool(abs(multipliers[0]) < 1.0),
        monodromy=orbit.monodromy,
        residual=orbit.residual,
        iterations=orbit.iterations,
        least_gap=least_gap,
        least_force=least_force,
        events=tuple(_events(piecewise, orbit)),
    )


def _search(
    setup: ModalSetup,
    clearance: float,
    friction: float,
    period: int,
    recording: Recording,
    initial: State | Initial,
) -> tuple[FollowedMotion, Orbit]:
    """Shoot from the state, then from the end of a simulation."""
    if isinstance(initial, State):
        state, first = fit_to_gaps(initial, setup, clearance), 0
    else:
        state, first = start_of(initial, setup, clearance), recording.longest_transient
    unstable: tuple[FollowedMotion, Orbit] | None = None
    reason = ""
    for span in (first, *SPANS):
        if span:
            march = MARCHES[setup.scheme](setup, clearance, friction, state, None)
            ended = pass_revolutions(march, recording, span)
            if ended is not None:
                reason = ended
                break
            state = fit_to_gaps(march.final(), setup, clearance)
        piecewise = followed_motion(setup.scheme)(setup, clearance, friction, state)
        try:
            orbit = shoot(piecewise, piecewise.start, piecewise.states, period)
        except NotConverged as problem:
            reason = reason or str(problem)
            continue
        if isinstance(initial, State) or abs(orbit.multipliers[0]) < 1.0:
            return piecewise, orbit
        unstable = unstable or (piecewise, orbit)
    if unstable is not None:
        return unstable
    text = f"no motion of period {period} was found: {reason}"
    raise NoPeriodicMotion(f"periodic: {text}; give another period, or a state near one as initial")


def record_of_period(
    setup: ModalSetup,
    clearance: float,
    friction: float,
    state: State,
    period: int,
    multiplier: complex,
    repeat: int,
    recording: Recording,
) -> Record:
    """Record one period and repeat it: an unstable motion would drift away."""
    once = replace(
        recording,
        transient=0,
        transient_limit=None,
        transient_tolerance=None,
        revolutions=period,
        keep=("waveform", "section"),
    )
    record = run_case(setup, clearance=clearance, friction=friction, recording=once, initial=state)
    signals = {name: np.tile(v, repeat) for name, v in record.signals.items()}
    sections = {name: np.tile(v, repeat) for name, v in record.sections.items()}
    has_touched = bool((record.measures["contact_impulse"] > 0.0).any())
    measures = record.measures | {
        "period": period,
        "regime": REGIME.index("periodic" if has_touched else "no_contact"),
        "lyapunov_exponent": math.log(abs(multiplier)) / period if multiplier else -math.inf,
        "largest_multiplier": abs(multiplier),
        "multiplier_angle": abs(cmath.phase(multiplier)),
        "settled": 1,
        "transient_revolutions": 0,
    }
    return replace(
        record,
        signals=signals if "waveform" in recording.keep else {},
        spectra={f"spectrum_{name}": amplitude_spectrum(values) for name, values in signals.items()}
        if "spectrum" in recording.keep
        else {},
        sections=sections if "section" in recording.keep else {},
        measures=measures,
    )


def _events(piecewise: FollowedMotion, orbit: Orbit) -> list[ContactEvent]:
    """Events of a period in the order of time."""
    found = []
    for i_revolution, revolution in enumerate(orbit.revolutions):
        for piece in revolution.pieces:
            time = i_revolution * piecewise.turn + piece.begin + piece.duration
            if not piece.crossing:
                continue
            approach = dict(zip(piece.touching.tolist(), piece.approach.tolist(), strict=True))
            for i, kind in piecewise.what_changes(piece):
                found.append(ContactEvent(time, i, kind, approach.get(i, math.nan)))
    return found
