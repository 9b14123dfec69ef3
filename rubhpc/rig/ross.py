"""Rotors of ROSS (ross-rotordynamics) as matrices in the axes of this package.

In ROSS z runs along the shaft, y is up, and a node n, counted from 0, has the degrees x, y, z, alpha, beta,
theta: displacements, and rotations about x, y, z. Here x runs along the shaft, so that ROSS's (z, y, -x) are
(x, y, z), still right-handed: up stays up, and positive spin turns up towards -x of ROSS.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.errors import InputError
from rubhpc.rig.matrices import MatrixRotor
from rubhpc.rig.parts import HELD_BY_DRIVE, Torsion

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.rig.parts import Unbalance

# For each degree of a node here: its name, the one of ROSS, and its sign.
_DEGREES = (("u", 2, 1), ("v", 1, 1), ("w", 0, -1), ("thx", 5, 1), ("thy", 4, 1), ("thz", 3, -1))
_COEFFICIENTS = [f"{letter}{pair}" for letter in "kcm" for pair in ("xx", "xy", "yx", "yy", "zz")]
DIVERGED_SHARE = 0.1  # of the shaft's length
_FREE = 1e-9  # of the greatest stiffness: axial force of a shaft moved along by 1 m, where nothing holds it


def rotor_from_ross(
    rotor: Any,
    *,
    speed: float | None = None,
    torsion: Torsion = HELD_BY_DRIVE,
    unbalance: Sequence[Unbalance] = (),
) -> MatrixRotor:
    """Return the matrices of a `ross.Rotor`, node n of ROSS being node n + 1.

    Parameters
    ----------
    rotor : ross.Rotor
        Of six degrees of freedom a node (ROSS 1.5 and later).
    speed : float, optional
        rad/s, at which bearings are taken whose coefficients depend on the speed.
    torsion : Torsion
        Which node the drive holds, or its spring; ROSS itself leaves torsion free.
    unbalance : sequence of Unbalance

    Raises
    ------
    InputError
        When it is no such rotor, or its bearings depend on a speed that is not given.
    """
    if not all(callable(getattr(rotor, name, None)) for name in "MCKG"):
        raise InputError(f"from_ross: {type(rotor).__name__} is no ross.Rotor; give one")
    if getattr(rotor, "number_dof", None) != len(_DEGREES):
        n_degree = getattr(rotor, "number_dof", "an unknown number of")
        raise InputError(f"from_ross: the rotor has {n_degree} degrees a node, not 6; take ROSS 1.5 or later")
    if speed is None:
        _check_constant(rotor)
        speed = 0.0
    given = {"mass": rotor.M(speed), "damping": rotor.C(speed), "stiffness": rotor.K(speed)}
    given["gyroscopic"] = rotor.G()
    n_node = len(given["mass"]) // len(_DEGREES)
    order = [6 * node + theirs for node in range(n_node) for _, theirs, _ in _DEGREES]
    sign = np.array([s for _ in range(n_node) for *_, s in _DEGREES], dtype=np.float64)
    degrees = [(node, name) for node in range(1, n_node + 1) for name, *_ in _DEGREES]
    matrices = {
        key: np.asarray(value, dtype=np.float64)[np.ix_(order, order)] * np.outer(sign, sign)
        for key, value in given.items()
    }
    held = set()
    if _is_free_along(matrices["stiffness"], degrees):
        held.add((1, "u"))
    if torsion.fixed_node is not None:
        held.add((torsion.fixed_node, "thx"))
    elif (torsion.node, "thx") in degrees:
        row = degrees.index((torsion.node, "thx"))
        matrices["stiffness"][row, row] += torsion.stiffness or 0.0
        matrices["damping"][row, row] += torsion.damping
    if (torsion.fixed_node or torsion.node) > n_node:
        raise InputError(f"from_ross: torsion: the rotor's nodes run from 1 to {n_node}; give one of them")
    free = [row for row, degree in enumerate(degrees) if degree not in held]
    kept: Any = {key: value[np.ix_(free, free)] for key, value in matrices.items()}
    return MatrixRotor(
        **kept,
        degrees=tuple(degrees[row] for row in free),
        unbalance=tuple(unbalance),
        displacement_limit=DIVERGED_SHARE * float(rotor.L),
    )


def _is_free_along(stiffness: NDArray[np.float64], degrees: list[tuple[int, str]]) -> bool:
    """Whether nothing holds the shaft along its axis."""
    along = np.array([name == "u" for _, name in degrees], dtype=np.float64)
    return bool(np.abs(stiffness @ along).max() < _FREE * np.abs(stiffness).max())


def _check_constant(rotor: Any) -> None:
    for bearing in getattr(rotor, "bearing_elements", ()):
        for name in _COEFFICIENTS:
            values = np.atleast_1d(np.asarray(getattr(bearing, name, 0.0), dtype=np.float64))
            if np.ptp(values) > 0.0:
                problem = f"{name} of the bearing at ROSS node {bearing.n} depends on the speed"
                raise InputError(f"from_ross: {problem}; give the speed (rad/s) at which it is taken")
