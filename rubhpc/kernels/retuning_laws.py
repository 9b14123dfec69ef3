"""Parts of tables by laws of contact at another spin speed: terms of the rim speed, and springs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import linked
from rubhpc.kernels._struct import Struct

if TYPE_CHECKING:
    from rubhpc.kernels.contact_modes import ModeTables

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
NO_RIM = -1  # instead of a coordinate


class RimPart(Struct):
    """Part of a mode by the rim speed: the constant coordinate and growth, at the speed of the matrices.

    n reduced degrees, r switch functions, o output rows, tables of the width m.
    """

    one: int  # the coordinate, or NO_RIM
    motion: Complexes  # (2 n,)
    entered: Complexes  # (m,), its part of `enter_constant`
    switch: Complexes  # (r,), part proportional to the speed
    fixed: Complexes  # (r,), constant part
    rate: Complexes  # (r,)
    loss: Floats  # (2, 2 m), rows of the form
    power: float  # W
    velocity: Complexes  # (n,)
    resisting: Complexes  # (n,)
    row: Complexes  # (o,)
    work: Complexes  # (2,)
    growing: NDArray[np.int64]  # (g,), coordinates that grow
    speed: Floats  # (g,), m/s


class Springs(Struct):
    """The k pressed springs of a mode."""

    half: float  # N/m, of their stiffness
    gap: Floats  # (k, n), gaps by reduced displacements
    overlap: Floats  # (k, 2 m), gaps by coordinates; those proportional to the speed are filled in


@linked
def move_rim(
    tables: ModeTables,
    mode: int,
    rim: RimPart,
    share: float,
    velocity: Complexes,
    resisting: Complexes,
    row: Complexes,
    work: Complexes,
) -> None:
    """Scale the part by the rim speed to a `share` of the speed of the matrices.

    `velocity` and `resisting` (m, n), `row` (o, m) and `work` (2, m) are those of the mode.
    """
    one, width = rim.one, tables.pace.shape[1]
    for a in range(rim.motion.size):
        tables.motion_re[mode, a, one] = share * rim.motion[a].real
        tables.motion_im[mode, a, one] = share * rim.motion[a].imag
    for i in range(rim.switch.size):
        switch = share * rim.switch[i] + rim.fixed[i]
        tables.switch_re[mode, i, one], tables.switch_im[mode, i, one] = switch.real, switch.imag
        rate = share * rim.rate[i]
        tables.rate_re[mode, i, one], tables.rate_im[mode, i, one] = rate.real, rate.imag
    last = tables.enter_constant.shape[1] - 1
    for k in range(width):
        entered = share * rim.entered[k]
        tables.enter_constant[mode, last, 0, k] = entered.real
        tables.enter_constant[mode, last, 1, k] = entered.imag
    for part in range(2 if tables.loss.shape[1] > 0 else 0):
        place = part * width + one
        for k in range(2 * width):
            tables.loss[mode, place, k] = tables.loss[mode, k, place] = share * rim.loss[part, k]
    for a in range(rim.velocity.size):
        velocity[one, a], resisting[one, a] = share * rim.velocity[a], share * rim.resisting[a]
    for o in range(rim.row.size):
        row[o, one] = share * rim.row[o]
    work[0, one], work[1, one] = share * rim.work[0], share * rim.work[1]


@linked
def follow_growth(
    tables: ModeTables,
    mode: int,
    rim: RimPart,
    share: float,
    turning: complex,
    first: int,
    x: Complexes,
    resisting: Complexes,
) -> None:
    """Add the products of growing coordinates with the response `x` (2 n,), the coordinate `first`.

    `turning` (1/s) is the exponent of the response.
    """
    tables.steady_power[mode, 0] += share * share * rim.power
    width, n = tables.loss.shape[1] // 2, x.size // 2
    itself, conjugate = 0j, 0j
    for g in range(rim.growing.size):
        speed = -share * rim.speed[g] / (turning * turning)
        for a in range(n):
            against = resisting[rim.growing[g], a]
            itself += speed * (x[n + a] * against)
            conjugate += speed * (x[n + a] * np.conj(against))
    both, apart = 0.25 * (itself + conjugate), 0.25 * (conjugate - itself)
    loss, one = tables.loss[mode], rim.one
    for here, there, added in (
        (first, one, both.real),
        (first, width + one, apart.imag),
        (width + first, one, -both.imag),
        (width + first, width + one, apart.real),
    ):
        loss[here, there] += added
        loss[there, here] += added


@linked
def stretch_springs(tables: ModeTables, mode: int, springs: Springs, first: int, one: int) -> None:
    """Add the energy of springs by the response, the coordinate `first`, and by the rim speed."""
    n_spring, n = springs.gap.shape
    width, loss = tables.loss.shape[1] // 2, tables.loss[mode]
    moving = np.array([first, width + first, one, width + one])
    n_moving = 4 if one >= 0 else 2
    for s in range(n_spring):
        for j in range(0, n_moving, 2):
            re, im, k = 0.0, 0.0, moving[j]
            for a in range(n):
                re += springs.gap[s, a] * tables.motion_re[mode, a, k]
                im += springs.gap[s, a] * tables.motion_im[mode, a, k]
            springs.overlap[s, k], springs.overlap[s, width + k] = re, -im
    for j in range(n_moving):
        k = moving[j]
        for other in range(2 * width):
            form = 0.0
            for s in range(n_spring):
                form += springs.half * springs.overlap[s, k] * springs.overlap[s, other]
            loss[k, other] += form
            is_moving = False
            for i in range(n_moving):
                is_moving = is_moving or moving[i] == other
            if not is_moving:
                loss[other, k] += form
