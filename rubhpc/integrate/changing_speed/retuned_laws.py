"""Contact modes of a penalty and of friction with stick, tuned to the speed of each piece of a run-up."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.integrate.changing_speed.near_modes import Linear
from rubhpc.integrate.changing_speed.retuned_modes import RetunedLibrary
from rubhpc.integrate.reduced_model.contact_mode import left_free
from rubhpc.integrate.reduced_model.friction_library import MOST_FRICTION_MODES
from rubhpc.integrate.reduced_model.friction_mode import FrictionMode, states_of
from rubhpc.integrate.reduced_model.mode_library import SPARE
from rubhpc.integrate.reduced_model.penalty_library import PressedPairs
from rubhpc.integrate.reduced_model.penalty_mode import overlap_rows
from rubhpc.integrate.reduced_model.touching import friction_mode_among, penalty_mode_among
from rubhpc.kernels.contact_modes import LANES
from rubhpc.kernels.friction_states import BACKWARD, OPEN, STUCK, lifted_place
from rubhpc.kernels.retuning_laws import RimPart, Springs

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.integrate.reduced_model.friction_mode import FrictionPairs
    from rubhpc.integrate.reduced_model.penalty_mode import Penalty
    from rubhpc.kernels.contact_modes import ModeTables
    from rubhpc.kernels.retuning import HeldMode

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]


class RetunedPenaltyLibrary(PressedPairs, RetunedLibrary):
    """Contact modes of pairs that press, by spring and damper, or are lifted."""

    def __init__(self, *args: Any, penalty: Penalty, **keys: Any) -> None:
        """Start as `RetunedLibrary` does."""
        self._penalty = penalty
        super().__init__(*args, **keys)

    def _solve(self, mask: int) -> ContactMode:
        if mask == 0:
            return super()._solve(0)
        return penalty_mode_among(self._among, self.reduced, self._penalty, self._opened, mask, self._known)

    def _linear(self, mode: ContactMode) -> Linear:
        penalty, (q, n) = self._penalty, self.slip.shape
        pressed, lifted = penalty.pressed(mode.mask), penalty.lifted(mode.mask)
        gap = self.gap_jacobian
        switch = np.hstack([gap, np.zeros((q, n))])
        tension = np.hstack([penalty.stiffness * gap, penalty.damping * gap])
        switch[pressed], switch[lifted] = -tension[pressed], tension[lifted]
        across = np.zeros((n, q))
        across[:, pressed] = (self.force_direction - gap)[pressed].T
        damping = penalty.damped(self.reduced, mode.mask).damping
        reaction = np.zeros(q, dtype=complex)
        return Linear(self._phasor, switch, reaction, across, damping, np.eye(n))

    def _springs_of(self, mode: ContactMode) -> Springs:
        penalty, pressed = self._penalty, self._penalty.pressed(mode.mask)
        rows = overlap_rows(self.gap_jacobian, pressed, mode, self.width)
        return Springs(0.5 * penalty.stiffness, np.ascontiguousarray(self.gap_jacobian[pressed]), rows)


class RetunedFrictionLibrary(RetunedLibrary):
    """Contact modes of pairs that slide in either sense or stick; masks hold two bits a pair."""

    _most_modes = MOST_FRICTION_MODES

    def __init__(self, *args: Any, pairs: FrictionPairs, **keys: Any) -> None:
        """Start as `RetunedLibrary` does."""
        self._pairs = pairs
        super().__init__(*args, **keys)

    def _solve(self, mask: int) -> ContactMode:
        return friction_mode_among(self._among, self.reduced, self._pairs, mask, self._known)

    def _closed_pairs(self, mask: int) -> list[int]:
        return self._pairs.closed(mask)

    def _width_of(self, model: Model, friction: float) -> int:
        return -(-(self._opened.exponent.size + SPARE) // LANES) * LANES

    def _slip_rows(self) -> Floats:
        return self.slip[:0]

    def _friction_of(self, mode: ContactMode) -> Complexes | None:
        assert isinstance(mode, FrictionMode)
        return mode.friction_forces(self._pairs)

    def _linear(self, mode: ContactMode) -> Linear:
        pairs, reduced, (q, n) = self._pairs, self.reduced, self.slip.shape
        states = np.array(states_of(mode.mask, q))
        closed, stuck = np.flatnonzero(states != OPEN), np.flatnonzero(states == STUCK)
        sense = np.where(states == STUCK, 0.0, np.where(states == BACKWARD, -1.0, 1.0))[closed]
        along_rim, held = pairs.friction_direction, closed[:0] if pairs.stiffness else closed
        rows = np.vstack([pairs.gap_jacobian[held], along_rim[stuck]])
        pressed = pairs.gap_jacobian[closed] + pairs.friction * sense[:, None] * along_rim[closed]
        force = np.vstack([pressed[: held.size], along_rim[stuck]]).T
        stiffness, damping = reduced.stiffness, reduced.damping
        if pairs.stiffness:
            along = pressed.T @ pairs.gap_jacobian[closed]
            stiffness, damping = stiffness + pairs.stiffness * along, damping + pairs.damping * along
        tangent, project = left_free(rows, force)
        switch, reaction, across = (
            np.zeros((2 * q, 2 * n)),
            np.zeros(2 * q, dtype=complex),
            np.zeros((n, 2 * q)),
        )
        switch[2 * np.flatnonzero(states == OPEN), :n] = pairs.gap_jacobian[states == OPEN]
        if closed.size:
            solved = np.linalg.solve(rows @ force, rows)
            forces, given = solved @ np.hstack([stiffness, damping]), solved @ self._phasor
            if pairs.stiffness:  # springs and dampers press
                gap = pairs.gap_jacobian[closed]
                forces = np.vstack([-np.hstack([pairs.stiffness * gap, pairs.damping * gap]), forces])
                given = np.concatenate([np.zeros(closed.size), given])
            static = pairs.friction * pairs.static_ratio
            for a, i in enumerate(closed):
                along = along_rim[i]
                if states[i] == STUCK:
                    t = closed.size + int(np.searchsorted(stuck, i))
                    for row, sign in ((2 * i, -1.0), (2 * i + 1, 1.0)):
                        switch[row] = static * forces[a] + sign * forces[t]
                        reaction[row] = static * given[a] + sign * given[t]
                        across[:, row] = 0.5 * sign * along
                else:
                    switch[2 * i], reaction[2 * i] = forces[a], given[a]
                    switch[2 * i + 1, n:] = -sense[a] * along
                    across[:, 2 * i] = sense[a] * pairs.friction * along
        for i in np.flatnonzero(states == OPEN):
            if mode.mask >> lifted_place(q, int(i)) & 1:
                gap = pairs.gap_jacobian[i]
                switch[2 * i] = np.concatenate([pairs.stiffness * gap, pairs.damping * gap])
        damping = pairs.damped(reduced, mode.mask).damping
        passed = tangent @ project
        return Linear(passed @ self._phasor, switch, reaction, across, damping, passed)

    def _hold(self, mode: ContactMode, row: ModeTables | None, linear: Linear) -> HeldMode:
        assert isinstance(mode, FrictionMode)
        held = super()._hold(mode, row, linear)
        q = len(self.slip)
        one = mode.n_eigenmode + 1 + q
        switch = mode.switch[:, one].copy()
        fixed = np.zeros_like(switch)
        for i in range(q):
            if mode.mask >> 2 * i & 3 == OPEN:
                fixed[2 * i + 1], switch[2 * i + 1] = 1.0, 0.0
        growing = np.flatnonzero(mode.growth)
        if not switch.any() and not growing.size:
            return held
        entered = np.zeros(self.width, dtype=np.complex128)
        entered[: mode.take_off.shape[1]] = mode.take_off[2 + q]
        rim = RimPart(
            one=one,
            motion=mode.motion[:, one].copy(),
            entered=entered,
            switch=switch,
            fixed=fixed,
            rate=mode.switch[:, growing] @ mode.growth[growing].astype(np.complex128),
            loss=row.loss[0][[one, self.width + one]].copy() if row else np.zeros((0, 0)),
            power=float((held.rate[one] @ held.resisting[one]).real),
            velocity=held.rate[one].copy(),
            resisting=held.resisting[one].copy(),
            row=held.row[:, one].copy(),
            work=held.work[:, one].copy(),
            growing=growing,
            speed=mode.growth[growing],
        )
        return held._replace(rim=rim)
