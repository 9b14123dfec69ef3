"""The largest Lyapunov exponents of a motion, by its exact tangent map."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.marches.case_modes import NoClosedForm
from rubhpc.integrate.periodic_motions.piecewise_motion import Unfollowed

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.periodic_motions.collocated_motion import FollowedMotion

    Floats = NDArray[np.float64]

ALIGNING, FOLLOWED = 16, 256  # revolutions: to align the displacements, then to measure
LOST = 1e-280  # a smaller displacement counts as zero


def spectrum_of(begin: Callable[[], FollowedMotion], n_exponent: int) -> dict[str, float]:
    """Measures `lyapunov_1`, ... and `kaplan_yorke_dimension` of the motion from where a case stands.

    Parameters
    ----------
    begin : callable
        Makes its piecewise motion. Where that cannot be followed, all values are NaN.
    n_exponent : int
        Exponents; those beyond the number of states are NaN.
    """
    found = np.full(n_exponent, np.nan)
    dimension = np.nan
    try:
        piecewise = begin()
        n = min(n_exponent, 2 * piecewise.n)
        found[:n] = exponents(piecewise, n)
        dimension = kaplan_yorke_dimension(found[:n], is_whole=n == 2 * piecewise.n)
    except (NoClosedForm, Unfollowed):
        pass
    names = [f"lyapunov_{k}" for k in range(1, n_exponent + 1)]
    return dict(zip(names, found.tolist(), strict=True)) | {"kaplan_yorke_dimension": float(dimension)}


def exponents(
    piecewise: FollowedMotion,
    n_exponent: int,
    *,
    aligning: int = ALIGNING,
    followed: int = FOLLOWED,
) -> Floats:
    """The largest Lyapunov exponents per revolution, (n_exponent,), largest first.

    Displacements are propagated by the exact tangent map, exponentials and saltation matrices, and
    orthogonalised after every revolution (Benettin, Galgani, Giorgilli and Strelcyn 1980). -inf where an
    impact or a closed gap removes a direction.

    Raises
    ------
    Unfollowed
        The motion cannot be followed from event to event.
    """
    weight = np.repeat([abs(piecewise.setup.spin), 1.0], piecewise.n)[:, None]  # energies are their squares
    # Columns that mix displacements and velocities, the same for every case.
    angle = np.pi * (np.arange(2 * piecewise.n) + 0.5) / (2 * piecewise.n)
    columns = np.linalg.qr(np.cos(np.outer(angle, np.arange(n_exponent))))[0]
    piecewise.stand_at(piecewise.start, piecewise.states)
    grown = np.zeros(n_exponent)
    for i_revolution in range(aligning + followed):
        columns, triangle = np.linalg.qr(weight * piecewise.go_on(columns / weight))
        if i_revolution >= aligning:
            size = np.abs(np.diag(triangle))
            with np.errstate(divide="ignore"):
                grown += np.log(np.where(size > LOST, size, 0.0))
    return -np.sort(-grown / followed)


def kaplan_yorke_dimension(exponent: Floats, *, is_whole: bool) -> float:
    """Dimension of the attractor in a section at one angle of the shaft (Kaplan and Yorke 1979).

    `j + (l_1 + ... + l_j) / |l_(j+1)|` with the largest j whose sum is not negative; NaN where more exponents
    are needed.

    Parameters
    ----------
    exponent : (n,)
        Largest first.
    is_whole : bool
        Whether these are all.
    """
    total = np.cumsum(exponent)
    negative = np.flatnonzero(total < 0.0)
    if not negative.size:
        return float(exponent.size) if is_whole else float("nan")
    j = int(negative[0])
    return j + (float(total[j - 1] / -exponent[j]) if j else 0.0)
