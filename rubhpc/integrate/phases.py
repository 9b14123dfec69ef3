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
STEADY = 1e-13  # sum of two exponents over the greatest, below which it is zero but for rounding


@dataclass(frozen=True, kw_only=True, eq=False)
class Phase:
    """Motion with one set of pairs closed: `x = Re(motion @ z)`, x (2 n,) displacements, then velocities.

    To the m modes come the unbalance response, z = exp(i angle), and the clearances of the q pairs, z in m.
    """

    mask: int
    exponent: Complexes  # (m + 1 + q,), 1/s
    motion: Complexes  # (2 n, m + 1 + q)
    enter: Complexes  # (m, 2 n)
    take_off: Complexes  # (2 + q, m), of the unbalance response, times cosine and sine; of unit clearances
    switch: Complexes  # (q, m + 1 + q), gap of an open pair or force of a closed one


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
    still = constant @ expand.T + np.hstack([offset, np.zeros((q, n))])  # (q, 2 n)
    motion = np.hstack([expand @ shape, (expand @ response)[:, None], still.T])
    clear = np.hstack([np.zeros((q, exponent.size + 1)), np.eye(q)])
    switch = push @ motion[:n] + clear
    if closed.size:
        reaction = np.linalg.solve(rate @ force, rate)
        switch[closed] = reaction @ (np.hstack([reduced.stiffness, reduced.damping]) @ motion)
        switch[closed, exponent.size] -= reaction @ phasor
    entry = constant + np.hstack([offset @ tangent, np.zeros((q, n_free))])
    return Phase(
        mask=mask,
        exponent=np.concatenate([exponent, [1j * reduced.spin], np.zeros(q)]),
        motion=motion,
        enter=inverse @ expand.T,
        take_off=np.vstack([inverse @ response.real, -inverse @ response.imag, entry @ inverse.T]),
        switch=switch,
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
    """Phases of one speed and friction, made when first met and shared by all cases.

    Parameters
    ----------
    tick : float, s
    sample_level, n_level : int
        2^sample_level ticks are the interval of samples; exponentials are tabulated over 1, 2, ...,
        2^(n_level - 1) ticks.
    """

    def __init__(
        self,
        reduced: ReducedModel,
        model: Model,
        friction: float,
        *,
        tick: float,
        sample_level: int,
        n_level: int,
    ) -> None:
        """Start with every pair open, and with each closed alone."""
        self.reduced, self.model = reduced, model
        self.push, self.pull, self.slip = directions(reduced, model, friction)
        self.friction = friction
        self._tick, self._sample_level, self._n_level = tick, sample_level, n_level
        self.phases: list[Phase] = []
        self._tables: kernel.Phases | None = None
        for mask in (0, *(1 << i for i in range(self.push.shape[0]))):
            self.add(mask)

    def add(self, mask: int) -> None:
        """Make the phase with these pairs closed."""
        self.phases.append(make_phase(self.reduced, self.push, self.pull, mask))
        self._tables = None

    def kernel_reduced(self, clearance: Floats) -> kernel.Reduced:
        """The reduced bodies as the kernel takes them, with the clearances (q,), m, of a case."""
        return kernel.Reduced(
            stiffness=self.reduced.stiffness,
            damping=self.reduced.damping,
            force_cosine=self.reduced.force[0].copy(),
            force_sine=self.reduced.force[1].copy(),
            push=self.push,
            pull=self.pull,
            answer=self.push @ self.pull.T,
            friction=np.full(self.push.shape[0], self.friction),
            radius=np.array([stator.radius for stator in self.model.stators]),
            clearance=clearance,
        )

    def tables(self) -> kernel.Phases:
        """All phases as arrays."""
        if self._tables is None:
            self._tables = self._tabulate()
        return self._tables

    def _tabulate(self) -> kernel.Phases:
        n, q, p = self.reduced.stiffness.shape[0], self.push.shape[0], len(self.phases)
        widest = max(phase.exponent.size for phase in self.phases)
        m = -(-widest // LANES) * LANES
        exponent = np.zeros((p, m), dtype=complex)
        motion, enter = np.zeros((2, p, 2 * n, m), dtype=complex)
        switch = np.zeros((p, q, m), dtype=complex)
        take_off = np.zeros((p, 2 + q, m), dtype=complex)
        used = np.zeros((p, m), dtype=bool)
        for i, phase in enumerate(self.phases):
            end = phase.exponent.size
            n_mode = end - 1 - q
            exponent[i, :end], used[i, :end] = phase.exponent, True
            motion[i, :, :end], switch[i, :, :end] = phase.motion, phase.switch
            enter[i, :, :n_mode] = phase.enter.T
            take_off[i, :, :n_mode] = phase.take_off
        steps = self._tick * 2.0 ** np.arange(self._n_level)
        growth = np.exp(np.maximum(exponent.real, 0.0) * steps[-1])
        power = np.exp(exponent[:, None, :] * steps[:, None]) * used[:, None, :]
        slip = np.einsum("qn,pnm->pqm", self.slip, motion[:, n:])
        loss, work, steady_power = self._energies(exponent, motion)

        def parts(values: Complexes) -> tuple[Floats, Floats]:
            return np.ascontiguousarray(values.real), np.ascontiguousarray(values.imag)

        switch_re, switch_im = parts(switch)
        rate_re, rate_im = parts(switch * exponent[:, None, :])
        power_re, power_im = parts(power)
        slip_re, slip_im = parts(slip)
        motion_re, motion_im = parts(motion)
        enter_re, enter_im = parts(enter)
        work_re, work_im = parts(work)
        halves = np.stack([take_off.real, take_off.imag], axis=2)  # (p, 2 + q, 2, m)
        return kernel.Phases(
            mask=np.array([phase.mask for phase in self.phases]),
            n_mode=np.array([phase.exponent.size - 1 - q for phase in self.phases]),
            switch_re=switch_re,
            switch_im=switch_im,
            rate_re=rate_re,
            rate_im=rate_im,
            bound=np.abs(switch) * (np.abs(exponent) ** 2 * growth)[:, None, :],
            power_re=power_re,
            power_im=power_im,
            output=self._outputs(motion, exponent),
            slip_re=slip_re,
            slip_im=slip_im,
            motion_re=motion_re,
            motion_im=motion_im,
            enter_re=enter_re,
            enter_im=enter_im,
            enter_cosine=np.ascontiguousarray(halves[:, 0]),
            enter_sine=np.ascontiguousarray(halves[:, 1]),
            enter_constant=np.ascontiguousarray(halves[:, 2:]),
            loss=loss,
            work_re=work_re,
            work_im=work_im,
            steady_power=steady_power,
        )

    def _outputs(self, motion: Complexes, exponent: Complexes) -> Floats:
        """Rows in the order of `kernels.phases`, at the coming samples: (p, 2 m, samples o)."""
        n = self.reduced.stiffness.shape[0]
        displacement = np.einsum("on,pnm->pom", self.reduced.output, motion[:, :n])
        rate = np.einsum("on,pnm->pom", self.reduced.output, motion[:, n:])
        rows = [displacement, rate, rate[:, 2:] * exponent[:, None, :]]
        for degree in self.reduced.degree:
            rows.append(np.einsum("an,pnm->pam", degree[[AXIAL, LATERAL]], motion[:, :n]))
            rows.append(np.einsum("an,pnm->pam", degree[[LATERAL]], motion[:, n:]))
        now = np.concatenate(rows, axis=1)
        later = self._tick * 2.0**self._sample_level * np.arange(kernel.SAMPLES_AT_ONCE)
        ahead = now[:, None] * np.exp(exponent[:, None, :] * later[:, None])[:, :, None]  # (p, sample, o, m)
        table = np.moveaxis(ahead.reshape(len(ahead), -1, ahead.shape[-1]), 2, 1)
        return np.ascontiguousarray(np.concatenate([table.real, -table.imag], axis=1))

    def _energies(self, exponent: Complexes, motion: Complexes) -> tuple[Floats, Complexes, Floats]:
        """Primitives of the powers of damping and unbalance: (p, 2 m, 2 m), (p, 2, m) and steady (p, 2), W.

        Products of two coordinates go as exp((l_k + l_j) t) or exp((l_k + conj l_j) t). What has no primitive
        among them is steady: that of the unbalance response with itself. Undamped modes have none either,
        and nothing to lose.
        """
        n = self.reduced.stiffness.shape[0]
        skew = 0.5 * (self.reduced.stiffness - self.reduced.stiffness.T)
        shape, rate = motion[:, :n], motion[:, n:]
        resisting = np.einsum("ij,pjm->pim", self.reduced.damping, rate)
        resisting += np.einsum("ij,pjm->pim", skew, shape)
        phasor = self.reduced.force[0] - 1j * self.reduced.force[1]
        turning = np.full(exponent.shape, 1j * self.reduced.spin)
        across = np.swapaxes(rate, 1, 2)
        forms = []
        for partner, other in ((resisting, exponent), (resisting.conj(), exponent.conj())):
            forms.append(_primitive(across @ partner, exponent[:, :, None] + other[:, None, :]))
        with_itself, with_conjugate = forms
        loss = 0.5 * np.block(
            [
                [(with_itself + with_conjugate).real, (with_conjugate - with_itself).imag],
                [-(with_itself + with_conjugate).imag, (with_conjugate - with_itself).real],
            ]
        )
        work = 0.5 * np.stack(
            [
                _primitive(np.einsum("pim,i->pm", rate, phasor), exponent + turning),
                _primitive(np.einsum("pim,i->pm", rate, phasor.conj()), exponent - turning),
            ],
            axis=1,
        )
        steady = np.empty((len(exponent), 2))
        for i, phase in enumerate(self.phases):
            u = phase.exponent.size - 1 - self.push.shape[0]
            steady[i] = (
                0.5 * (rate[i, :, u] @ resisting[i, :, u].conj()).real,
                0.5 * (rate[i, :, u] @ phasor.conj()).real,
            )
        return 0.5 * (loss + np.swapaxes(loss, 1, 2)), work, steady


def _primitive(power: Complexes, exponent: Complexes) -> Complexes:
    """Power over its exponent, 1/s; zero where that is zero."""
    has_one = np.abs(exponent) > STEADY * np.abs(exponent).max()
    return np.divide(power, exponent, out=np.zeros_like(power), where=has_one)
