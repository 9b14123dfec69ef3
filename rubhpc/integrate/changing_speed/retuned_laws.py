"""Contact modes of a penalty and of friction with stick, tuned to the speed of each piece of a run-up."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray  # noqa: TC002 - of a NamedTuple

from rubhpc.integrate.changing_speed.retuned_modes import Linear, RetunedLibrary
from rubhpc.integrate.reduced_model.contact_mode import confine
from rubhpc.integrate.reduced_model.friction_mode import FrictionMode, solve_friction_mode, states_of
from rubhpc.integrate.reduced_model.mode_library import LANES, MOST_FRICTION_MODES, SPARE
from rubhpc.integrate.reduced_model.penalty_mode import overlap_rows, solve_penalty_mode
from rubhpc.kernels.friction_states import BACKWARD, OPEN, STUCK, lifted_place

if TYPE_CHECKING:
    from rubhpc.fem.model import Model
    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.integrate.reduced_model.friction_mode import FrictionPairs
    from rubhpc.integrate.reduced_model.penalty_mode import Penalty
    from rubhpc.integrate.reduced_model.reduction import ReducedModel
    from rubhpc.kernels.contact_modes import ModeTables
    from rubhpc.kernels.retuning import HeldMode

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]


class RetunedPenaltyLibrary(RetunedLibrary):
    """Contact modes of pairs that press, by spring and damper, or are lifted."""

    def __init__(self, *args: Any, penalty: Penalty, **keys: Any) -> None:
        """Start as `RetunedLibrary` does."""
        self._penalty = penalty
        self._springs: list[Floats] = []  # overlap of each pressed pair of a mode by its coordinates
        super().__init__(*args, **keys)

    def forget(self) -> None:
        """Make room: keep no mode but that with every pair open."""
        self._springs.clear()
        super().forget()

    def _solve(self, mask: int) -> ContactMode:
        if mask == 0:
            return super()._solve(0)
        return solve_penalty_mode(self.reduced, self._penalty, self._opened, mask, self._known)

    def _tables_of(self, mode: ContactMode, reduced: ReducedModel) -> ModeTables:
        tables = super()._tables_of(mode, self._penalty.damped(reduced, mode.mask))
        tables.loss[0] += self._penalty.stored_energy(mode, self.width)
        return tables

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
        return Linear(self._phasor, switch, np.zeros(q, dtype=complex), across, damping)

    def _hold(self, mode: ContactMode) -> HeldMode:
        self._springs.append(
            overlap_rows(self.gap_jacobian, self._penalty.pressed(mode.mask), mode, self.width)
        )
        return super()._hold(mode)

    def _after(self, place: int, tables: ModeTables) -> None:
        """Springs hold energy by the response too."""
        rows = self._springs[place]
        if not len(rows):
            return
        m, n = self._held[place].is_pair.size, self.slip.shape[1]
        gap = self.gap_jacobian[self._penalty.pressed(self._mask_of(place))]
        both = slice(m, None, self.width)  # its real and imaginary part, which the kernel has filled anew
        rows[:, m] = gap @ tables.motion_re[place, :n, m]
        rows[:, self.width + m] = -(gap @ tables.motion_im[place, :n, m])
        loss = tables.loss[place]
        form = (0.5 * self._penalty.stiffness * rows[:, both].T) @ rows
        loss[both] += form
        loss[:, both] += form.T
        loss[both, both] -= form[:, both]

    def _mask_of(self, place: int) -> int:
        return next(mask for mask, known in self._place.items() if known == place)


class SteadyPart(NamedTuple):
    """What goes as the rims move, at the speed of the matrices: the coordinate that is 1, and what grows."""

    one: int
    motion: Complexes  # (2 n,)
    entered: Complexes  # (width,), of its part of `enter_constant`
    switch: Complexes  # (r,), what of it grows with the speed
    fixed: Complexes  # (r,), what does not
    rate: Complexes  # (r,)
    loss: Floats  # (2, 2 width), rows of the form
    power: float  # W
    held: tuple[Complexes, Complexes, Complexes, Complexes]  # rows of `HeldMode`: rate, resisting, row, work
    growing: NDArray[np.int64]  # coordinates that grow
    speed: Floats  # m/s


class RetunedFrictionLibrary(RetunedLibrary):
    """Contact modes of pairs that slide in either sense or stick; masks hold two bits a pair."""

    _most_modes = MOST_FRICTION_MODES

    def __init__(self, *args: Any, pairs: FrictionPairs, **keys: Any) -> None:
        """Start as `RetunedLibrary` does."""
        self._pairs = pairs
        self._steady: list[SteadyPart] = []
        super().__init__(*args, **keys)

    def forget(self) -> None:
        """Make room: keep no mode but that with every pair open."""
        self._steady.clear()
        super().forget()

    def _solve(self, mask: int) -> ContactMode:
        return solve_friction_mode(self.reduced, self._pairs, mask, self._known)

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
        tangent, project, _ = confine(reduced, rows, force)
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
        return Linear(tangent @ (project @ self._phasor), switch, reaction, across, damping)

    def _hold(self, mode: ContactMode) -> HeldMode:
        assert isinstance(mode, FrictionMode)
        held, place, tables = super()._hold(mode), len(self._held), self.tables()
        q = len(self.slip)
        one = mode.n_eigenmode + 1 + q
        switch = mode.switch[:, one].copy()
        fixed = np.zeros_like(switch)
        for i in range(q):
            if mode.mask >> 2 * i & 3 == OPEN:
                fixed[2 * i + 1], switch[2 * i + 1] = 1.0, 0.0
        growing = np.flatnonzero(mode.growth)
        loss = tables.loss[place][[one, self.width + one]].copy()
        self._steady.append(
            SteadyPart(
                one=one,
                motion=mode.motion[:, one].copy(),
                entered=tables.enter_constant[place, q, 0] + 1j * tables.enter_constant[place, q, 1],
                switch=switch,
                fixed=fixed,
                rate=mode.switch[:, growing] @ mode.growth[growing],
                loss=loss,
                power=float((held.rate[one] @ held.resisting[one]).real),
                held=(
                    held.rate[one].copy(),
                    held.resisting[one].copy(),
                    held.row[:, one].copy(),
                    held.work[:, one].copy(),
                ),
                growing=growing,
                speed=mode.growth[growing],
            )
        )
        return held

    def _before(self, place: int, tables: ModeTables) -> None:
        """Bring what goes as the rims move to their speed."""
        steady, held, q = self._steady[place], self._held[place], len(self.slip)
        if not steady.switch.any() and not steady.growing.size:
            return
        one, width = steady.one, self.width
        share = abs(self._spin / self.reduced.spin)
        rate, resisting, row, work = steady.held
        held.rate[one], held.resisting[one] = share * rate, share * resisting
        held.row[:, one], held.work[:, one] = share * row, share * work
        switch = share * steady.switch + steady.fixed
        for name, values in (
            ("motion", share * steady.motion),
            ("switch", switch),
            ("rate", share * steady.rate),
        ):
            getattr(tables, f"{name}_re")[place, :, one] = values.real
            getattr(tables, f"{name}_im")[place, :, one] = values.imag
        entered = share * steady.entered
        tables.enter_constant[place, q, 0], tables.enter_constant[place, q, 1] = entered.real, entered.imag
        form = share * steady.loss
        tables.loss[place][[one, width + one]] = form
        tables.loss[place][:, [one, width + one]] = form.T

    def _after(self, place: int, tables: ModeTables) -> None:
        """Switch functions of the response, and what it shares with coordinates that grow."""
        held, steady = self._held[place], self._steady[place]
        m, width, turning = held.is_pair.size, self.width, 1j * self._spin
        x = tables.motion_re[place, :, m] + 1j * tables.motion_im[place, :, m]
        switch = held.switch @ x - self._factor * held.reaction
        rate = turning * switch
        tables.switch_re[place, :, m], tables.switch_im[place, :, m] = switch.real, switch.imag
        tables.rate_re[place, :, m], tables.rate_im[place, :, m] = rate.real, rate.imag
        tables.bound[place, :, m] = np.abs(switch) * self._spin**2
        share = abs(self._spin / self.reduced.spin)
        tables.steady_power[place, 0] += share**2 * steady.power
        if not steady.growing.size:
            return
        velocity, against = x[self.slip.shape[1] :], held.resisting[steady.growing].T
        speed = share * steady.speed / self._spin**2  # over the square of i W, which is negative
        itself, conjugate = speed @ (velocity @ against), speed @ (velocity @ against.conj())
        both, apart = 0.25 * (itself + conjugate), 0.25 * (conjugate - itself)
        added = np.array([[both.real, apart.imag], [-both.imag, apart.real]])
        here, there = (
            np.ix_([m, width + m], [steady.one, width + steady.one]),
            np.ix_([steady.one, width + steady.one], [m, width + m]),
        )
        tables.loss[place][here] += added
        tables.loss[place][there] += added.T
