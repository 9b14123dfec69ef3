"""A case by the paper's central difference."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.marches.march import NO_FORCES, March
from rubhpc.integrate.marches.workspace import workspace
from rubhpc.integrate.measuring.divergence import displacement_reason, energy_reason
from rubhpc.integrate.measuring.samples import empty_samples, new_accumulator
from rubhpc.integrate.packing import pairs_of
from rubhpc.integrate.record import State
from rubhpc.kernels.central_difference import march as kernel
from rubhpc.kernels.contact_pairs import V, W, fill_directions, pair_normal_and_gap

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.setup import CentralDifferenceSetup
    from rubhpc.kernels.accumulators import Accumulator, Samples
    from rubhpc.kernels.contact_pairs import Pairs, Workspace

    Floats = NDArray[np.float64]

FIRST_STEPS = 20_000  # of the first kernel call
N_START = 4  # iterations for the normals of the first step; each gains five digits


class CentralDifferenceMarch(March):
    """A case by the paper's central difference."""

    def __init__(
        self,
        setup: CentralDifferenceSetup,
        clearance: float,
        friction: float,
        initial: State,
        check: Callable[[], None] | None,
    ) -> None:
        """Start from `initial`, in a first kernel call of some 20 000 steps."""
        super().__init__(check, FIRST_STEPS // setup.steps_per_sample, setup.model)
        self._setup = setup
        self._pairs = pairs_of(
            setup.model,
            row=setup.packed.recorded_row,
            block=setup.packed.degree_block,
            compliance=setup.packed.compliance,
            clearance=clearance,
            friction=friction,
            spin=setup.spin,
            is_updated=setup.is_updated,
            law=setup.law,
        )
        self._work = workspace(self._pairs, setup.step, setup.model.n_place)
        self._state = _start(setup, initial, self._pairs, self._work)
        self._scratch = np.zeros((3, self._state.shape[1]))
        self._reached = np.zeros(1, dtype=np.int64)

    def touching(self) -> NDArray[np.bool_]:
        """Whether each pair was pressed in the last step, (q,)."""
        return self._work.force > 0.0

    def energy(self) -> float:
        """Mechanical energy half a step before the state, J: the form that the scheme itself conserves."""
        packed = self._setup.packed
        displacement, velocity = self._state
        before = displacement - self._setup.step * velocity
        return float(0.5 * (velocity @ packed.mass @ velocity + before @ packed.stiffness @ displacement))

    def final(self) -> State:
        """State at the last sample; a trial step gives the centred velocity and the force there."""
        setup, state = self._setup, self._state.copy()
        q = self._pairs.radius.size
        self._kernel(state, self.sample + 1, 1, empty_samples(q, 0), new_accumulator(q), is_recorded=False)
        velocity = 0.5 * (self._state[1] + state[1])
        row = setup.packed.row
        displacement, velocity = (
            np.where(row >= 0, values[row], 0.0) for values in (self._state[0], velocity)
        )
        displacement[: setup.model.rotor.n_dof] += setup.model.sag
        return State.of_bodies(setup.model, displacement, velocity, self._work.force.copy())

    def _call(
        self, stop: int, samples: Samples, accumulator: Accumulator, *, is_recorded: bool
    ) -> str | None:
        setup = self._setup
        outcome = self._kernel(
            self._state, stop, setup.steps_per_sample, samples, accumulator, is_recorded=is_recorded
        )
        if outcome != kernel.FINISHED:
            self.n_step += (int(self._reached[0]) - self.sample) * setup.steps_per_sample
            self.sample = int(self._reached[0])
        if outcome == kernel.DIVERGED:
            return displacement_reason(setup.model, self._judged(), setup.displacement_limit)
        if outcome == kernel.CONTACT_UNSOLVED:
            return NO_FORCES
        self.n_step += (stop - self.sample) * setup.steps_per_sample
        if not self.energy() <= setup.energy_limit:
            return energy_reason(setup.energy_limit)
        return None

    def _judged(self) -> Floats:
        """Displacements of the nodes that `divergence.judged_nodes` names, v and w of each, m."""
        rims = self._pairs.row[: self._pairs.radius.size, [V, W]]
        rows = np.concatenate([self._setup.packed.output_row[:2], rims.ravel()])
        return np.where(rows >= 0, self._state[0][rows], 0.0)

    def _kernel(
        self,
        state: Floats,
        stop: int,
        steps_per_sample: int,
        samples: Samples,
        accumulator: Accumulator,
        *,
        is_recorded: bool,
    ) -> int:
        return kernel.advance(
            self._setup.stepper,
            self._pairs,
            steps_per_sample,
            self.sample,
            stop,
            is_recorded,
            state,
            self._work,
            self._scratch,
            samples,
            accumulator,
            self._reached,
        )


def _start(setup: CentralDifferenceSetup, initial: State, pairs: Pairs, work: Workspace) -> Floats:
    """Kernel state (2, n_dof): displacement, and velocity half a step earlier."""
    packed = setup.packed
    is_seen = packed.row >= 0

    def gather(rotor: Floats, stators: tuple[Floats, ...]) -> Floats:
        values = np.zeros(packed.mass.shape[0])
        values[packed.row[is_seen]] = np.concatenate([rotor, *stators])[is_seen]
        return values

    displacement = gather(initial.rotor_displacement - setup.model.sag, initial.stator_displacement)
    velocity = gather(initial.rotor_velocity, initial.stator_velocity)
    work.force[:] = initial.contact_force
    is_free = packed.degree_row >= 0
    free_force = packed.force.real.sum(axis=0) - packed.stiffness @ displacement - packed.damping @ velocity
    # The forces of a step act along the normals of its free update, which depends slightly on them.
    for _ in range(N_START if setup.is_updated else 1):
        force = free_force.copy()
        np.add.at(
            force, packed.degree_row[is_free], (work.force_direction * work.force[:, np.newaxis])[is_free]
        )
        acceleration = np.linalg.solve(packed.mass, force)
        end = displacement + setup.step * (velocity + 0.5 * setup.step * acceleration)
        pressed = np.einsum("iajb,jb,j->ia", pairs.compliance, work.force_direction, work.force)
        at = np.where(is_free, end[packed.degree_row], 0.0) - pressed
        for i in range(len(at)):
            ny, nz, _ = pair_normal_and_gap(pairs, i, at[i])
            fill_directions(pairs, i, ny, nz, work.force_direction[i], work.gap_jacobian[i])
    return np.array([displacement, velocity - 0.5 * setup.step * acceleration])
