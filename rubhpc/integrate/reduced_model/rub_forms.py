"""Forms of modal coordinates whose growth is the integral of a pair's normal force times its slip."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.reduced_model.energy_forms import Growth, product_form
from rubhpc.kernels.contact_modes import STILL

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.kernels.contact_modes import ModeTables

    Floats = NDArray[np.float64]


def rub_form(tables: ModeTables, i: int, exponents: tuple[Floats, Floats]) -> Floats | None:
    """Form (2 m, 2 m) for sliding pair i of a contact mode, by its tables (1, ...); None where there is none.

    `exponents` are those of the coordinates and their drift (`mode_library.ModeLibrary.exponents`). Products
    of two coordinates that do not move or grow linearly are not in the form, nor that of the unbalance
    response with itself (`kernels.friction_work.rubbed`). Other products without a growth have no form.
    """
    (real, imaginary), drift = exponents
    exponent, first = real + 1j * imaginary, int(tables.n_eigenmode[0])
    if np.any(np.abs(exponent[:first]) <= STILL):
        return None
    force, slip = (tables.switch_re[0, k] + 1j * tables.switch_im[0, k] for k in (2 * i, 2 * i + 1))
    which = np.flatnonzero(drift)
    power, with_conjugate = np.outer(slip, force), np.outer(slip, force.conj())
    for product, other in ((power, exponent), (with_conjugate, exponent.conj())):
        product[first + 1 :, first + 1 :] = 0.0
        is_still = np.abs(exponent[:, None] + other) <= STILL
        is_still[first, first] = False
        if product[is_still].any():
            return None
    if slip[which].any():
        return None
    growing = Growth(which, drift[which], first + 1 + len(tables.switch_re[0]) // 2)
    return product_form(power, with_conjugate, exponent, first, growing)
