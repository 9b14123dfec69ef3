"""Forms of modal coordinates whose growth is the loss by damping and the work of the unbalance."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.reduced_model.friction_mode import FrictionMode

if TYPE_CHECKING:
    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.integrate.reduced_model.reduction import ReducedModel

    Ints = NDArray[np.int64]
    Complexes = NDArray[np.complex128]

Floats = NDArray[np.float64]

STEADY = 1e-13  # sum of two exponents over the greatest; less counts as zero


class Growth(NamedTuple):
    """Coordinates that grow linearly, in a mode in which pairs stick."""

    which: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
    speed: NDArray[np.float64] = np.zeros(0)  # 1/s times their unit
    steady: int = -1  # the coordinate that is 1

    def among(self, columns: NDArray[np.int64]) -> Growth:
        """The same with places counted among some of the coordinates, in ascending order."""
        which, steady = np.searchsorted(columns, self.which), int(np.searchsorted(columns, self.steady))
        return Growth(which, self.speed, steady)


class Energies(NamedTuple):
    """Primitives of the powers of damping and unbalance, by the coordinates of a mode."""

    loss: Floats  # (2 m, 2 m), form of their real and imaginary parts, J
    work: NDArray[np.complex128]  # (2, m), J
    steady: Floats  # (2,), W, not contained in the forms

    def add(self, columns: NDArray[np.int64], part: Energies) -> None:
        """Add the energies of a part of the bodies, which has some of the coordinates."""
        both = np.concatenate([columns, self.work.shape[1] + columns])
        self.loss[both[:, None], both] += part.loss
        self.work[:, columns] += part.work
        self.steady[:] += part.steady

    def padded(self, width: int) -> Energies:
        """The same with further coordinates without energy."""
        found = Energies.none(width)
        found.add(np.arange(self.work.shape[1]), self)
        return found

    @classmethod
    def none(cls, width: int) -> Energies:
        """Zeros."""
        return cls(np.zeros((2 * width, 2 * width)), np.zeros((2, width), dtype=complex), np.zeros(2))


def energies_of(mode: ContactMode, reduced: ReducedModel, friction: Complexes | None, width: int) -> Energies:
    """Energies of a contact mode, its coordinates padded to `width`.

    Parameters
    ----------
    friction : (n, m), N, optional
        Friction forces on the motion with each coordinate; their loss is added to that of damping.
    """
    spare = width - mode.exponent.size
    exponent, motion = np.pad(mode.exponent, (0, spare)), np.pad(mode.motion, ((0, 0), (0, spare)))
    rubbing = np.zeros((len(motion) // 2, width), dtype=complex)
    if friction is not None:
        rubbing[:, : mode.exponent.size] = friction
    return energy_forms(reduced, exponent, motion, rubbing, mode.n_eigenmode, growth_of(mode))


def growth_of(mode: ContactMode) -> Growth:
    """The coordinates of a mode that grow linearly."""
    if not isinstance(mode, FrictionMode):
        return Growth()
    which = np.flatnonzero(mode.growth)
    return Growth(which, mode.growth[which], mode.n_eigenmode + 1 + len(mode.switch) // 2)


def energy_forms(
    reduced: ReducedModel,
    exponent: Complexes,
    motion: Complexes,
    friction: Complexes,
    n_eigenmode: int,
    growing: Growth,
) -> Energies:
    """Primitives of the powers of damping and unbalance.

    The loss includes that of `friction` (n, m), whose power on the motion is the work of the drive against it
    less the heat. Products of two coordinates are proportional to exp((l_k + l_j) t) or exp((l_k + conj l_j)
    t). Terms without a primitive are steady: the product of the unbalance response with itself, and those of
    undamped modes, which have no loss.
    """
    n = reduced.stiffness.shape[0]
    skew = 0.5 * (reduced.stiffness - reduced.stiffness.T)
    shape, rate = motion[:n], motion[n:]
    resisting = reduced.damping @ rate + skew @ shape - friction
    phasor = reduced.force[0] - 1j * reduced.force[1]
    turning = np.full(exponent.shape, 1j * reduced.spin)
    powers = rate.T @ resisting, rate.T @ resisting.conj()
    loss = product_form(*powers, exponent, n_eigenmode, growing)
    work = 0.5 * np.stack(
        [
            _primitive(phasor @ rate, exponent + turning),
            _primitive(phasor.conj() @ rate, exponent - turning),
        ]
    )
    steady = np.zeros(2, dtype=complex)
    if exponent.size > n_eigenmode:
        response = rate[:, n_eigenmode]
        steady[:] = response @ resisting[:, n_eigenmode].conj(), response @ phasor.conj()
    if growing.which.size:
        steady[0] += 2.0 * rate[:, growing.steady] @ resisting[:, growing.steady]
    return Energies(loss, work, 0.5 * steady.real)


def product_form(
    power: Complexes, with_conjugate: Complexes, exponent: Complexes, n_eigenmode: int, growing: Growth
) -> Floats:
    """Symmetric form (2 m, 2 m) of real and imaginary parts whose growth is the integral of a product.

    With rows a and b (r, m) it is the product of `Re(a z)` and `Re(b z)`, summed over r. `power` is `a' b`,
    `with_conjugate` is `a' conj(b)`; coordinates that grow linearly are among those of b alone.
    """
    forms = []
    for product, other in ((power, exponent), (with_conjugate, exponent.conj())):
        form = _primitive(product, exponent[:, None] + other)
        if growing.which.size:
            _follow_growth(form, product, exponent, n_eigenmode, growing)
        forms.append(form)
    itself, conjugate = forms
    whole = 0.5 * np.block(
        [
            [(itself + conjugate).real, (conjugate - itself).imag],
            [-(itself + conjugate).imag, (conjugate - itself).real],
        ]
    )
    return 0.5 * (whole + whole.T)


def _follow_growth(
    form: Complexes, power: Complexes, exponent: Complexes, n_eigenmode: int, growing: Growth
) -> None:
    """Correct primitives for coordinates that grow: `int z phi = z phi / l - phi' z / l^2`.

    Primitives of products with the coordinate that is 1: phi / phi' for a clearance, phi^2 / (2 phi') for
    phi. Its product with itself is part of the steady power.
    """
    moving, one = slice(n_eigenmode + 1), growing.steady
    for phi, speed in zip(growing.which, growing.speed, strict=True):
        form[moving, one] -= speed * power[moving, phi] / exponent[moving] ** 2
        form[phi, phi] += 0.5 * power[one, phi] / speed
    first, speed = growing.which[0], growing.speed[0]
    clearances = slice(n_eigenmode + 1, one)
    form[first, clearances] += power[one, clearances] / speed


def _primitive(power: Complexes, exponent: Complexes) -> Complexes:
    """Power over its exponent, 1/s; zero where that is zero."""
    has_one = np.abs(exponent) > STEADY * np.abs(exponent).max()
    return np.divide(power, exponent, out=np.zeros_like(power), where=has_one)
