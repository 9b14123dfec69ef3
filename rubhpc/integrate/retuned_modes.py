"""Contact modes whose matrices stay while the spin speed changes: only the unbalance response is renewed.

`MatrixModes` holds the contact modes of a set of matrices, and tunes them to the speed of each piece of a
run-up (`kernels.retuning`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.contact_mode import confine, solve_contact_mode
from rubhpc.integrate.mode_library import ModeLibrary, width_without_modes
from rubhpc.integrate.mode_tables import TableStack
from rubhpc.integrate.reduction import ReducedModel, directions
from rubhpc.kernels.contact_pairs import AXIAL, LATERAL
from rubhpc.kernels.retuning import HeldMode, retune

NOT_TUNED = -2  # in place of a set of closed pairs

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.integrate.contact_mode import ContactMode, Solved

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
        self._opened = solve_contact_mode(reduced, self.gap_jacobian, self.force_direction, 0, known)
        self.first_masks = [0]
        self.width = width_without_modes(reduced, model, friction, self._opened.exponent.size)
        self._tables = TableStack(1 + len(self.gap_jacobian), self._most_modes)
        self._exponents = {}
        self._place: dict[int, int] = {}  # of each set of closed pairs in the tables
        self._held: list[HeldMode] = []
        self.masks = []
        self._spin, self._factor = reduced.spin, complex(reduced.spin**2)
        self.add(0)

    def tune(self, spin: float, factor: complex, tick: float) -> None:
        """Begin at another speed, rad/s, with the unbalance at unit speed times `factor`: with pairs open."""
        self._spin, self._factor, self._tick = spin, factor, tick
        self.masks = [NOT_TUNED] * len(self._held)
        self.add(0)

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
        retune(self.tables(), place, self._held[place], self._spin, self._factor, self._tick, interval)
        self.masks[place] = mask
        return True

    def forget(self) -> None:
        """Make room: keep no mode but that with every pair open."""
        self._tables.clear()
        self._exponents.clear()
        self._place.clear()
        self._held.clear()
        self.masks = []
        self.add(0)

    def _hold(self, mode: ContactMode) -> HeldMode:
        """What the spin speed leaves alone of a mode."""
        reduced, m, width = self.reduced, mode.n_eigenmode, self.width
        n, q = self.slip.shape[1], len(self.slip)
        closed = np.array([i for i in range(q) if mode.mask >> i & 1], dtype=int)
        rate, force = self.gap_jacobian[closed], self.force_direction[closed].T
        tangent, project, _ = confine(reduced, rate, force)
        seen = tangent @ (project @ self._phasor)  # what the constraints leave of the unbalance
        switch, reaction = np.hstack([self.gap_jacobian, np.zeros((q, n))]), np.zeros(q, dtype=complex)
        if closed.size:
            solved = np.linalg.solve(rate @ force, rate)
            switch[closed] = solved @ np.hstack([reduced.stiffness, reduced.damping])
            reaction[closed] = solved @ self._phasor
        skew = 0.5 * (reduced.stiffness - reduced.stiffness.T)
        across = (self.force_direction - self.gap_jacobian)[closed].T
        resistance = np.hstack([skew, reduced.damping]) - across @ switch[closed]
        motion = np.pad(mode.motion, ((0, 0), (0, width - mode.exponent.size)))
        exponent = np.pad(mode.exponent, (0, width - mode.exponent.size))
        position, velocity, acceleration = self._output
        row = position @ motion[:n] + velocity @ motion[n:]
        row += (acceleration @ motion[n:]) * exponent
        # An inverse shape times its shape is 2 where a mode stands for a conjugate pair, and is doubled.
        doubled = np.einsum("ka,ak->k", mode.enter, mode.motion[:, :m]).real
        return HeldMode(
            n_coordinate=mode.exponent.size,
            exponent=exponent,
            is_pair=doubled > 1.5,
            motion=np.ascontiguousarray(mode.motion[:, :m].T),
            drive=mode.enter[:, n:] @ seen,
            mirrored_drive=mode.enter[:, n:].conj() @ seen,
            switch=switch,
            reaction=reaction,
            slip=np.ascontiguousarray(self.slip),
            resistance=resistance,
            rate=np.ascontiguousarray(motion[n:].T),
            rubbed=across @ reaction[closed],
            resisting=np.ascontiguousarray((resistance @ motion).T),
            phasor=self._phasor,
            work=np.stack([self._phasor @ motion[n:], self._phasor.conj() @ motion[n:]]),
            output=np.hstack(self._output),
            row=row,
        )


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
