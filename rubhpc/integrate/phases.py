"""Modal form of a reduced model for each set of closed contacts, as tables for the exact integrator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag, null_space

from rubhpc.errors import InputError
from rubhpc.integrate.reduction import ReducedModel, directions
from rubhpc.kernels import phases as kernel
from rubhpc.kernels.contact import AXIAL, LATERAL

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]

WORST_CONDITION = 1e11  # of the eigenvectors; beyond it modes coincide and their sum loses its digits
LANES = 8  # modes are padded to whole vectors


@dataclass(frozen=True, kw_only=True, eq=False)
class Phase:
    """Motion with one set of pairs closed: `x = Re(motion @ z)`, x (2 n,) displacements, then velocities.

    The last two coordinates are those of the unbalance response, z = exp(i angle), and of the constant,
    z = 1, whose column is proportional to the clearances.
    """

    mask: int
    exponent: Complexes  # (m + 2,), 1/s
    motion: Complexes  # (2 n, m + 1), without the constant
    motion_constant: Floats  # (q, 2 n), for a unit clearance of each pair
    enter: Complexes  # (m, 2 n)
    enter_response: Complexes  # (2, m), parts of the unbalance response to take off
    enter_constant: Complexes  # (q, m)
    switch: Complexes  # (q, m + 1), gap of an open pair or force of a closed one
    switch_constant: Floats  # (q, q)


def make_phase(reduced: ReducedModel, push: Floats, pull: Floats, mask: int) -> Phase:
    """Solve the linear system with the pairs of `mask` closed.

    Closed gaps confine the motion to `x = x0 + T y` with `push T = 0`; the contact forces drop out of the
    equations projected on L with `L^T pull^T = 0`, and follow from the accelerations of the gaps being zero
    (the constraint of Eq. 18 of the paper, differentiated twice).

    Raises
    ------
    InputError
        Where eigenvectors coincide (rigid-body motion, exactly critical damping).
    """
    n, q = reduced.stiffness.shape[0], push.shape[0]
    closed = np.array([i for i in range(q) if mask >> i & 1], dtype=int)
    rate, force = push[closed], pull[closed].T
    tangent = null_space(rate) if closed.size else np.eye(n)
    left = null_space(force.T) if closed.size else np.eye(n)
    offset = np.zeros((q, n))  # displacement that closes a unit clearance
    if closed.size:
        offset[closed] = -np.linalg.pinv(rate).T
    n_free = tangent.shape[1]
    project = np.linalg.solve(left.T @ tangent, left.T)
    system = np.block(
        [
            [np.zeros((n_free, n_free)), np.eye(n_free)],
            [-project @ reduced.stiffness @ tangent, -project @ reduced.damping @ tangent],
        ]
    )
    exponent, shape, inverse = _modes(system)
    phasor = reduced.force[0] - 1j * reduced.force[1]
    lower = np.concatenate([np.zeros(n_free), project @ phasor])
    response = np.linalg.solve(1j * reduced.spin * np.eye(2 * n_free) - system, lower)
    constant = np.zeros((q, 2 * n_free))
    for i in closed:
        load = np.concatenate([np.zeros(n_free), -project @ reduced.stiffness @ offset[i]])
        constant[i] = -np.linalg.solve(system, load)
    expand = block_diag(tangent, tangent)
    motion = np.hstack([expand @ shape, (expand @ response)[:, None]])
    motion_constant = constant @ expand.T + np.hstack([offset, np.zeros((q, n))])

    switch = push @ motion[:n]
    switch_constant = push @ motion_constant[:, :n].T + np.eye(q)
    if closed.size:
        reaction = np.linalg.solve(rate @ force, rate)
        internal = np.hstack([reduced.stiffness, reduced.damping])
        switch[closed] = reaction @ (internal @ motion)
        switch[closed, -1] -= reaction @ phasor
        switch_constant[closed] = reaction @ (internal @ motion_constant.T)
    return Phase(
        mask=mask,
        exponent=np.concatenate([exponent, [1j * reduced.spin, 0.0]]),
        motion=motion,
        motion_constant=motion_constant,
        enter=inverse @ expand.T,
        enter_response=np.array([inverse @ response.real, -inverse @ response.imag]),
        enter_constant=(constant + np.hstack([offset @ tangent, np.zeros((q, n_free))])) @ inverse.T,
        switch=switch,
        switch_constant=switch_constant,
    )


def _modes(system: Floats) -> tuple[Complexes, Complexes, Complexes]:
    """Exponents, shapes and inverse shapes of a first-order system; one of each conjugate pair, doubled."""
    exponent, shape = np.linalg.eig(system)
    if np.linalg.cond(shape) > WORST_CONDITION:
        raise InputError(
            "[integrator] method: modal cannot part the modes of this rig, some of which coincide (a "
            'free body, critical damping); take method = "central-difference"'
        )
    inverse = np.linalg.inv(shape)
    is_real = np.abs(exponent.imag) <= 1e-12 * np.abs(exponent).max()
    keep = is_real | (exponent.imag > 0.0)
    weight = np.where(is_real, 1.0, 2.0)
    return exponent[keep], (shape * weight)[:, keep], inverse[keep]


class PhaseBook:
    """Phases of one speed and friction, made when first met and shared by all cases."""

    def __init__(self, reduced: ReducedModel, model: Model, friction: float) -> None:
        """Start with every pair open, and with each closed alone."""
        self.reduced, self.model = reduced, model
        self.push, self.pull, self.slip = directions(reduced, model, friction)
        self.friction = friction
        self.phases: list[Phase] = []
        for mask in (0, *(1 << i for i in range(self.push.shape[0]))):
            self.add(mask)

    def add(self, mask: int) -> None:
        """Make the phase with these pairs closed."""
        self.phases.append(make_phase(self.reduced, self.push, self.pull, mask))

    def kernel_reduced(self) -> kernel.Reduced:
        """The reduced bodies as the kernel takes them."""
        stiffness = self.reduced.stiffness
        return kernel.Reduced(
            stiffness=stiffness,
            damping=self.reduced.damping,
            circulation=0.5 * (stiffness - stiffness.T),
            force_cosine=self.reduced.force[0].copy(),
            force_sine=self.reduced.force[1].copy(),
            push=self.push,
            pull=self.pull,
            answer=self.push @ self.pull.T,
            friction=np.full(self.push.shape[0], self.friction),
            radius=np.array([stator.radius for stator in self.model.stators]),
        )

    def tables(self, clearance: Floats, tick: float, n_level: int) -> kernel.Phases:
        """All phases as arrays, with the constants of these clearances (q,), m.

        Parameters
        ----------
        tick : float, s
            Exponentials are tabulated over 1, 2, ..., 2^(n_level - 1) ticks.
        """
        n, q = self.reduced.stiffness.shape[0], self.push.shape[0]
        widest = max(phase.exponent.size for phase in self.phases)
        m = -(-widest // LANES) * LANES
        p = len(self.phases)
        exponent = np.zeros((p, m), dtype=complex)
        motion, enter = np.zeros((2, p, 2 * n, m), dtype=complex)
        switch = np.zeros((p, q, m), dtype=complex)
        take_off = np.zeros((p, 3, m), dtype=complex)
        used = np.zeros((p, m), dtype=bool)
        for i, phase in enumerate(self.phases):
            end = phase.exponent.size
            exponent[i, :end], used[i, :end] = phase.exponent, True
            motion[i, :, : end - 1], motion[i, :, end - 1] = phase.motion, clearance @ phase.motion_constant
            switch[i, :, : end - 1], switch[i, :, end - 1] = phase.switch, phase.switch_constant @ clearance
            enter[i, :, : end - 2] = phase.enter.T
            take_off[i, :2, : end - 2] = phase.enter_response
            take_off[i, 2, : end - 2] = clearance @ phase.enter_constant
        slip = np.einsum("qn,pnm->pqm", self.slip, motion[:, n:])
        for i, phase in enumerate(self.phases):
            radii = [stator.radius for stator in self.model.stators]
            slip[i, :, phase.exponent.size - 1] += np.multiply(radii, abs(self.reduced.spin))
        longest = tick * 2.0 ** (n_level - 1)
        growth = np.exp(np.maximum(exponent.real, 0.0) * longest)
        steps = tick * 2.0 ** np.arange(n_level)
        power = np.exp(exponent[:, None, :] * steps[:, None]) * used[:, None, :]
        output = self._outputs(motion, exponent)

        def parts(values: Complexes) -> tuple[Floats, Floats]:
            return np.ascontiguousarray(values.real), np.ascontiguousarray(values.imag)

        switch_re, switch_im = parts(switch)
        rate_re, rate_im = parts(switch * exponent[:, None, :])
        power_re, power_im = parts(power)
        output_re, output_im = parts(output)
        slip_re, slip_im = parts(slip)
        motion_re, motion_im = parts(motion)
        enter_re, enter_im = parts(enter)
        halves = np.stack([take_off.real, take_off.imag], axis=2)  # (p, 3, 2, m)
        return kernel.Phases(
            mask=np.array([phase.mask for phase in self.phases]),
            n_mode=np.array([phase.exponent.size - 2 for phase in self.phases]),
            switch_re=switch_re,
            switch_im=switch_im,
            rate_re=rate_re,
            rate_im=rate_im,
            bound=np.abs(switch) * (np.abs(exponent) ** 2 * growth)[:, None, :],
            power_re=power_re,
            power_im=power_im,
            output_re=output_re,
            output_im=output_im,
            slip_re=slip_re,
            slip_im=slip_im,
            motion_re=motion_re,
            motion_im=motion_im,
            enter_re=enter_re,
            enter_im=enter_im,
            enter_cosine=np.ascontiguousarray(halves[:, 0]),
            enter_sine=np.ascontiguousarray(halves[:, 1]),
            enter_constant=np.ascontiguousarray(halves[:, 2]),
        )

    def _outputs(self, motion: Complexes, exponent: Complexes) -> Complexes:
        """Rows (p, o, m) in the order of `kernels.phases`."""
        n = self.reduced.stiffness.shape[0]
        displacement = np.einsum("on,pnm->pom", self.reduced.output, motion[:, :n])
        rate = np.einsum("on,pnm->pom", self.reduced.output, motion[:, n:])
        rows = [displacement, rate, rate[:, 2:] * exponent[:, None, :]]
        for degree in self.reduced.degree:
            rows.append(np.einsum("an,pnm->pam", degree[[AXIAL, LATERAL]], motion[:, :n]))
            rows.append(np.einsum("an,pnm->pam", degree[[LATERAL]], motion[:, n:]))
        return np.concatenate(rows, axis=1)
