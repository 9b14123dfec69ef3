"""Integrates one case: kernel calls, then measures; no files, no MPI."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.gather import (
    diverged_record,
    empty_samples,
    empty_tally,
    named_signals,
    scalars_of,
)
from rubhpc.kernels import central_difference, observe
from rubhpc.kernels.contact import N_DEGREE, Workspace, fill_directions, fill_matrix
from rubhpc.measures import amplitude_spectrum
from rubhpc.packing import pairs_of
from rubhpc.record import Record, State
from rubhpc.schema import DONE, SECTION_NAMES

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.kernels.contact import Pairs
    from rubhpc.prepare import Setup
    from rubhpc.study import Recording

    Floats = NDArray[np.float64]

LONGEST_CALL = 0.15  # s; signals are answered between kernel calls


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
        Where to start, with the unbalance at its phase; default at rest.
    check : callable, optional
        Called between kernel calls, a quarter of a second apart at most; what it raises ends the case.
    """
    began = time.perf_counter()
    pairs = pairs_of(
        setup.model,
        setup.packed,
        clearance=clearance,
        friction=friction,
        spin=setup.spin,
        is_updated=setup.is_updated,
    )
    work = _workspace(pairs)
    state = _start(setup, initial or State.at_rest(setup.model), work)
    run = _Run(setup, pairs, work, state, check)
    n_stator = len(setup.model.stators)
    n_transient = recording.transient * setup.samples_per_revolution
    n_sample = recording.revolutions * setup.samples_per_revolution
    samples, tally = empty_samples(n_stator, n_sample), empty_tally(n_stator)
    settings = {"spin_speed": setup.spin, "clearance": clearance}

    outcome = run.advance(-n_transient, 0, samples, tally, is_recorded=False)
    energy_before = _energy(setup, state)
    tally.is_touching[:] = work.force > 0.0  # a contact under way did not begin in the record
    if outcome == central_difference.FINISHED:
        outcome = run.advance(0, n_sample, samples, tally, is_recorded=True)
    if outcome != central_difference.FINISHED:
        revolution = recording.transient + run.sample / setup.samples_per_revolution
        what = (
            f"a displacement passed {setup.displacement_limit:.3g} m"
            if outcome == central_difference.DIVERGED
            else "the contact forces of a step have no solution"
        )
        record = diverged_record(
            f"{what} in revolution {math.floor(revolution) + 1}", n_stator, recording, settings, run.final()
        )
    else:
        signals = named_signals(samples)
        record = Record(
            status=DONE,
            samples_per_revolution=setup.samples_per_revolution,
            signals=signals,
            spectra={f"spectrum_{name}": amplitude_spectrum(signal) for name, signal in signals.items()}
            if "spectrum" in recording.keep
            else {},
            sections={
                f"section_{name}": signals[name][:: setup.samples_per_revolution].copy()
                for name in SECTION_NAMES
            }
            if "section" in recording.keep
            else {},
            scalars=scalars_of(
                tally,
                signals,
                energy_change=_energy(setup, state) - energy_before,
                stators=setup.model.stators,
                step=setup.step,
                steps_per_sample=setup.steps_per_sample,
                samples_per_revolution=setup.samples_per_revolution,
            ),
            settings=settings,
            final=run.final(),
        )
        if "waveform" not in recording.keep:
            record.signals.clear()
    record.scalars["steps"] = run.n_step
    record.scalars["wall_time"] = time.perf_counter() - began
    return record


