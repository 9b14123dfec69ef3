"""The tables of a contact mode, in the form that kernels read, and the forms of its energies."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.errors import InputError
from rubhpc.fem.model import FAR_APART
from rubhpc.kernels import contact_modes as kernel
from rubhpc.kernels.contact_modes import LANES
from rubhpc.kernels.contact_pairs import AXIAL, LATERAL

if TYPE_CHECKING:
    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.integrate.reduced_model.reduction import ReducedModel

    Ints = NDArray[np.int64]
    Complexes = NDArray[np.complex128]

Floats = NDArray[np.float64]

STEADY = 1e-13  # sum of two exponents over the greatest; less counts as zero

GONE = -40.0  # exponent of a decayed coordinate
_MOST_GROWTH = 700.0  # exponent of a growing one over the longest step: beyond, its exponential is no float


class Energies(NamedTuple):
    """Primitives of the powers of damping and unbalance, by the coordinates of a mode."""

    loss: Floats  # (2 m, 2 m), form of their real and imaginary parts, J
    work: NDArray[np.complex128]  # (2, m), J
    steady: Floats  # (2,), W, not contained in the forms

    @classmethod
    def none(cls, width: int) -> Energies:
        """Zeros."""
        return cls(np.zeros((2 * width, 2 * width)), np.zeros((2, width), dtype=complex), np.zeros(2))


def energies_of(mode: ContactMode, reduced: ReducedModel, friction: Complexes, width: int) -> Energies:
    """Primitives of the powers of damping and unbalance in a contact mode, its coordinates padded to `width`.

    The loss includes that of `friction` (n, m), N, the friction forces on the motion with each coordinate,
    whose power is the work of the drive against it less the heat. Products of two coordinates are
    proportional to exp((l_k + l_j) t) or exp((l_k + conj l_j) t). Terms without a primitive are steady: the
    product of the unbalance response with itself, and those of undamped modes, which have no loss.
    """
    spare, response = width - mode.exponent.size, mode.n_eigenmode
    exponent = np.pad(mode.exponent, (0, spare))
    shape, rate = np.split(np.pad(mode.motion, ((0, 0), (0, spare))), 2)
    rubbing = np.pad(friction, ((0, 0), (0, spare)))
    skew = 0.5 * (reduced.stiffness - reduced.stiffness.T)
    resisting = reduced.damping @ rate + skew @ shape - rubbing
    phasor = reduced.force[0] - 1j * reduced.force[1]
    turning = np.full(exponent.shape, 1j * reduced.spin)
    powers = rate.T @ resisting, rate.T @ resisting.conj()
    loss = product_form(*powers, exponent)
    work = 0.5 * np.stack(
        [
            _primitive(phasor @ rate, exponent + turning),
            _primitive(phasor.conj() @ rate, exponent - turning),
        ]
    )
    steady = rate[:, response] @ np.stack([resisting[:, response], phasor], axis=1).conj()
    return Energies(loss, work, 0.5 * steady.real)


def product_form(power: Complexes, with_conjugate: Complexes, exponent: Complexes) -> Floats:
    """Symmetric form (2 m, 2 m) of real and imaginary parts whose growth is the integral of a product.

    With rows a and b (r, m) it is the product of `Re(a z)` and `Re(b z)`, summed over r. `power` is `a' b`,
    `with_conjugate` is `a' conj(b)`.
    """
    forms = []
    for product, other in ((power, exponent), (with_conjugate, exponent.conj())):
        form = _primitive(product, exponent[:, None] + other)
        forms.append(form)
    itself, conjugate = forms
    whole = 0.5 * np.block(
        [
            [(itself + conjugate).real, (conjugate - itself).imag],
            [-(itself + conjugate).imag, (conjugate - itself).real],
        ]
    )
    return 0.5 * (whole + whole.T)


def _primitive(power: Complexes, exponent: Complexes) -> Complexes:
    """Power over its exponent, 1/s; zero where that is zero."""
    has_one = np.abs(exponent) > STEADY * np.abs(exponent).max()
    return np.divide(power, exponent, out=np.zeros_like(power), where=has_one)


def tabulate(
    mode: ContactMode,
    reduced: ReducedModel,
    slip: Floats,
    *,
    energies: Energies | None = None,
    width: int,
    tick: float,
    sample_level: int,
    n_level: int,
    is_measured: bool = True,
    n_ahead: int = kernel.SAMPLES_AT_ONCE,
) -> kernel.ModeTables:
    """Tables of one mode, (1, ...) each, its coordinates padded to `width`.

    Parameters
    ----------
    slip : (q, n)
        Slip speed of each pair with the motion.
    energies : Energies, optional
        Of coordinates padded to `width`; None where nothing is measured.
    tick : float, s
    sample_level, n_level : int
        As in `mode_library.ModeLibrary`.
    is_measured : bool
        Otherwise slip and outputs are empty.
    n_ahead : int
        Samples whose outputs are read from one set of coordinates. With 1, no step may pass a sample; with 0,
        outputs are not tabulated.
    """
    n, m = reduced.stiffness.shape[0], width
    end, n_filled = mode.exponent.size, len(mode.enter)
    exponent, used = np.zeros(m, dtype=complex), np.zeros(m, dtype=bool)
    motion, enter = np.zeros((2, 2 * n, m), dtype=complex)
    switch = np.zeros((len(mode.switch), m), dtype=complex)
    take_off = np.zeros((len(mode.take_off), m), dtype=complex)
    exponent[:end], used[:end] = mode.exponent, True
    motion[:, :end], switch[:, :end] = mode.motion, mode.switch
    enter[:, :n_filled], take_off[:, :n_filled] = mode.enter.T, mode.take_off
    steps = tick * 2.0 ** np.arange(n_level)
    bounded_over = max(steps[-1], tick * 2.0 ** (sample_level + kernel.BOUND_LEVEL))
    if np.max(exponent.real, initial=0.0) * max(bounded_over, steps[-1]) > _MOST_GROWTH:
        raise InputError(f"rig: {FAR_APART}")
    growth = np.exp(np.maximum(exponent.real, 0.0) * bounded_over)
    power = np.exp(exponent * steps[:, None]) * used
    rate = switch * exponent
    sliding = (slip if is_measured else slip[:0]) @ motion[n:]
    output = np.zeros((2 * m, 0))
    if is_measured:
        interval = tick * 2.0**sample_level
        output = _outputs(reduced, exponent, motion, interval, n_ahead)
    loss, work, steady_power = energies or Energies.none(0)
    halves = np.stack([take_off.real, take_off.imag], axis=1)  # (2 + q or more, 2, m)
    row = kernel.ModeTables(
        mask=np.array(mode.mask),
        n_eigenmode=np.array(mode.n_eigenmode),
        switch_re=switch.real,
        switch_im=switch.imag,
        rate_re=rate.real,
        rate_im=rate.imag,
        bound=np.abs(switch) * np.abs(exponent) ** 2 * growth,
        pace=np.where(exponent.real * tick * 2**kernel.FORCED_LEVEL < GONE, kernel.DYING, np.abs(exponent)),
        power_re=power.real,
        power_im=power.imag,
        output=output,
        slip_re=sliding.real,
        slip_im=sliding.imag,
        slip_rate_re=(sliding * exponent).real,
        slip_rate_im=(sliding * exponent).imag,
        motion_re=motion.real,
        motion_im=motion.imag,
        enter_re=enter.real,
        enter_im=enter.imag,
        enter_cosine=halves[0],
        enter_sine=halves[1],
        enter_constant=halves[2:],
        loss=loss,
        work_re=work.real,
        work_im=work.imag,
        steady_power=steady_power,
    )
    fields: list[Any] = [np.ascontiguousarray(np.asarray(field)[None]) for field in row]
    return kernel.ModeTables(*fields)


def _outputs(
    reduced: ReducedModel, exponent: Complexes, motion: Complexes, interval: float, n_ahead: int
) -> Floats:
    """Output rows (`kernels.contact_modes`) at coming samples, `interval` (s) apart: (2 m, samples o).

    Zeros fill the rows up to whole vectors of the kernels.
    """
    if n_ahead == 0:
        return np.zeros((2 * exponent.size, 0))
    n = reduced.stiffness.shape[0]
    displacement, rate = reduced.output @ motion[:n], reduced.output @ motion[n:]
    rows = [displacement, rate, rate[2:] * exponent]
    for degree in reduced.degree:
        rows += [degree[[AXIAL, LATERAL]] @ motion[:n], degree[[LATERAL]] @ motion[n:]]
    for carrier in reduced.carrier:  # as axial and lateral
        rows += [carrier @ motion[:n], carrier[[1]] @ motion[n:]]
    positions, rates, accelerations = reduced.probe
    rows.append(positions @ motion[:n] + rates @ motion[n:] + (accelerations @ motion[n:]) * exponent)
    later = interval * np.arange(n_ahead)
    ahead = np.concatenate(rows) * np.exp(exponent * later[:, None])[:, None]  # (sample, o, m)
    table = ahead.reshape(-1, exponent.size).T
    outputs = np.zeros((2 * exponent.size, -(-table.shape[1] // LANES) * LANES))
    outputs[: exponent.size, : table.shape[1]] = table.real
    outputs[exponent.size :, : table.shape[1]] = -table.imag
    return outputs
