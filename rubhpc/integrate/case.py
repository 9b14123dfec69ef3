"""Integrates one case: kernel calls, then measures; no files, no MPI."""

from __future__ import annotations

import math
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, cast

import numpy as np

from rubhpc.integrate.carried_tangent import CarriedTangent
from rubhpc.integrate.compilation import COLLOCATION, COMMON, PERIODIC, seconds_compiling
from rubhpc.integrate.lyapunov import Growth, Marches
from rubhpc.integrate.marched_record import march_record
from rubhpc.integrate.marches.case_modes import NoClosedForm
from rubhpc.integrate.marches.central_difference import CentralDifferenceMarch
from rubhpc.integrate.marches.collocation import CollocationMarch
from rubhpc.integrate.marches.event_driven import EventDrivenMarch
from rubhpc.integrate.marches.march import ended_in
from rubhpc.integrate.measuring.divergence import diverged_record
from rubhpc.integrate.measuring.measures import measures_of
from rubhpc.integrate.measuring.monitors import carrier_displacement, monitored
from rubhpc.integrate.measuring.orbit_measures import period
from rubhpc.integrate.measuring.regimes import LASTING, by_growth, regime, undecided
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
from rubhpc.integrate.periodic_motions.piecewise_motion import Unfollowed
from rubhpc.integrate.periodic_motions.proof import Solver
from rubhpc.integrate.periodic_motions.solved_motion import SolvedMotion, solved_motions
from rubhpc.integrate.record import Record, State
from rubhpc.integrate.releases import Through, record_through
from rubhpc.integrate.scheme import Scheme
from rubhpc.integrate.start import fit_to_gaps, start_of
from rubhpc.integrate.transient import pass_revolutions, pass_transient
from rubhpc.schema import DONE, REGIME, SECTION_NAMES, bore_variables, lyapunov_variables
from rubhpc.spectra import amplitude_spectrum
from rubhpc.study.initial import Initial

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.marches.march import March
    from rubhpc.integrate.marches.modal import ModalMarch
    from rubhpc.integrate.measuring.measures import Judge
    from rubhpc.integrate.measuring.regimes import Verdict
    from rubhpc.integrate.periodic_motions.collocated_motion import FollowedMotion
    from rubhpc.integrate.setup import Setup
    from rubhpc.kernels.accumulators import Samples
    from rubhpc.study.tables import Recording

    Floats = NDArray[np.float64]

MARCHES: dict[Scheme, Callable[..., March]] = {
    Scheme.EVENT_DRIVEN: EventDrivenMarch,
    Scheme.COLLOCATION: CollocationMarch,
    Scheme.CENTRAL_DIFFERENCE: CentralDifferenceMarch,
}


@dataclass(frozen=True, kw_only=True)
class Case:
    """A case and what integrates it.

    Attributes
    ----------
    look : callable
        Called with a march between its kernel calls, if any.
    is_judged : bool
        Whether its regime is found; else it is undecided.
    """

    setup: Setup
    scheme: Scheme
    clearance: float  # m
    friction: float
    recording: Recording
    look: Callable[[March], None] | None = None
    is_judged: bool = True

    def march(self, state: State, setup: Setup | None = None) -> March:
        """Start a march from a state, of this set-up or of another one."""

        def check() -> None:
            assert self.look is not None
            self.look(march)

        march: March = MARCHES[self.scheme](
            setup or self.setup, self.clearance, self.friction, state, check if self.look else None
        )
        return march

    def motion(self, initial: State | None, march: March | None = None, **options: float) -> FollowedMotion:
        """Make what follows its motions, from a state or from where a march stands that is needed no more."""
        make = followed_motion(self.scheme, **options)
        return make(self.setup, self.clearance, self.friction, initial, march)

    @property
    def has_tangent(self) -> bool:
        """Whether its motions can be followed with small changes of them."""
        return self.scheme is not Scheme.CENTRAL_DIFFERENCE


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

    def look(march: March) -> None:
        assert check is not None
        revolution = march.sample / setup.samples_per_revolution
        note((recording.longest_transient + revolution) / n_whole)
        check()
        say(reached(revolution))

    case = Case(
        setup=setup,
        scheme=setup.scheme,
        clearance=clearance,
        friction=friction,
        recording=recording,
        look=None if check is None else look,
        is_judged=is_judged,
    )
    try:
        record = _integrate(case, state)
    except NoClosedForm:
        # Contacts that chatter, or too many sets of them.
        case = replace(case, scheme=Scheme.COLLOCATION)
        record = _integrate(case, state)
        record.measures["left_closed_form"] = 1
    record.measures["scheme"] = case.scheme.flag
    record.measures["modal_error"] = setup.modal_error if isinstance(setup, ModalSetup) else math.nan
    if isinstance(setup, ModalSetup) and np.any(record.measures["contact_fraction"] != 0.0):
        record = replace(record, advice=setup.modes_missing)  # without contact no mode is excited
    if case.scheme is not Scheme.EVENT_DRIVEN:
        record = replace(record, final=with_overlap(record.final, setup, clearance))
    record.measures["wall_time"] = time.perf_counter() - seconds_compiling() - began
    return record


def reached(revolution: float) -> str:
    """Where a case is, whose record begins at revolution 0."""
    if revolution < 0.0:
        return f"a case at revolution {revolution:.0f}, its record begins at 0"
    return f"a case at revolution {revolution:.0f} of its record"


def kernel_sets(setup: Setup) -> set[str]:
    """Return the sets of kernels that a case of this set-up may need (`compilation`)."""
    if not isinstance(setup, ModalSetup):
        return {COMMON}
    return {COMMON, COLLOCATION if setup.scheme is Scheme.COLLOCATION else PERIODIC}


