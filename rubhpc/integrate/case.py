"""Integrates one case: kernel calls, then measures; no files, no MPI."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, cast

import numpy as np

from rubhpc.integrate.carried_tangent import CarriedTangent
from rubhpc.integrate.compilation import (
    COLLOCATION,
    COMMON,
    NEIGHBOURS,
    PERIODIC,
    RUN_UPS,
    seconds_compiling,
)
from rubhpc.integrate.lyapunov import Growth, Marches
from rubhpc.integrate.marched_record import Marched, march_record, repeat_period
from rubhpc.integrate.marches.central_difference import CentralDifferenceMarch
from rubhpc.integrate.marches.collocation import CollocationMarch
from rubhpc.integrate.marches.event_driven import EventDrivenMarch
from rubhpc.integrate.marches.met_modes import NoClosedForm
from rubhpc.integrate.measuring.divergence import diverged_record
from rubhpc.integrate.measuring.measures import measures_of
from rubhpc.integrate.measuring.monitors import carrier_displacement, monitored
from rubhpc.integrate.measuring.orbit_measures import period
from rubhpc.integrate.measuring.regimes import LASTING, LEAST_REVOLUTIONS, by_growth, regime, undecided
from rubhpc.integrate.measuring.rub_in_bores import rub_measures
from rubhpc.integrate.measuring.samples import (
    add_sag,
    by_name,
    probe_extents,
    samples_within,
)
from rubhpc.integrate.measuring.settling import is_steady
from rubhpc.integrate.modal_setup import ModalSetup
from rubhpc.integrate.overlaps import with_overlap
from rubhpc.integrate.periodic_motions.collocated_motion import followed_motion
from rubhpc.integrate.periodic_motions.direct import pass_directly
from rubhpc.integrate.periodic_motions.lyapunov_spectrum import spectrum_of
from rubhpc.integrate.periodic_motions.piecewise_motion import PiecewiseMotion
from rubhpc.integrate.periodic_motions.proof import Solver
from rubhpc.integrate.periodic_motions.solved_motion import SolvedMotion, solved_motions
from rubhpc.integrate.record import Record, State
from rubhpc.integrate.releases import Through, record_through
from rubhpc.integrate.scheme import Scheme
from rubhpc.integrate.start import fit_to_gaps, start_of
from rubhpc.integrate.tangent_motion import TangentMotion
from rubhpc.integrate.transient import pass_revolutions, pass_transient
from rubhpc.kernels.trail import BROKEN
from rubhpc.schema import DONE, REGIME, SECTION_NAMES, bore_variables, lyapunov_variables
from rubhpc.spectra import amplitude_spectrum
from rubhpc.study.initial import Initial

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.lyapunov import Neighbours
    from rubhpc.integrate.marches.march import March
    from rubhpc.integrate.measuring.measures import Judge
    from rubhpc.integrate.measuring.regimes import Verdict
    from rubhpc.integrate.periodic_motions.collocated_motion import CollocatedMotion
    from rubhpc.integrate.setup import Setup
    from rubhpc.kernels.accumulators import Samples
    from rubhpc.kernels.trail import Trail
    from rubhpc.study.study import Recording

    Floats = NDArray[np.float64]


MARCHES: dict[Scheme, Callable[..., March]] = {
    Scheme.EVENT_DRIVEN: EventDrivenMarch,
    Scheme.COLLOCATION: CollocationMarch,
    Scheme.CENTRAL_DIFFERENCE: CentralDifferenceMarch,
}

_spare: list[Trail] = []  # arrays of the last case, unless another one uses them


def run_case(
    setup: Setup,
    *,
    clearance: float,
    friction: float,
    recording: Recording,
    initial: State | Initial | None = None,
    check: Callable[[], None] | None = None,
    say: Callable[[str], None] = lambda _: None,
    note: Callable[[float], None] = lambda _: None,
    is_judged: bool = True,
) -> Record:
    """Integrate one case and measure it.

    Parameters
    ----------
    clearance : float, m
        Radial clearance at rest; a stator's `clearance_offset` is added.
    friction : float
        Coefficient of friction.
    initial : State or Initial, optional
        Where to start, with the unbalance at its phase 0; default: at rest (`start.at_rest`). The
        final state of another case is fitted to the gaps of this one (`start.fit_to_gaps`).
    check : callable, optional
        Called between kernel calls, a quarter of a second apart at most; what it raises ends the case.
    say : callable
        Called with the progress of the case as often as `check`, if that is given.
    note : callable
        Called before each `check` with the share of transient and record that is done; 1 after the record.
    is_judged : bool
        Whether the regime is found, which may take longer than the record; else it is undecided.
    """
    n_whole = recording.longest_transient + recording.revolutions
    began = time.perf_counter() - seconds_compiling()
    if isinstance(initial, State):
        state = fit_to_gaps(initial, setup, clearance)
    else:
        state = start_of(initial or Initial(), setup, clearance)

    def starter(scheme: Scheme) -> Callable[..., March]:
        def start(state: State, setup: Setup = setup) -> March:
            def look() -> None:
                assert check is not None
                revolution = march.sample / setup.samples_per_revolution
                note((recording.longest_transient + revolution) / n_whole)
                check()
                say(reached(revolution))

            march = MARCHES[scheme](setup, clearance, friction, state, None if check is None else look)
            return march

        return start

    scheme = setup.scheme
    try:
        record = _integrate(starter(scheme), state, setup, clearance, friction, recording, is_judged)
    except NoClosedForm:
        # Contacts that chatter, or too many sets of them.
        scheme = Scheme.COLLOCATION
        record = _integrate(starter(scheme), state, setup, clearance, friction, recording, is_judged)
        record.measures["left_closed_form"] = 1
    record.measures["scheme"] = scheme.flag
    record.measures["modal_error"] = setup.modal_error if isinstance(setup, ModalSetup) else math.nan
    if isinstance(setup, ModalSetup) and np.any(record.measures["contact_fraction"] != 0.0):
        record = replace(record, advice=setup.modes_missing)  # without contact no mode is excited
    if scheme is not Scheme.EVENT_DRIVEN:
        record = replace(record, final=with_overlap(record.final, setup, clearance))
    record.measures["wall_time"] = time.perf_counter() - seconds_compiling() - began
    return record


def reached(revolution: float) -> str:
    """Where a case is, whose record begins at revolution 0."""
    if revolution < 0.0:
        return f"a case at revolution {revolution:.0f}, its record begins at 0"
    return f"a case at revolution {revolution:.0f} of its record"


def kernel_sets(setup: Setup, *, changes_speed: bool = False) -> set[str]:
    """Return the sets of kernels that a case of this set-up may need (`compilation`)."""
    if not isinstance(setup, ModalSetup):
        return {COMMON}
    sets = {COMMON, RUN_UPS} if changes_speed else {COMMON, NEIGHBOURS}
    if setup.scheme is Scheme.COLLOCATION:
        return sets | {COLLOCATION}
    return sets | {PERIODIC}


def compile_kernels(
    setup: Setup,
    *,
    clearance: float,
    friction: float,
    recording: Recording,
    check: Callable[[], None] | None = None,
    all_sets: bool = False,
) -> None:
    """Compile the kernels that every case of this set-up calls, on two revolutions.

    Those of collocation, where only some cases need it, are compiled when a case first calls them; so are
    those for neighbouring motions, unless `all_sets`.
    """
    short = replace(recording, transient=1, transient_limit=None, transient_tolerance=None, revolutions=1)
    record = run_case(setup, clearance=clearance, friction=friction, recording=short, check=check)
    if isinstance(setup, ModalSetup) and setup.scheme is Scheme.EVENT_DRIVEN and record.status == DONE:
        Solver(setup, clearance, friction, record.final)(1)
        if all_sets:
            start = partial(EventDrivenMarch, setup, clearance, friction, check=check)
            TangentMotion(start, record.final, setup, recording).part(1)


def _integrate(
    start: Callable[..., March],
    initial: State,
    setup: Setup,
    clearance: float,
    friction: float,
    recording: Recording,
    is_judged: bool,
) -> Record:
    """March through transient and record, then measure."""
    march = start(initial)
    motion: SolvedMotion | None = None  # that the transient ends on
    n_step = n_left = 0
    per_revolution = setup.samples_per_revolution
    settings = {"spin_speed": setup.spin, "clearance": clearance}
    begin = partial(followed_motion(setup), cast("ModalSetup", setup), clearance, friction)
    if recording.is_transient_direct and isinstance(march, EventDrivenMarch):
        motions = solved_motions(march.setup, (clearance, friction, recording))
        followed = partial(PiecewiseMotion, march.setup, clearance, friction)
        march, reason, n_transient, n_step, motion = pass_directly(march, followed, recording, motions)
        if motion is not None and motion.record is not None:
            record, n_own_step, n_own_left = motion.record
            return _counted(record.copied(), n_transient, n_step + n_own_step, march.n_left + n_own_left)
    else:
        reason, n_transient = pass_transient(march, recording)
    marched: Marched | None = None
    trail: Trail | None = None
    through: Through | None = None
    n_step_before, n_left_before = n_step, march.n_left
    if reason is not None:  # the record shows the way to divergence
        n_step, n_left = n_step + march.n_step, march.n_left
        ended = n_transient + march.sample // per_revolution + 1
        march, n_transient = start(initial), max(0, ended - recording.revolutions)
        is_short = pass_revolutions(march, recording, n_transient) is not None
        marched = march_record(march, setup, 0 if is_short else recording.revolutions)
    elif motion is not None:
        assert isinstance(march, EventDrivenMarch)
        marched, n_lost = repeat_period(march, motion.period, recording.revolutions)
        n_step += n_lost
        motion = motion if marched is not None else None
    if marched is None:
        trail = trail_of(march, recording) if is_judged else None
        if isinstance(setup, ModalSetup) and setup.release is not None:
            through = record_through(march, setup, recording.revolutions, start)
            marched, march, n_step = through.marched, through.march, n_step + through.n_step
        else:
            marched = march_record(march, setup, recording.revolutions)
        reason = marched.reason
    n_step, n_left = n_step + march.n_step, n_left + march.n_left
    samples, accumulator, final = marched.samples, marched.accumulator, marched.final
    last_setup, n_before = setup, 0
    if through is None:
        add_sag(samples, accumulator, setup.model)
    else:
        last_setup, n_before = through.setup, through.n_sample
    if reason is not None:
        n_kept = samples_within(samples, n_before + march.sample, setup.displacement_limit)
        revolution = n_transient + min(n_kept // per_revolution + 1, recording.revolutions)
        record = diverged_record(
            f"{reason} in revolution {revolution}",
            len(setup.model.stators),
            recording,
            settings,
            final,
            by_name(samples.whole[:, :n_kept], setup.model),
            has_bore=setup.model.n_push > 0,
        )
    else:
        signals = by_name(samples.whole, setup.model)
        turn = 2.0 * math.pi / abs(setup.spin)
        judge: Judge
        if motion is not None:
            judge = motion.judge
        elif is_judged:
            again = partial(start, setup=last_setup)
            judge = judge_of(march, again, last_setup, clearance, friction, recording, final, trail)
        else:
            judge = undecided
        record = Record(
            status=DONE,
            samples_per_revolution=per_revolution,
            signals=signals,
            spectra=_spectra(samples, setup.model) if "spectrum" in recording.keep else {},
            sections={f"section_{name}": signals[name][::per_revolution].copy() for name in SECTION_NAMES}
            if "section" in recording.keep
            else {},
            measures=measures_of(
                accumulator,
                signals,
                energy=marched.energy,
                model=setup.model,
                spin=setup.spin,
                samples_per_revolution=per_revolution,
                judge=judge,
            )
            | monitored(samples, accumulator, setup.model, is_round=setup.is_updated)
            | {"carrier_displacement": carrier_displacement(samples, setup.model)}
            | probe_extents(signals)
            | rub_measures(samples.push, accumulator, recording.revolutions * turn, setup.model),
            settings=settings,
            final=final,
            probed=recording.probed,
            n_exponent=recording.lyapunov,
        )
        if recording.lyapunov:
            record.measures.update(exponents_of(march, begin, final, recording.lyapunov))
        if "waveform" not in recording.keep:
            record.signals.clear()
        give_back(march, trail)
    if motion is not None:
        motion.record = record.copied(), n_step - n_step_before, n_left - n_left_before
    return _counted(record, n_transient, n_step, n_left)


def _counted(record: Record, n_transient: int, n_step: int, n_left: int) -> Record:
    """Note what it took to come to a record and through it."""
    record.measures.update(transient_revolutions=n_transient, steps=n_step, left_closed_form=n_left)
    return record


def _spectra(samples: Samples, model: Model) -> dict[str, Floats]:
    """Spectra of all signals, by their names in the schema."""
    spectra = by_name(amplitude_spectrum(samples.whole), model)
    unasked = bore_variables()
    return {f"spectrum_{name}": spectrum for name, spectrum in spectra.items() if name not in unasked}


def exponents_of(
    march: March, begin: Callable[[State], PiecewiseMotion | CollocatedMotion], final: State, n_exponent: int
) -> dict[str, float]:
    """Lyapunov exponents from where a march has ended; NaN where it has no closed form."""
    if isinstance(march, EventDrivenMarch | CollocationMarch):
        found = spectrum_of(partial(begin, final), n_exponent)
        largest = found["lyapunov_1"]
        return found if math.isnan(largest) else found | {"lyapunov_exponent": largest}
    return dict.fromkeys(lyapunov_variables(n_exponent), math.nan)


def judge_of(
    march: March,
    start: Callable[[State], March],
    setup: Setup,
    clearance: float,
    friction: float,
    recording: Recording,
    final: State,
    trail: Trail | None,
) -> Judge:
    """What judges a simulated record: its orbit, neighbouring motions and periodic ones."""
    solver = solver_of(march, setup, clearance, friction, final)
    growth = Growth(lambda: neighbours_of(march, trail, start, final, setup, recording))

    def lasts(exponent: float) -> bool:
        """Whether chaos was followed to the end of what is followed, does not drift and is chaos there."""
        if solver is None or solver.followed is None:
            return False
        energy, end = solver.followed
        if not is_steady(energy):
            return False
        if trail is not None:
            trail.n_event[0] = BROKEN  # its room alone is used again
        try:
            flag, later = by_growth(Growth(lambda: neighbours_of(march, trail, start, end, setup, recording)))
        except NoClosedForm:
            return False
        return flag == REGIME.index("chaotic") and exponent + later >= 2.0 * LASTING

    def judge(vertical: Floats, horizontal: Floats, per_revolution: int, is_contact: bool) -> Verdict:
        return regime(
            vertical,
            horizontal,
            per_revolution,
            period=period(vertical, horizontal, per_revolution),
            is_contact=is_contact,
            growth=growth,
            within=growth.within,
            solve=solver,
            later=solver.later if solver is not None else None,
            lasts=lasts if solver is not None else None,
            n_event=trail.n_event[0] / recording.revolutions if trail is not None else 0.0,
        )

    return judge


def solver_of(
    march: March,
    setup: Setup,
    clearance: float,
    friction: float,
    final: State,
) -> Solver | None:
    """Solver for periodic motions near the end of a march; None where it has no closed form."""
    if isinstance(march, EventDrivenMarch | CollocationMarch) and isinstance(setup, ModalSetup):
        return Solver(setup, clearance, friction, final, march)
    return None


def trail_of(march: March, recording: Recording) -> Trail | None:
    """Record the events of a record where its tangent may be propagated along them."""
    if isinstance(march, EventDrivenMarch) and recording.revolutions >= LEAST_REVOLUTIONS:
        trail = _kept(march) or march.new_trail()
        march.keep(trail)
        return trail
    return None


def give_back(march: March, trail: Trail | None) -> None:
    """Keep the arrays of a trail for the next case, when nothing reads or writes them any more.

    The system clears new memory page by page, which takes longer than following the tangent.
    """
    if trail is not None:
        cast("EventDrivenMarch", march).keep(None)
        _spare[:] = [trail]


def _kept(march: EventDrivenMarch) -> Trail | None:
    """Kept arrays, if they fit a march."""
    try:
        trail = _spare.pop()
    except IndexError:
        return None
    width = trail.begun.shape[2], trail.given.shape[1]
    return trail if width == march.width else None


def neighbours_of(
    march: March,
    trail: Trail | None,
    start: Callable[[State], March],
    final: State,
    setup: Setup,
    recording: Recording,
) -> Neighbours:
    """A motion next to the one from the end of a march."""
    if isinstance(march, EventDrivenMarch):
        return TangentMotion(
            cast("Callable[[State], EventDrivenMarch]", start), final, setup, recording, trail, march
        )
    if isinstance(march, CollocationMarch):
        march.start_again(final)
        return CarriedTangent(march)
    return Marches(start, final, setup, recording)
