"""Motion of a reduced model with springs and dampers of a penalty in some of its pairs, in closed form."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.integrate.reduced_model.contact_mode import ContactMode, confined_modes
from rubhpc.integrate.reduced_model.secular_modes import Contact

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.reduced_model.reduction import ReducedModel
    from rubhpc.integrate.reduced_model.secular_modes import Within
    from rubhpc.integrate.reduced_model.system_modes import Solved

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]


class SlidingPairs(NamedTuple):
    """The q pairs of steady sliding, in reduced coordinates."""

    gap_jacobian: Floats  # (q, n)
    force_direction: Floats  # (q, n), force of a unit contact force, friction included
    stiffness: float = 0.0  # N/m, of a penalty; 0: closed gaps are constraints
    damping: float = 0.0  # N s/m, of a penalty

    def closed(self, mask: int) -> list[int]:
        """Closed pairs of a set of states; under a penalty those that are pressed."""
        return [i for i in range(len(self.gap_jacobian)) if mask >> i & 1]

    def lifted(self, mask: int) -> list[int]:
        """Lifted pairs: their gap still overlaps, but the damper has ended their force."""
        return self.closed(mask >> len(self.gap_jacobian))

    def damped(self, reduced: ReducedModel, mask: int) -> ReducedModel:
        """The model with the penalty's dampers of the closed pairs, without the friction by their forces."""
        return (
            damped(reduced, self.damping, self.gap_jacobian[self.closed(mask)]) if self.stiffness else reduced
        )

    def friction_forces(self, mode: ContactMode) -> Complexes:
        """Friction forces on the motion with each coordinate of a mode, (n, m + 1 + q), N."""
        closed = self.closed(mode.mask)
        friction: Complexes = (self.force_direction - self.gap_jacobian)[closed].T @ mode.switch[closed]
        return friction


def solve_penalty_mode(
    reduced: ReducedModel,
    penalty: SlidingPairs,
    opened: ContactMode,
    mask: int,
    known: Solved | None = None,
    bodies: Within | None = None,
) -> ContactMode:
    """Solve the linear system with the pairs of `mask` pressed; bits from q on are lifted pairs.

    `opened` is the mode with every pair open, `bodies` are the bodies in that mode.
    """
    pressed = penalty.closed(mask)
    mode = pressed_mode(reduced, penalty, pressed, known, bodies) if pressed else opened
    return watched(mode, penalty, mask)


def watched(mode: ContactMode, penalty: SlidingPairs, mask: int) -> ContactMode:
    """The motion of a mode with the switch functions of a set of states.

    That of a pressed pair is its force, of an open one its gap, of a lifted one the tension that its spring
    and damper would have.
    """
    pressed, lifted, (q, n) = penalty.closed(mask), penalty.lifted(mask), penalty.gap_jacobian.shape
    clear = np.hstack([np.zeros((q, mode.exponent.size - q)), np.eye(q)])
    switch = penalty.gap_jacobian @ mode.motion[:n] + clear
    tension = penalty.stiffness * switch + penalty.damping * (penalty.gap_jacobian @ mode.motion[n:])
    switch[pressed], switch[lifted] = -tension[pressed], tension[lifted]
    return replace(mode, mask=mask, switch=switch)


def pressed_mode(
    reduced: ReducedModel,
    penalty: SlidingPairs,
    pressed: list[int],
    known: Solved | None,
    opened: Within | None = None,
) -> ContactMode:
    """The motion with these pairs pressed, without switch functions.

    With `Q` the gap Jacobian and `P` the contact-force directions of the pressed pairs, it is that of
    `K + k P Q` and `C + c P Q` under the load `-k P` of their clearances. `opened` are the bodies with
    every pair open.
    """
    n, q = reduced.stiffness.shape[0], len(penalty.gap_jacobian)
    rows, directions = penalty.gap_jacobian[pressed], penalty.force_direction[pressed].T
    stiffness = reduced.stiffness + penalty.stiffness * directions @ rows
    damping = reduced.damping + penalty.damping * directions @ rows
    system = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])
    springs = penalty.stiffness, penalty.damping
    contacts = [Contact(*pair, *springs) for pair in zip(rows, directions.T, strict=True)]
    exponent, moved, inverse = confined_modes(np.eye(n), system, contacts, opened, known)
    phasor = reduced.force[0] - 1j * reduced.force[1]
    turned = 1j * reduced.spin * np.eye(2 * n) - system
    response = np.linalg.solve(turned, np.concatenate([np.zeros(n), phasor]))
    still = np.zeros((2 * n, q))
    still[:n, pressed] = -penalty.stiffness * np.linalg.solve(stiffness, directions)
    return ContactMode(
        mask=0,
        exponent=np.concatenate([exponent, [1j * reduced.spin], np.zeros(q)]),
        motion=np.hstack([moved, response[:, None], still]),
        enter=inverse,
        take_off=np.vstack([inverse @ response.real, -inverse @ response.imag, (inverse @ still).T]),
        switch=np.zeros((q, exponent.size + 1 + q), dtype=np.complex128),
    )


def damped(reduced: ReducedModel, damping: float, along: Floats) -> ReducedModel:
    """Return the model with dampers (N s/m) along gaps (k, n), without the friction by their forces."""
    return replace(reduced, damping=reduced.damping + damping * along.T @ along)


def stored_energy(
    stiffness: float, gap_jacobian: Floats, pressed: list[int], mode: ContactMode, width: int
) -> Floats:
    """Return the energy of springs (N/m) in the pressed pairs, J, as a form of a mode's coordinates.

    It is (2 width, 2 width), for their real and imaginary parts.
    """
    form = np.zeros((2 * width, 2 * width))
    for row in overlap_rows(gap_jacobian, pressed, mode, width):
        form += 0.5 * stiffness * np.outer(row, row)
    return form


def overlap_rows(gap_jacobian: Floats, pressed: list[int], mode: ContactMode, width: int) -> Floats:
    """Return the gaps of the pressed pairs by the coordinates of a mode, (pressed, 2 width), m."""
    n = gap_jacobian.shape[1]
    rows = np.zeros((len(pressed), 2, width))
    for row, i in zip(rows, pressed, strict=True):
        gap = gap_jacobian[i] @ mode.motion[:n]
        gap[mode.n_eigenmode + 1 + i] += 1.0
        row[0, : gap.size], row[1, : gap.size] = gap.real, -gap.imag
    return rows.reshape(len(pressed), 2 * width)
