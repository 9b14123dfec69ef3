"""Integrates one case: kernel calls, then measures; no files, no MPI."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import TYPE_CHECKING

from rubhpc.integrate.central_difference_march import CentralDifferenceMarch
from rubhpc.integrate.contact_stepping_march import SteppedMarch
from rubhpc.integrate.event_driven_march import ModalMarch, NoClosedForm
from rubhpc.integrate.initial_state import at_rest, carried, with_overlap
from rubhpc.integrate.lyapunov import Marches, growth
from rubhpc.integrate.measures import (
    add_sag,
    by_name,
    diverged_record,
    empty_samples,
    empty_tally,
    measures_of,
)
from rubhpc.integrate.neighbour_motions import ModalNeighbours
from rubhpc.integrate.orbit_measures import amplitude_spectrum
from rubhpc.integrate.record import Record, State
from rubhpc.integrate.setup import CentralDifferenceSetup, ModalSetup
from rubhpc.integrate.transient import pass_transient
from rubhpc.kernels.accumulators import IMPACT_STEPS
from rubhpc.schema import DONE, SECTION_NAMES

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from rubhpc.integrate.lyapunov import Neighbours
    from rubhpc.integrate.march import March
    from rubhpc.integrate.setup import Setup
    from rubhpc.kernels.accumulators import Samples
    from rubhpc.study.study import Recording

    Floats = NDArray[np.float64]


def run_case(
    setup: Setup,
    *,
    clearance: float,
    friction: float,
    recording: Recording,
    initial: State | None = None,
    check: Callable[[], None] | None = None,
) -> Record:
    """Integrate one case and measure it.

    Parameters
    ----------
    clearance : float, m
        Radial clearance at rest; a stator's `clearance_offset` is added.
    friction : float
        Coefficient of friction.
    initial : State, optional
        Where to start, with the unbalance at its phase 0; default at rest (`carry.at_rest`). Where another
        case has ended is fitted to the gaps of this one (`carry.carried`).
    check : callable, optional
        Called between kernel calls, a quarter of a second apart at most; what it raises ends the case.
    """
    began = time.perf_counter()
    initial = at_rest(setup, clearance) if initial is None else carried(initial, setup, clearance)

    def start(state: State) -> March:
        return _march(setup, clearance, friction, state, check)

    def start_stepped(state: State) -> March:
        assert isinstance(setup, ModalSetup)
        return SteppedMarch(setup, clearance, friction, state, check)

    try:
        record = _integrate(start, initial, setup, clearance, recording)
    except NoClosedForm:
        # Contacts that chatter, or too many sets of them, or slip that turns: short steps need no events.
        record = _integrate(start_stepped, initial, setup, clearance, recording)
    record = replace(record, final=with_overlap(record.final, setup, clearance))
    record.measures["wall_time"] = time.perf_counter() - began
    return record


def compile_kernels(
    setup: Setup,
    *,
    clearance: float,
    friction: float,
    recording: Recording,
    check: Callable[[], None] | None = None,
) -> None:
    """Compile all that cases of this set-up may call, on two revolutions, those of endless events too."""
    short = replace(recording, transient=1, revolutions=1)
    run_case(setup, clearance=clearance, friction=friction, recording=short, check=check)
    if isinstance(setup, ModalSetup):

        def start(state: State) -> March:
            return SteppedMarch(setup, clearance, friction, state, check)

        _integrate(start, State.at_rest(setup.model), setup, clearance, short)
        if not setup.is_stepped:
            march = ModalMarch(setup, clearance, friction, State.at_rest(setup.model), check)
            ModalNeighbours(march).part(1)


def _integrate(
    start: Callable[[State], March], initial: State, setup: Setup, clearance: float, recording: Recording
) -> Record:
    """March through transient and record, then measure."""
    march = start(initial)
    per_revolution = setup.samples_per_revolution
    n_stator = len(setup.model.stators)
    n_sample = recording.revolutions * per_revolution
    samples, tally = empty_samples(n_stator, n_sample), empty_tally(n_stator)
    settings = {"spin_speed": setup.spin, "clearance": clearance}

    reason, n_transient = pass_transient(march, recording)
    if reason is None:
        energy_before = march.energy()
        tally.is_touching[:] = march.touching()  # a contact under way did not begin in the record
        tally.age[tally.is_touching] = IMPACT_STEPS
        reason = march.advance(0, n_sample, samples, tally, is_recorded=True)
    if reason is not None:
        seen = math.floor(n_transient + march.sample / per_revolution) + 1
        revolution = min(seen, n_transient + recording.revolutions)  # what ends the record was in it
        record = diverged_record(
            f"{reason} in revolution {revolution}", n_stator, recording, settings, march.final()
        )
    else:
        add_sag(samples, tally, setup.model)
        signals, final = by_name(samples.whole), march.final()
        record = Record(
            status=DONE,
            samples_per_revolution=per_revolution,
            signals=signals,
            spectra=_spectra(samples) if "spectrum" in recording.keep else {},
            sections={f"section_{name}": signals[name][::per_revolution].copy() for name in SECTION_NAMES}
            if "section" in recording.keep
            else {},
            measures=measures_of(
                tally,
                signals,
                energy=(energy_before, march.energy()),
                stators=setup.model.stators,
                spin=setup.spin,
                samples_per_revolution=per_revolution,
                growth=growth(lambda: _neighbours(march, start, final, setup, recording)),
            ),
            settings=settings,
            final=final,
        )
        if "waveform" not in recording.keep:
            record.signals.clear()
    record.measures.update(transient_revolutions=n_transient, steps=march.n_step)
    return record


def _neighbours(
    march: March, start: Callable[[State], March], final: State, setup: Setup, recording: Recording
) -> Neighbours:
    """The motion from where a march has ended, and one beside it."""
    if type(march) is ModalMarch:
        return ModalNeighbours(march)
    return Marches(start, final, setup, recording)


def _spectra(samples: Samples) -> dict[str, Floats]:
    """Spectra of all signals, by their names in the schema."""
    spectra = by_name(amplitude_spectrum(samples.whole))
    return {f"spectrum_{name}": spectrum for name, spectrum in spectra.items()}


def _march(
    setup: Setup, clearance: float, friction: float, initial: State, check: Callable[[], None] | None
) -> March:
    """Start the case with the integrator that its set-up is for."""
    if isinstance(setup, CentralDifferenceSetup):
        return CentralDifferenceMarch(setup, clearance, friction, initial, check)
    if setup.is_stepped:
        return SteppedMarch(setup, clearance, friction, initial, check)
    return ModalMarch(setup, clearance, friction, initial, check)