def compile_kernels(
    setup: Setup,
    *,
    clearance: float,
    friction: float,
    recording: Recording,
    check: Callable[[], None] | None = None,
) -> None:
    """Compile the kernels that every case of this set-up calls, on two revolutions.

    Those of collocation, where only some cases of closed form need it, are compiled when one calls them.
    """
    short = replace(recording, transient=1, transient_limit=None, transient_tolerance=None, revolutions=1)
    record = run_case(setup, clearance=clearance, friction=friction, recording=short, check=check)
    if isinstance(setup, ModalSetup) and record.status == DONE:
        case = Case(
            setup=setup, scheme=setup.scheme, clearance=clearance, friction=friction, recording=recording
        )
        with suppress(NoClosedForm, Unfollowed):
            motion = case.motion(record.final)
            motion.go_on(np.eye(2 * motion.n)[:, :1])


def _integrate(case: Case, initial: State) -> Record:
    """March through transient and record, then measure."""
    setup, recording = case.setup, case.recording
    march = case.march(initial)
    motion: SolvedMotion | None = None  # that the transient ends on
    n_step = 0
    per_revolution = setup.samples_per_revolution
    settings = {"spin_speed": setup.spin, "clearance": case.clearance}
    if recording.is_transient_direct and case.has_tangent:
        march = cast("ModalMarch", march)
        motions = solved_motions(march.setup, (case.clearance, case.friction, recording))
        march, reason, n_transient, n_step, motion = pass_directly(
            march, partial(case.motion, None), recording, motions
        )
        if motion is not None and motion.record is not None:
            record, n_own_step = motion.record
            return _counted(record.copied(), n_transient, n_step + n_own_step)
    else:
        reason, n_transient = pass_transient(march, recording)
    through: Through | None = None
    n_step_before = n_step
    if reason is not None:  # the record shows the way to divergence
        n_step += march.n_step
        ended = n_transient + march.sample // per_revolution + 1
        march, n_transient = case.march(initial), max(0, ended - recording.revolutions)
        is_short = pass_revolutions(march, recording, n_transient) is not None
        marched = march_record(march, setup, 0 if is_short else recording.revolutions)
    else:
        if isinstance(setup, ModalSetup) and setup.release is not None:
            motion = None  # it is left where bearings let go
            through = record_through(march, setup, recording.revolutions, case.march)
            marched, march, n_step = through.marched, through.march, n_step + through.n_step
        else:
            marched = march_record(march, setup, recording.revolutions)
        reason = marched.reason
    n_step += march.n_step
    samples, accumulator, final = marched.samples, marched.accumulator, marched.final
    last, n_before = case, 0
    if through is None:
        add_sag(samples, accumulator, setup.model)
    else:
        last, n_before = replace(case, setup=through.setup), through.n_sample
    if reason is not None:
        n_kept = samples_within(samples, n_before + march.sample, setup.displacement_limit)
        revolution = n_transient + min(n_kept // per_revolution + 1, recording.revolutions)
        record = diverged_record(
            ended_in(reason, revolution),
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
        n_event = 2.0 * float(accumulator.n_contact.sum()) / recording.revolutions
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
                judge=judge_of(last, march, final, n_event) if motion is None else motion.judge,
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
            record.measures.update(exponents_of(last, final))
        if "waveform" not in recording.keep:
            record.signals.clear()
    if motion is not None:
        motion.record = record.copied(), n_step - n_step_before
    return _counted(record, n_transient, n_step)


def _counted(record: Record, n_transient: int, n_step: int) -> Record:
    """Note what it took to come to a record and through it."""
    record.measures.update(transient_revolutions=n_transient, steps=n_step, left_closed_form=0)
    return record


def _spectra(samples: Samples, model: Model) -> dict[str, Floats]:
    """Spectra of all signals, by their names in the schema."""
    spectra = by_name(amplitude_spectrum(samples.whole), model)
    unasked = bore_variables()
    return {f"spectrum_{name}": spectrum for name, spectrum in spectra.items() if name not in unasked}


def exponents_of(case: Case, final: State) -> dict[str, float]:
    """Lyapunov exponents from where a case has ended; NaN where it has no tangent."""
    n_exponent = case.recording.lyapunov
    if not case.has_tangent:
        return dict.fromkeys(lyapunov_variables(n_exponent), math.nan)
    found = spectrum_of(partial(case.motion, final), n_exponent)
    largest = found["lyapunov_1"]
    return found if math.isnan(largest) else found | {"lyapunov_exponent": largest}


def judge_of(case: Case, march: March, final: State, n_event: float) -> Judge:
    """What judges a simulated record: its orbit, neighbouring motions and periodic ones.

    A march of the case that is needed no more is started again; `n_event` are the events in a revolution.
    """
    if not case.is_judged:
        return undecided
    solver = Solver(case.motion, final, cast("ModalMarch", march)) if case.has_tangent else None

    def growth_from(state: State) -> Growth:
        if not case.has_tangent:
            return Growth(lambda: Marches(case.march, state, case.setup, case.recording))
        accuracy = cast("ModalSetup", case.setup).accuracy
        return Growth(lambda: CarriedTangent(case.motion(state, march, accuracy=accuracy)))

    def lasts(exponent: float) -> bool:
        """Whether chaos was followed to the end of what is followed, does not drift and is chaos there."""
        if solver is None or solver.followed is None:
            return False
        energy, end = solver.followed
        if not is_steady(energy):
            return False
        try:
            flag, later = by_growth(growth_from(end))
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
            growth=growth_from(final),
            solve=solver,
            later=solver.later if solver is not None else None,
            lasts=lasts if solver is not None else None,
            n_event=n_event,
        )

    return judge