class _Run:
    """A case under way: the kernel's state, and how many steps it has taken."""

    def __init__(
        self,
        setup: Setup,
        pairs: Pairs,
        work: Workspace,
        state: Floats,
        check: Callable[[], None] | None,
    ) -> None:
        self.setup, self.pairs, self.work, self.state, self.check = setup, pairs, work, state, check
        self.scratch = np.zeros((3, state.shape[1]))
        self.n_step = 0
        self.sample = 0
        self._stride = max(1, 20_000 // setup.steps_per_sample)  # samples a call, adapted to its duration

    def advance(
        self, first: int, last: int, samples: observe.Samples, tally: observe.Tally, *, is_recorded: bool
    ) -> int:
        self.sample = first
        while self.sample < last:
            if self.check is not None:
                self.check()
            began = time.perf_counter()
            stop = min(self.sample + self._stride, last)
            outcome = self._call(self.state, stop, self.setup.steps_per_sample, samples, tally, is_recorded)
            if outcome != central_difference.FINISHED:
                return outcome
            self.n_step += (stop - self.sample) * self.setup.steps_per_sample
            self.sample = stop
            elapsed = max(time.perf_counter() - began, 1e-6)
            self._stride = max(1, int(self._stride * min(2.0, 0.5 * LONGEST_CALL / elapsed)))
        return central_difference.FINISHED

    def final(self) -> State:
        """State at the last sample; a trial step gives the centred velocity and the force there."""
        setup, state = self.setup, self.state.copy()
        none = empty_samples(self.pairs.radius.size, 0), empty_tally(self.pairs.radius.size)
        self._call(state, self.sample + 1, 1, *none, False)
        velocity = 0.5 * (self.state[1] + state[1])
        bodies = [setup.model.rotor, *(stator.body for stator in setup.model.stators)]
        parts = np.split(setup.packed.row, np.cumsum([body.n_dof for body in bodies])[:-1])

        def pick(values: Floats, row: NDArray[np.int64]) -> Floats:
            return np.where(row >= 0, values[row], 0.0)

        return State(
            rotor_displacement=pick(self.state[0], parts[0]),
            rotor_velocity=pick(velocity, parts[0]),
            stator_displacement=tuple(pick(self.state[0], part) for part in parts[1:]),
            stator_velocity=tuple(pick(velocity, part) for part in parts[1:]),
            contact_force=self.work.force.copy(),
        )

    def _call(
        self,
        state: Floats,
        stop: int,
        steps_per_sample: int,
        samples: observe.Samples,
        tally: observe.Tally,
        is_recorded: bool,
    ) -> int:
        setup = self.setup
        return central_difference.advance(
            setup.packed.linear,
            self.pairs,
            setup.spin,
            setup.step,
            steps_per_sample,
            setup.samples_per_revolution,
            self.sample,
            stop,
            is_recorded,
            setup.displacement_limit,
            setup.packed.output_row,
            state,
            self.work,
            self.scratch,
            samples,
            tally,
        )


def _start(setup: Setup, initial: State, work: Workspace) -> Floats:
    """Kernel state (2, n_dof): displacement, and velocity half a step earlier."""
    packed = setup.packed
    is_seen = packed.row >= 0

    def gather(rotor: Floats, stators: tuple[Floats, ...]) -> Floats:
        values = np.zeros(packed.mass.shape[0])
        values[packed.row[is_seen]] = np.concatenate([rotor, *stators])[is_seen]
        return values

    displacement = gather(initial.rotor_displacement, initial.stator_displacement)
    velocity = gather(initial.rotor_velocity, initial.stator_velocity)
    work.force[:] = initial.contact_force
    force = packed.force[0] - packed.stiffness @ displacement - packed.damping @ velocity
    for i, rows in enumerate(packed.degree_row):
        for a, row in enumerate(rows):
            if row >= 0:
                force[row] += work.pull[i, a] * initial.contact_force[i]
    acceleration = np.linalg.solve(packed.mass, force)
    return np.array([displacement, velocity - 0.5 * setup.step * acceleration])


def _workspace(pairs: Pairs) -> Workspace:
    q = pairs.radius.size
    work = Workspace(
        at=np.zeros((q, N_DEGREE)),
        pull=np.zeros((q, N_DEGREE)),
        push=np.zeros((q, N_DEGREE)),
        matrix=np.zeros((q, q)),
        gap=np.zeros(q),
        force=np.zeros(q),
        active=np.zeros(q, dtype=np.bool_),
        elimination=np.zeros((q, q + 1)),
        moved=np.zeros(N_DEGREE),
    )
    for i in range(q):
        fill_directions(pairs, i, pairs.axis_y[i], pairs.axis_z[i], work.pull[i], work.push[i])
    fill_matrix(pairs, work)
    return work


def _energy(setup: Setup, state: Floats) -> float:
    """Mechanical energy half a step before the state, J: the form that the scheme itself conserves."""
    packed = setup.packed
    displacement, velocity = state
    before = displacement - setup.step * velocity
    return float(0.5 * (velocity @ packed.mass @ velocity + before @ packed.stiffness @ displacement))
