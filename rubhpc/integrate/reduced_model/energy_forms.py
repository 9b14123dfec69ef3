"""Forms of modal coordinates whose growth is what damping takes and the unbalance gives."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray  # noqa: TC002 - of a NamedTuple

from rubhpc.integrate.reduced_model.coupling import coupled_rows
from rubhpc.integrate.reduced_model.products import real_times

if TYPE_CHECKING:
    from rubhpc.integrate.reduced_model.reduction import ReducedModel

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]
    Complexes = NDArray[np.complex128]

FEW_PAIRS = 5  # of which there is little to take apart
STEADY = 1e-13  # sum of two exponents over the greatest, below which it is zero but for rounding


class Growth(NamedTuple):
    """Coordinates that grow linearly, in a mode in which pairs stick."""

    which: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
    speed: NDArray[np.float64] = np.zeros(0)  # 1/s times their unit
    steady: int = -1  # the coordinate that is 1


def energy_forms(
    reduced: ReducedModel,
    exponent: Complexes,
    motion: Complexes,
    friction: Complexes,
    n_eigenmode: int,
    growing: Growth,
) -> tuple[Floats, Complexes, Floats]:
    """Primitives of the powers of damping and unbalance: (2 m, 2 m), (2, m) and steady (2,), W.

    With the damping counts `friction` (n, m), whose power on the motion is what the drive gives for it less
    what it turns into heat.
    Products of two coordinates go as exp((l_k + l_j) t) or exp((l_k + conj l_j) t). What has no primitive
    among them is steady: that of the unbalance response with itself. Undamped modes have none either,
    and nothing to lose.
    """
    n = reduced.stiffness.shape[0]
    skew = 0.5 * (reduced.stiffness - reduced.stiffness.T)
    shape, rate = motion[:n], motion[n:]
    parts = parts_of(motion, n_eigenmode) if len(reduced.degree) > FEW_PAIRS else []
    resisting = _times(reduced.damping, rate, parts) + _times(skew, shape, parts) - friction
    phasor = reduced.force[0] - 1j * reduced.force[1]
    turning = np.full(exponent.shape, 1j * reduced.spin)
    forms = []
    for partner, other in ((resisting, exponent), (resisting.conj(), exponent.conj())):
        power = _power(rate, partner, parts)
        form = _primitive(power, exponent[:, None] + other)
        if growing.which.size:
            _follow_growth(form, power, exponent, n_eigenmode, growing)
        forms.append(form)
    with_itself, with_conjugate = forms
    loss = 0.5 * np.block(
        [
            [(with_itself + with_conjugate).real, (with_conjugate - with_itself).imag],
            [-(with_itself + with_conjugate).imag, (with_conjugate - with_itself).real],
        ]
    )
    work = 0.5 * np.stack(
        [
            _primitive(phasor @ rate, exponent + turning),
            _primitive(phasor.conj() @ rate, exponent - turning),
        ]
    )
    response = rate[:, n_eigenmode]
    steady = np.array([response @ resisting[:, n_eigenmode].conj(), response @ phasor.conj()])
    if growing.which.size:
        steady[0] += 2.0 * rate[:, growing.steady] @ resisting[:, growing.steady]
    return 0.5 * (loss + loss.T), work, 0.5 * steady.real


def parts_of(motion: Complexes, n_eigenmode: int) -> list[tuple[Ints, Ints]]:
    """Rows and columns of a motion (2 n, m) that belong together: (parts, r) and (parts, c) for each size.

    An open stator moves in its own modes alone. Parts of one size, none of which moves otherwise than in
    eigenmodes, are taken together.
    """
    n = len(motion) // 2
    is_moved = (motion[:n] != 0.0) | (motion[n:] != 0.0)
    shared = is_moved.astype(np.float32)
    found: list[tuple[Ints, Ints]] = []
    alike: dict[tuple[int, int], list[tuple[Ints, Ints]]] = {}
    for rows in coupled_rows(shared @ shared.T > 0.0):
        columns = np.flatnonzero(is_moved[rows].any(axis=0))
        if columns.size and columns[-1] < n_eigenmode:
            alike.setdefault((rows.size, columns.size), []).append((rows, columns))
        else:
            found.append((rows[np.newaxis], columns[np.newaxis]))
    return found + [
        (np.array(rows), np.array(columns))
        for rows, columns in (zip(*of, strict=True) for of in alike.values())
    ]


def _times(matrix: Floats, motion: Complexes, parts: list[tuple[Ints, Ints]]) -> Complexes:
    """Product of a matrix (n, n) with a motion (n, m), where parts are given part by part."""
    if not parts:
        return np.asarray(matrix @ motion)
    product = np.zeros_like(motion)
    for rows, columns in parts:
        at = rows[:, :, np.newaxis], columns[:, np.newaxis]
        product[at] = real_times(matrix[rows[:, :, np.newaxis], rows[:, np.newaxis]], motion[at])
    return product


def _power(rate: Complexes, partner: Complexes, parts: list[tuple[Ints, Ints]]) -> Complexes:
    """Products (m, m) of the columns of two motions (n, m), where parts are given part by part."""
    if not parts:
        return np.asarray(rate.T @ partner)
    power = np.zeros((rate.shape[1], rate.shape[1]), dtype=np.complex128)
    for rows, columns in parts:
        at = rows[:, :, np.newaxis], columns[:, np.newaxis]
        power[columns[:, :, np.newaxis], columns[:, np.newaxis]] += rate[at].transpose(0, 2, 1) @ partner[at]
    return power


def _follow_growth(
    form: Complexes, power: Complexes, exponent: Complexes, n_eigenmode: int, growing: Growth
) -> None:
    """Correct primitives for coordinates that grow: `int z phi = z phi / l - phi' z / l^2`.

    Products of the coordinate that is 1 go as phi / phi' with a clearance, as phi^2 / (2 phi') with phi; that
    with itself is left to the steady power.
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
