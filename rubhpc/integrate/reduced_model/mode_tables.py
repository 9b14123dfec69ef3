"""The tables of a contact mode, in the form that kernels read."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.errors import InputError
from rubhpc.fem.model import FAR_APART
from rubhpc.integrate.reduced_model.energy_forms import Energies, growth_of
from rubhpc.integrate.reduced_model.friction_mode import FrictionMode
from rubhpc.kernels import contact_modes as kernel
from rubhpc.kernels.contact_modes import LANES
from rubhpc.kernels.contact_pairs import AXIAL, LATERAL

if TYPE_CHECKING:
    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.integrate.reduced_model.reduction import ReducedModel

    Complexes = NDArray[np.complex128]

Floats = NDArray[np.float64]
GONE = -40.0  # exponent of a decayed coordinate
_MOST_GROWTH = 700.0  # exponent of a growing one over the longest step: beyond, its exponential is no float
NO_ENERGIES = Energies(np.zeros((0, 0)), np.zeros((2, 0), dtype=complex), np.zeros(2))


class Spared(NamedTuple):
    """Eigenmodes of the open set that another set shares."""

    first: int  # place of the first one in that set
    modes: NDArray[np.int64]  # places in the open set
    output: Floats  # (2 m, samples o), of the open set


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
    spared: Spared | None = None,
) -> kernel.ModeTables:
    """Tables of one mode, (1, ...) each, its coordinates padded to `width`.

    Parameters
    ----------
    slip : (q, n)
        Slip speed of each pair with the motion; empty where the switch functions contain it.
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
    spared : Spared, optional
        Shared eigenmodes of the open set and its outputs, where they are known.
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
    is_fast = (exponent.imag == 0.0) & (exponent.real * tick * 2.0**sample_level < -1.0)
    rate = switch * exponent
    sliding = (slip if is_measured else slip[:0]) @ motion[n:]
    bend = primitive = np.zeros((0, m), dtype=complex)
    if isinstance(mode, FrictionMode):
        bend, growing = switch * exponent**2, growth_of(mode)
        moves = np.abs(exponent) > kernel.STILL
        primitive = np.where(moves, switch / np.where(moves, exponent, 1.0), 0.0)
        rate[:, growing.steady] += switch[:, growing.which] @ growing.speed
    output = np.zeros((2 * m, 0))
    if is_measured:
        interval = tick * 2.0**sample_level
        output = _outputs_beside(spared, reduced, exponent, motion, interval, n_ahead)
    loss, work, steady_power = energies or NO_ENERGIES
    halves = np.stack([take_off.real, take_off.imag], axis=1)  # (2 + q or more, 2, m)
    row = kernel.ModeTables(
        mask=np.array(mode.mask),
        n_eigenmode=np.array(mode.n_eigenmode),
        switch_re=switch.real,
        switch_im=switch.imag,
        rate_re=rate.real,
        rate_im=rate.imag,
        bound=np.abs(switch) * np.abs(exponent) ** 2 * growth,
        bend_re=bend.real,
        bend_im=bend.imag,
        turn=np.abs(bend) * np.abs(exponent) * np.where(is_fast, -1.0, growth),
        primitive_re=primitive.real,
        primitive_im=primitive.imag,
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


def bytes_ahead(tables: kernel.ModeTables, reduced: ReducedModel, n_ahead: int, n_level: int) -> int:
    """Memory that the tables of a mode would take with so many samples ahead, and levels of exponentials."""
    m = tables.pace.shape[1]
    n_place = len(reduced.degree) + len(reduced.carrier)
    n_output = n_ahead * (kernel.N_ROTOR_ROW + 3 * n_place + reduced.probe.shape[1])
    columns = -(-n_output // LANES) * LANES - tables.output.shape[2]
    levels = n_level - tables.power_re.shape[1]
    return int(sum(field.nbytes for field in tables) + 2 * m * (columns + levels) * tables.pace.itemsize)


def mode_of(row: kernel.ModeTables, kind: type[ContactMode], exponents: tuple[Floats, Floats]) -> ContactMode:
    """Return the contact mode that tables (1, ...) and exponents (`mode_library.ModeLibrary.exponents`) hold.

    `kind` is ContactMode or FrictionMode. The result equals the tabulated mode bit for bit.
    """
    (parts, drift), m, q = exponents, int(row.n_eigenmode[0]), row.enter_constant.shape[1]
    rest: dict[str, Any] = {}
    if issubclass(kind, FrictionMode):  # the last row is of the coordinate that is 1
        end = n_filled = m + 2 * q
        rest = {"n_mode": m, "growth": drift[:end]}
    else:
        end, n_filled = m + 1 + q, m
    halves = np.concatenate([row.enter_cosine, row.enter_sine, row.enter_constant[0]])  # (2 + q, 2, m)
    return kind(
        mask=int(row.mask[0]),
        exponent=_joined(parts[0, :end], parts[1, :end]),
        motion=_joined(row.motion_re[0, :, :end], row.motion_im[0, :, :end]),
        enter=_joined(row.enter_re[0, :, :n_filled], row.enter_im[0, :, :n_filled]).T,
        take_off=_joined(halves[:, 0, :n_filled], halves[:, 1, :n_filled]),
        switch=_joined(row.switch_re[0, :, :end], row.switch_im[0, :, :end]),
        **rest,
    )


def _joined(real: Floats, imaginary: Floats) -> Complexes:
    """Complex numbers of these parts, including the signs of zeros."""
    joined = np.empty(real.shape, dtype=np.complex128)
    joined.real, joined.imag = real, imaginary
    return joined


def _outputs_beside(
    spared: Spared | None,
    reduced: ReducedModel,
    exponent: Complexes,
    motion: Complexes,
    interval: float,
    n_ahead: int,
) -> Floats:
    """Output rows as in `_outputs`; those of shared eigenmodes are copied."""
    if spared is None:
        return _outputs(reduced, exponent, motion, interval, n_ahead)
    width, first, last = exponent.size, spared.first, spared.first + spared.modes.size
    own = np.concatenate([np.arange(first), np.arange(last, width)])
    found = np.zeros_like(spared.output)
    part = _outputs(reduced, exponent[own], motion[:, own], interval, n_ahead).reshape(2, own.size, -1)
    for half in range(2):
        rows = found[half * width : (half + 1) * width]
        rows[own] = part[half]
        rows[first:last] = spared.output[half * width + spared.modes]
    return found


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
