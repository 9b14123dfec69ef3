"""Contact modes whose matrices stay while the spin speed changes: only the unbalance response is renewed.

A library holds the contact modes of a set of matrices, and tunes them to the speeds of a run-up's pieces
(`kernels.retuning`), several of them at once.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray  # noqa: TC002 - of a NamedTuple

from rubhpc.integrate.changing_speed.eigenmodes import Eigenmodes
from rubhpc.integrate.reduced_model.contact_mode import confine, solve_contact_mode
from rubhpc.integrate.reduced_model.mode_library import ModeLibrary, width_without_modes
from rubhpc.integrate.reduced_model.mode_tables import TableStack
from rubhpc.integrate.reduced_model.reduction import ReducedModel, directions
from rubhpc.kernels.contact_pairs import AXIAL, LATERAL
from rubhpc.kernels.retuning import HeldMode, Speeds, retune
from rubhpc.kernels.retuning_laws import NO_RIM, RimPart, Springs

NOT_TUNED = -2  # in place of a set of closed pairs: a contact mode that this piece has not met
AT_ONCE = 8  # pieces to whose speeds a contact mode is tuned at once
MOST_BYTES = 2**22  # of its tables for so many pieces; where they are more, pieces take turns in one

if TYPE_CHECKING:
    from rubhpc.fem.model import Model
    from rubhpc.integrate.reduced_model.contact_mode import ContactMode, Solved

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]
    Ints = NDArray[np.int64]


class RetunedLibrary(ModeLibrary):
    """Contact modes of one set of matrices and one friction, tuned to one spin speed after the other.

    Parameters
    ----------
    reduced : ReducedModel
        Matrices; its spin and force are those of some speed.
    phasor : (n,), complex
        Unbalance at unit speed, kg m: at the speed W its force is `Re[W^2 phasor exp(i W t)]`, N.
    tick : float, s
    sample_level, n_level : int
        As in `ModeLibrary`; levels stay, the tick changes with the speed.
    """

    at_once = AT_ONCE

    def __init__(
        self,
        reduced: ReducedModel,
        model: Model,
        friction: float,
        *,
        phasor: Complexes,
        known: Solved,
        tick: float,
        sample_level: int,
        n_level: int,
    ) -> None:
        """Start with every pair open."""
        self.reduced, self._known = reduced, known
        self.gap_jacobian, self.force_direction, self.slip = directions(reduced, model, friction)
        self._tick, self._sample_level, self._n_level = tick, sample_level, n_level
        self._phasor, self._output = phasor, _output_operators(reduced)
        self._opened = self._solve(0)
        self.first_masks = [0]
        self.width = self._width_of(model, friction)
        self._tables = TableStack(1 + len(self.gap_jacobian), self._most_modes)
        self._exponents = {}
        self.n_room = 0  # tables that each mode has, for as many pieces
        self._place: dict[int, int] = {}  # of each set of closed pairs: the first of its tables
        self._held: dict[int, HeldMode] = {}  # by place
        self._tuned: dict[int, int] = {}  # by place: up to which piece of those at hand
        self._speeds = speeds_of(
            [reduced.spin], [complex(reduced.spin**2)], [tick], reduced.spin, sample_level
        )
        self._at = 0  # piece among those at hand
        self.masks: list[int] = []
        self.add(0)

    @property
    def n_most(self) -> int:
        """Contact modes that there is room for."""
        return self._tables.n_most // max(1, self.n_room)

    @property
    def is_full(self) -> bool:
        """Whether there is no room for another contact mode."""
        return len(self._held) >= self.n_most

    def unmet(self, met: set[int]) -> list[int]:
        """None: each piece begins with no mode."""
        return []

    def tune(self, speeds: Speeds, piece: int) -> None:
        """Begin a piece, given by its place among the speeds: with no mode."""
        if speeds is not self._speeds or piece <= self._at:
            self._speeds, self._tuned = speeds, {}
        self.reach(piece)

    def reach(self, piece: int) -> None:
        """Go on to a later piece of those at hand, with no mode, though some may be tuned already."""
        self._at = piece
        self.masks = [NOT_TUNED] * len(self.masks)
        self.tables().mask[:] = NOT_TUNED

    def add(self, mask: int) -> bool:
        """Tune the mode with these pairs closed; returns whether the tables are wide enough for it."""
        if mask not in self._place:
            mode = self._solved(mask)
            if mode.exponent.size > self.width:
                return False
            self._take_in(mode)
        first, at, speeds = self._place[mask], self._at, self._speeds
        place = first + (at if self.n_room > 1 else 0)
        if self._tuned.get(first, 0) <= at:
            end = min(speeds.spin.size, self.n_room) if self.n_room > 1 else at + 1
            retune(self.tables(), place - at, self._held[first], speeds, at, end)
            self._tuned[first] = end
        self.masks[place] = self.tables().mask[place] = mask
        return True

    def eigenmodes(self, mask: int) -> Eigenmodes | None:
        """Those of a set of closed pairs; None where a speed changes what enters them, or it has no room."""
        if mask not in self._place:
            if self.is_full:
                self.forget()
            mode = self._solved(mask)
            if mode.exponent.size > self.width:
                return None
            self._take_in(mode)
        place, tables = self._place[mask], self.tables()
        held, m = self._held[place], self._held[place].is_pair.size
        if held.rim.one >= 0:
            return None
        constant = tables.enter_constant[place, :, :, :m]
        return Eigenmodes(
            exponent=held.exponent[:m],
            is_pair=held.is_pair,
            motion=held.motion.T,
            enter=(tables.enter_re[place, :, :m] + 1j * tables.enter_im[place, :, :m]).T,
            constant=constant[:, 0] + 1j * constant[:, 1],
            drive=held.drive,
            mirrored_drive=held.mirrored_drive,
        )

    def tuned(self, met: set[int]) -> Ints:
        """Sets of closed pairs of the tables that are tuned to this piece or to later ones, of those met."""
        found = np.full(len(self.masks), NOT_TUNED)
        for mask, first in self._place.items():
            if mask in met:
                found[first + self._at : first + self._tuned.get(first, 0)] = mask
        return found

    def _take_in(self, mode: ContactMode) -> None:
        """Make room for a mode that is met for the first time."""
        place = len(self.masks)
        self._tabulate(mode)
        is_small = self.at_once * self._tables.n_byte_of_one <= MOST_BYTES
        self.n_room = self.n_room or (self.at_once if is_small else 1)
        self._place[mode.mask] = place
        self._held[place] = self._hold(mode, place)
        self._tables.repeat(self.n_room - 1)
        self.masks += [NOT_TUNED] * self.n_room
        self.tables().mask[place:] = NOT_TUNED

    def forget(self) -> None:
        """Make room: keep no mode but that with every pair open."""
        self._tables.clear()
        self._exponents.clear()
        for known in (self._place, self._held, self._tuned):
            known.clear()
        self.masks = []
        self.add(0)

    def _solve(self, mask: int) -> ContactMode:
        """The mode of a set of states."""
        return solve_contact_mode(self.reduced, self.gap_jacobian, self.force_direction, mask, self._known)

    def _solved(self, mask: int) -> ContactMode:
        return self._opened if mask == 0 else self._solve(mask)

    def _width_of(self, model: Model, friction: float) -> int:
        """Width of tables for any mode that is met later."""
        return width_without_modes(self.reduced, model, friction, self._opened.exponent.size)

    def _linear(self, mode: ContactMode) -> Linear:
        """What a set of closed pairs makes of the motion."""
        reduced, q, n = self.reduced, *self.slip.shape
        closed = np.array([i for i in range(q) if mode.mask >> i & 1], dtype=int)
        rate, force = self.gap_jacobian[closed], self.force_direction[closed].T
        tangent, project, _ = confine(reduced, rate, force)
        switch, reaction = np.hstack([self.gap_jacobian, np.zeros((q, n))]), np.zeros(q, dtype=complex)
        if closed.size:
            solved = np.linalg.solve(rate @ force, rate)
            switch[closed] = solved @ np.hstack([reduced.stiffness, reduced.damping])
            reaction[closed] = solved @ self._phasor
        across = np.zeros((n, q))
        across[:, closed] = (self.force_direction - self.gap_jacobian)[closed].T
        return Linear(tangent @ (project @ self._phasor), switch, reaction, across, reduced.damping)

    def _hold(self, mode: ContactMode, place: int) -> HeldMode:
        """What the spin speed leaves alone of a mode, whose tables are at `place`."""
        reduced, m, width = self.reduced, mode.n_eigenmode, self.width
        linear, slip = self._linear(mode), self._slip_rows()
        n = slip.shape[1]
        skew = 0.5 * (reduced.stiffness - reduced.stiffness.T)
        resistance = np.hstack([skew, linear.damping]) - linear.across @ linear.switch
        motion = np.pad(mode.motion, ((0, 0), (0, width - mode.exponent.size)))
        exponent = np.pad(mode.exponent, (0, width - mode.exponent.size))
        position, velocity, acceleration = self._output
        row = position @ motion[:n] + velocity @ motion[n:]
        row += (acceleration @ motion[n:]) * exponent
        # An inverse shape times its shape is 2 where a mode stands for a conjugate pair, and is doubled.
        enter = mode.enter[:m]
        doubled = np.einsum("ka,ak->k", enter, mode.motion[:, :m]).real
        resisting = np.hstack([skew, linear.damping]) @ motion
        resisting[:, : mode.exponent.size] -= linear.across @ mode.switch
        return HeldMode(
            n_coordinate=mode.exponent.size,
            exponent=exponent,
            is_pair=doubled > 1.5,
            motion=np.ascontiguousarray(mode.motion[:, :m].T),
            drive=enter[:, n:] @ linear.seen,
            mirrored_drive=enter[:, n:].conj() @ linear.seen,
            switch=linear.switch,
            reaction=linear.reaction,
            slip=np.ascontiguousarray(slip),
            resistance=resistance,
            rate=np.ascontiguousarray(motion[n:].T),
            rubbed=linear.across @ linear.reaction,
            resisting=np.ascontiguousarray(resisting.T),
            phasor=self._phasor,
            work=np.stack([self._phasor @ motion[n:], self._phasor.conj() @ motion[n:]]),
            output=np.hstack(self._output),
            row=row,
            rim=_WITHOUT_RIM,
            springs=self._springs_of(mode),
        )

    def _springs_of(self, mode: ContactMode) -> Springs:
        """Springs that press in a mode."""
        return Springs(0.0, self.gap_jacobian[:0], np.zeros((0, 2 * self.width)))


def speeds_of(
    spin: ArrayLike, factor: ArrayLike, tick: ArrayLike, held_spin: float, sample_level: int
) -> Speeds:
    """Speeds (rad/s) to which modes are tuned whose matrices are those at `held_spin`.

    `factor` (1/s^2) is what the unbalance at unit speed acts by, `tick` (s) the resolution of events.
    """
    spins, ticks = np.asarray(spin, dtype=np.float64), np.asarray(tick, dtype=np.float64)
    factors = np.asarray(factor, dtype=np.complex128)
    return Speeds(spins, np.abs(spins / held_spin), factors, ticks, ticks * 2.0**sample_level)


_NONE = np.zeros(0, dtype=np.complex128)
_WITHOUT_RIM = RimPart(
    one=NO_RIM,
    motion=_NONE,
    entered=_NONE,
    switch=_NONE,
    fixed=_NONE,
    rate=_NONE,
    loss=np.zeros((0, 0)),
    power=0.0,
    velocity=_NONE,
    resisting=_NONE,
    row=_NONE,
    work=_NONE,
    growing=np.zeros(0, dtype=np.int64),
    speed=np.zeros(0),
)


class Linear(NamedTuple):
    """What a set of states makes of the motion: n reduced degrees, r switch functions."""

    seen: Complexes  # (n,), what the constraints leave of the unbalance at unit speed
    switch: Floats  # (r, 2 n), switch functions of the motion
    reaction: Complexes  # (r,), what they lose by the unbalance at unit speed
    across: Floats  # (n, r), friction forces by switch functions
    damping: Floats  # (n, n)


def _output_operators(reduced: ReducedModel) -> tuple[Floats, Floats, Floats]:
    """Rows of tables (`kernels.contact_modes`): of displacements, rates and accelerations, (o, n) each."""
    none = np.zeros_like(reduced.output)
    position, rate = [reduced.output, none, none[2:]], [none, reduced.output, none[2:]]
    acceleration = [none, none, reduced.output[2:]]
    for place in (*(degree[[AXIAL, LATERAL]] for degree in reduced.degree), *reduced.carrier):
        position += [place, 0.0 * place[1:]]
        rate += [0.0 * place, place[1:]]
        acceleration += [0.0 * place, 0.0 * place[1:]]
    of_probes = reduced.probe
    position.append(of_probes[0])
    rate.append(of_probes[1])
    acceleration.append(of_probes[2])
    return np.concatenate(position), np.concatenate(rate), np.concatenate(acceleration)
