"""Contact modes whose matrices stay while the spin speed changes: only the unbalance response is renewed.

`MatrixModes` holds the contact modes of a set of matrices, and tunes them to the speed of each piece of a
run-up (`kernels.retuning`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray  # noqa: TC002 - of a NamedTuple

from rubhpc.integrate.reduced_model.contact_mode import confine, solve_contact_mode
from rubhpc.integrate.reduced_model.mode_library import ModeLibrary, width_without_modes
from rubhpc.integrate.reduced_model.mode_tables import TableStack
from rubhpc.integrate.reduced_model.reduction import ReducedModel, directions
from rubhpc.kernels.contact_pairs import AXIAL, LATERAL
from rubhpc.kernels.retuning import HeldMode, retune
from rubhpc.kernels.retuning_laws import NO_RIM, RimPart, Springs

NOT_TUNED = -2  # in place of a set of closed pairs: a contact mode that this piece has not met

if TYPE_CHECKING:
    from rubhpc.fem.model import Model
    from rubhpc.integrate.reduced_model.contact_mode import ContactMode, Solved

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]


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
        self._place: dict[int, int] = {}  # of each set of closed pairs in the tables
        self._held: list[HeldMode] = []
        self.masks = []
        self._spin, self._factor = reduced.spin, complex(reduced.spin**2)
        self.add(0)

    def tune(self, spin: float, factor: complex, tick: float) -> None:
        """Begin at another speed, rad/s, with the unbalance at unit speed times `factor`: with no mode."""
        self._spin, self._factor, self._tick = spin, factor, tick
        self.masks = [NOT_TUNED] * len(self._held)
        self.tables().mask[:] = NOT_TUNED

    def add(self, mask: int) -> bool:
        """Tune the mode with these pairs closed; returns whether the tables are wide enough for it."""
        if mask not in self._place:
            mode = self._solved(mask)
            if mode.exponent.size > self.width:
                return False
            self._place[mask] = len(self._held)
            self._tabulate(mode)
            self._held.append(self._hold(mode))
            self.masks.append(mask)
        place = self._place[mask]
        interval = self._tick * 2.0**self._sample_level
        tables, share = self.tables(), abs(self._spin / self.reduced.spin)
        retune(tables, place, self._held[place], self._spin, share, self._factor, self._tick, interval)
        self.masks[place] = tables.mask[place] = mask
        return True

    def forget(self) -> None:
        """Make room: keep no mode but that with every pair open."""
        self._tables.clear()
        self._exponents.clear()
        self._place.clear()
        self._held.clear()
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

    def _hold(self, mode: ContactMode) -> HeldMode:
        """What the spin speed leaves alone of a mode."""
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
            rim=_NO_RIM,
            springs=self._springs_of(mode),
        )

    def _springs_of(self, mode: ContactMode) -> Springs:
        """Springs that press in a mode."""
        return Springs(0.0, self.gap_jacobian[:0], np.zeros((0, 2 * self.width)))


_NONE = np.zeros(0, dtype=np.complex128)
_NO_RIM = RimPart(
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
